#!/usr/bin/env bash
# robosuite 1.5.2 (MuJoCo 3.3.7): a MujocoXMLObject put into a task loses its <equality> and its
# <contact><exclude>, without a word.
#
# Seen: two boxes on slides, one of which follows the other (polycoef "0 -1 0 0 0"), which overlap and are
# excluded from contact. MuJoCo compiles the file alone with one equality and one exclude. The same file as
# the only object of a ManipulationTask: none of either, and the two boxes touch. Joints that are coupled
# move apart then, and parts that overlap by construction push each other: an object must do without both.
# (The task takes the object's assets and its body, and leaves the rest of the file.)
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet robosuite==1.5.2 mujoco==3.3.7
cat > "$work/two.xml" <<'XML'
<mujoco model="two">
  <worldbody>
    <body>
      <body name="object">
        <body name="left" pos="2 0 0"><joint name="a" type="slide" axis="1 0 0"/><geom name="l" type="box" size=".1 .1 .1" group="0"/></body>
        <body name="right" pos="2.15 0 0"><joint name="b" type="slide" axis="1 0 0"/><geom name="r" type="box" size=".1 .1 .1" group="0"/></body>
      </body>
      <site name="bottom_site" pos="0 0 -.1"/><site name="top_site" pos="0 0 .1"/><site name="horizontal_radius_site" pos=".3 0 0"/>
    </body>
  </worldbody>
  <contact><exclude body1="left" body2="right"/></contact>
  <equality><joint joint1="b" joint2="a" polycoef="0 -1 0 0 0"/></equality>
</mujoco>
XML
"$work/venv/bin/python" - "$work/two.xml" <<'PY' 2>/dev/null
import contextlib, io, sys
with contextlib.redirect_stdout(io.StringIO()):
    import mujoco, robosuite
    from robosuite.models.arenas import EmptyArena
    from robosuite.models.objects import MujocoXMLObject
    from robosuite.models.robots import create_robot
    from robosuite.models.tasks import ManipulationTask

def touching(model):
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    pairs = [{model.geom(c.geom1).name, model.geom(c.geom2).name} for c in data.contact]
    return any(all(name.endswith(end) for name, end in zip(sorted(pair), "lr")) for pair in pairs)

alone = mujoco.MjModel.from_xml_path(sys.argv[1])
with contextlib.redirect_stdout(io.StringIO()):
    thing = MujocoXMLObject(sys.argv[1], name="two", joints=None, duplicate_collision_geoms=False)
    task = ManipulationTask(mujoco_arena=EmptyArena(), mujoco_robots=[create_robot("Panda")], mujoco_objects=[thing])
    inside = task.get_model(mode="mujoco")
print(f"robosuite {robosuite.__version__}, mujoco {mujoco.__version__}")
print(f"alone: {alone.neq} equality, {alone.nexclude} exclude, boxes touch: {touching(alone)}")
print(f"in a task: {inside.neq} equality, {inside.nexclude} exclude, boxes touch: {touching(inside)}")
assert (alone.neq, alone.nexclude, touching(alone)) == (1, 1, False)
assert (inside.neq, inside.nexclude, touching(inside)) == (0, 0, True), "no longer so"
PY
