#!/usr/bin/env python3
"""Control steps per second of robosuite's Lift (Panda, OSC_POSE, 20 Hz, no pictures): what crates/sim/examples/speed.rs is compared with.

pip install robosuite==1.5.2 mujoco==3.3.7; then: robosuite_speed.py [SECONDS]
"""
import multiprocessing as mp
import sys
import time


def work(seed, seconds):
    import numpy as np
    import robosuite

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
    for processes in (1, 2):
        with mp.get_context("spawn").Pool(processes) as pool:
            rates = pool.starmap(work, [(seed, seconds) for seed in range(processes)])
        print(f"{processes} processes: {sum(rates):.0f} steps/s")
