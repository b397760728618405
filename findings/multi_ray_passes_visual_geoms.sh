#!/usr/bin/env bash
# MuJoCo 3.17.0: mj_multiRay misses surfaces that mj_ray hits, where a body has both geoms that collide
# and geoms that do not (contype and conaffinity 0: the usual way to write looks).
#
# Seen: 400 rays at a visual box of 60 cm. Alone in its body, both calls hit it equally often. With a
# small colliding sphere in the same body, mj_ray still hits, mj_multiRay passes through almost always:
# it skips a body by a box around what collides. A depth picture cast with mj_multiRay therefore lacks
# most of such a body, without a word. Casting ray by ray, or asking for the geoms' own boxes, is right.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet mujoco==3.17.0 numpy
"$work/venv/bin/python" - <<'PY'
import mujoco, numpy as np

def hits(more):
    xml = f"""<mujoco><worldbody><body>
        <geom type="box" size="0.3 0.3 0.3" contype="0" conaffinity="0"/>{more}
    </body></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    rng, n, eye = np.random.default_rng(0), 400, np.array([2.0, 0.0, 0.0])
    ways = 0.3 * rng.normal(size=(n, 3)) - eye
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    far, geom, one = np.zeros(n), np.zeros(n, np.int32), np.zeros(1, np.int32)
    mujoco.mj_multiRay(model, data, eye, ways.ravel(), None, True, -1, geom, far, None, n, 1e9)
    single = [mujoco.mj_ray(model, data, eye, way, None, True, -1, one, None) for way in ways]
    return int((np.array(single) >= 0).sum()), int((far >= 0).sum())

alone = hits("")
beside = hits('<geom type="sphere" size="0.02" pos="0 0 0.4"/>')
print(f"mujoco {mujoco.__version__}; hits of mj_ray, mj_multiRay: alone {alone}, beside a colliding sphere {beside}")
assert alone[0] == alone[1] > 200, "the box alone"
assert beside[0] > 200 and beside[1] < 0.1 * beside[0], "no longer so"
PY
