#!/usr/bin/env python3
"""Control steps per second of robosuite's table scene (Panda, OSC_POSE, 20 Hz, no pictures) with our covered box in place of Lift's cube:
what crates/sim/examples/speed.rs is compared with.

pip install robosuite==1.5.2 mujoco==3.3.7; then: robosuite_speed.py [SECONDS] [box|cube]
"""
import multiprocessing as mp
import pathlib
import re
import sys
import tempfile
import time

BOX = pathlib.Path(__file__).parent.parent / "objects/covered_box/object.xml"
SITES = "".join(
    f'<site rgba="0 0 0 0" size="0.005" pos="{at}" name="{name}"/>'
    for name, at in [("bottom_site", "0 0 0"), ("top_site", "0 0 0.09"), ("horizontal_radius_site", "0.06 0.05 0")]
)


def covered_box():
    """The box as robosuite wants its objects: a body `object` within a body, three sites, plain colours."""
    text = BOX.read_text()
    body = re.search(r'<body name="box".*</body>', text, re.S)[0].replace('name="box" pos="0 0 0"', 'name="object"')
    body = re.sub(r'material="\w+"', 'rgba=".6 .6 .6 1"', body).replace("<geom ", '<geom group="0" ')
    xml = f'<mujoco model="box"><asset/><worldbody><body>{body}{SITES}</body></worldbody></mujoco>'
    path = pathlib.Path(tempfile.mkdtemp()) / "box.xml"
    path.write_text(xml)
    return str(path)


def work(seed, seconds, thing):
    import numpy as np
    import robosuite
    from robosuite.environments.manipulation import lift
    from robosuite.models.objects import MujocoXMLObject

    if thing == "box":
        path = covered_box()
        free = [dict(type="free", damping="0.0005")]

        def box(name, **_):
            made = MujocoXMLObject(path, name=name, joints=free, obj_type="all")
            # Lift places its object by the first joint.
            made._joints.sort(key=lambda joint: "lid" in joint)
            return made

        lift.BoxObject = box
    env = robosuite.make(
        "Lift",
        robots="Panda",
        has_renderer=False,
        has_offscreen_renderer=False,
        use_camera_obs=False,
        use_object_obs=True,
        reward_shaping=False,
        control_freq=20,
        horizon=200,
        ignore_done=True,
        hard_reset=False,
    )
    rng = np.random.default_rng(seed)
    env.reset()
    low, high = env.action_spec
    start, steps = time.perf_counter(), 0
    while time.perf_counter() - start < seconds:
        if steps % 200 == 0:
            env.reset()
        env.step(rng.uniform(low, high))
        steps += 1
    return steps / (time.perf_counter() - start)


if __name__ == "__main__":
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 5.0
    thing = sys.argv[2] if len(sys.argv) > 2 else "box"
    for processes in (1, 2):
        with mp.get_context("spawn").Pool(processes) as pool:
            rates = pool.starmap(work, [(seed, seconds, thing) for seed in range(processes)])
        print(f"{processes} processes: {sum(rates):.0f} steps/s with the {thing}")
