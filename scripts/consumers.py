#!/usr/bin/env python3
"""What other programs make of a twin: a table.

    scripts/consumers.py RUN/twin... [--only mujoco,drake] [--keep FOLDER]

Installs each program, pinned, into a virtual environment of its own (in a temporary folder, or in FOLDER,
where a second run finds them), loads every twin there, and compares, at five configurations: link poses
with those that twin.json says (scene units), masses (kg) and principal inertias (kg m^2), relative to
the largest; and whether something of the photographs or colours arrived. Needs the package index; outside
`make test`. Exit 1 if something that was loaded differs by more than 1e-6, or could not be loaded.
"""

import argparse
import json
import math
import pathlib
import subprocess
import sys
import tempfile
import venv

# Name: packages, files of a twin that it reads.
CONSUMERS = {
    "mujoco 3.3.7": (["mujoco==3.3.7"], ["robot.xml", "robot.urdf"]),
    "mujoco 3.17.0": (["mujoco==3.17.0"], ["robot.xml", "robot.urdf"]),
    "mujoco 4.0": (["mujoco>=4.0,<4.1"], ["robot.xml", "robot.urdf"]),
    "dm_control": (["dm_control", "mujoco==3.17.0"], ["robot.xml"]),
    "robosuite": (["robosuite==1.5.2", "mujoco==3.3.7"], ["robosuite_object.py"]),
    "drake": (["drake"], ["robot.urdf", "robot.xml", "robot.sdf"]),
    "pin": (["pin"], ["robot.urdf"]),
    "yourdfpy": (["yourdfpy==0.0.60"], ["robot.urdf"]),
    "pybullet": (["pybullet"], ["robot.urdf"]),
    "usd-core": (["usd-core"], ["robot.usda"]),
    "trimesh": (["trimesh", "pillow", "scipy"], ["robot.glb"]),
}
MOST = 1e-6
CONFIGURATIONS = 5


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("twins", nargs="+", type=pathlib.Path)
    parser.add_argument("--only", default="", help="beginnings of the programs' names, with commas")
    parser.add_argument("--keep", type=pathlib.Path, help="folder of the environments, kept")
    parser.add_argument("--inside", nargs=2, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.inside:
        return inside(*args.inside, args.twins[0])
    wanted = [name for name in args.only.split(",") if name]
    with tempfile.TemporaryDirectory() as temporary:
        folder = args.keep or pathlib.Path(temporary)
        print("| program | file | twin | poses | mass | inertia | colours |\n|---|---|---|---|---|---|---|")
        fine = True
        for name, (packages, files) in CONSUMERS.items():
            if wanted and not any(name.startswith(w) for w in wanted):
                continue
            python, trouble = environment(folder / name.replace(" ", "_"), packages)
            for twin in args.twins:
                for file in files:
                    row = {"error": trouble} if trouble else ask(python, name, file, twin)
                    fine &= show(name, file, twin, row)
    return 0 if fine else 1


def environment(folder, packages):
    """Python of an environment with some packages, and what went wrong."""
    python = folder / "bin" / "python"
    if not (folder / "whole").exists():
        venv.create(folder, with_pip=True, clear=True)
        command = [python, "-m", "pip", "install", "-q", "--only-binary", ":all:", "numpy", *packages]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode != 0:
            return python, "not installed: " + (done.stderr.strip().splitlines() or ["?"])[-1]
        (folder / "whole").touch()
    return python, None


def ask(python, name, file, twin):
    """What a program says of a file, asked in its own process."""
    command = [python, __file__, str(twin), "--inside", name, file]
    done = subprocess.run(command, capture_output=True, text=True)
    answer = [line for line in done.stdout.splitlines() if line.startswith("{")]
    if done.returncode != 0 or not answer:
        return {"error": (done.stderr.strip().splitlines() or ["no answer"])[-1]}
    return json.loads(answer[-1])


def show(name, file, twin, row):
    label = f"| {name} {row.get('version', '')} | {file} | {twin.parent.name} "
    if "error" in row:
        print(label + f"| {row['error'][:150]} | | | |", flush=True)
        return False
    numbers = [row.get(key) for key in ("poses", "mass", "inertia")]
    cells = ["not read" if x is None else f"{x:.1e}" for x in numbers]
    print(label + "| " + " | ".join(cells) + f" | {row.get('colours', '')} |", flush=True)
    return all(x is None or x <= MOST for x in numbers)


def inside(name, file, folder):
    """In the program's environment: one line of JSON."""
    import numpy as np

    twin = Twin(np, json.loads((folder / "twin.json").read_text()))
    reader = globals()["with_" + name.split()[0].replace("-", "_")]
    seen = reader(np, twin, folder / file)
    worst = {"version": seen["version"], "colours": seen.get("colours", "")}
    if "poses" in seen:
        worst["poses"] = max(
            float(np.abs(np.asarray(seen["poses"][k][part["name"]]) - twin.poses(q)[i]).max())
            for k, q in enumerate(twin.configurations())
            for i, part in enumerate(twin.parts)
        )
    if "masses" in seen:
        should = np.array([part["mass"] for part in twin.parts])
        worst["mass"] = float(np.abs(np.asarray(seen["masses"]) - should).max() / should.max())
    if "inertias" in seen:
        should = np.array([np.linalg.eigvalsh(np.array(part["inertia"])) for part in twin.parts])
        found = np.sort(np.asarray(seen["inertias"]), axis=1)
        worst["inertia"] = float(np.abs(found - should).max() / should.max())
    print(json.dumps(worst))
    return 0


class Twin:
    """What twin.json says."""

    def __init__(self, np, said):
        self.np, self.parts, self.joints = np, said["parts"], said["tree"]["joints"]
        self.couplings = said["tree"].get("couplings", [])
        self.up = np.array(said["up"])

    def configurations(self):
        """Values of all joints, five times over their ranges; those that follow follow."""
        out = []
        for k in range(CONFIGURATIONS):
            share = k / (CONFIGURATIONS - 1)
            q = [low + share * (high - low) for low, high in (j["limits"] for j in self.joints)]
            for _ in self.couplings:
                for c in self.couplings:
                    q[c["follower"]] = sum(p * q[c["leader"]] ** n for n, p in enumerate(c["polynomial"]))
            out.append(q)
        return out

    def poses(self, q):
        """World from link, of each part. (n, 4, 4)"""
        np = self.np
        poses = {}
        while len(poses) < len(self.parts):
            for part in range(len(self.parts)):
                joint = next((k for k, j in enumerate(self.joints) if j["child"] == part), None)
                if joint is None:
                    poses[part] = np.eye(4)
                elif self.joints[joint]["parent"] in poses:
                    poses[part] = poses[self.joints[joint]["parent"]] @ self.motion(joint, q[joint])
        out = np.array([poses[part] for part in range(len(self.parts))])
        for part, pose in enumerate(out):
            pose[:3, 3] += pose[:3, :3] @ np.array(self.parts[part]["link_origin"])
        return out

    def motion(self, joint, value):
        np, screw, pose = self.np, self.joints[joint]["screw"], self.np.eye(4)
        axis, pivot = np.array(screw["axis"]), np.array(screw["pivot"])
        if screw["kind"] == "prismatic":
            pose[:3, 3] = value * axis
        elif screw["kind"] != "fixed":
            pose[:3, :3] = turned(np, axis, value)
            pose[:3, 3] = pivot - pose[:3, :3] @ pivot
        return pose

    def named(self, q):
        """Values of the joints that move, by name."""
        return {j["name"]: v for j, v in zip(self.joints, q) if j["screw"]["kind"] != "fixed"}

    def names(self):
        return [part["name"] for part in self.parts]


def turned(np, axis, angle):
    """Rodrigues' formula."""
    x, y, z = axis
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * k @ k


def pose_of(np, rotation, translation):
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, translation
    return pose


def with_mujoco(np, twin, path):
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(path))
    return of_mujoco(np, twin, mujoco, model, mujoco.MjData(model), mujoco.__version__)


def of_mujoco(np, twin, mujoco, model, data, version, prefix=""):
    poses = []
    for q in twin.configurations():
        for name, value in twin.named(q).items():
            data.joint(prefix + name).qpos[0] = value
        mujoco.mj_kinematics(model, data)
        bodies = {name: data.body(prefix + name) for name in twin.names()}
        poses.append({n: pose_of(np, b.xmat.reshape(3, 3), b.xpos).tolist() for n, b in bodies.items()})
    ids = [model.body(prefix + name).id for name in twin.names()]
    colours = f"{model.ntex} textures" if model.ntex else "mean colours"
    return {
        "version": version,
        "poses": poses,
        "masses": model.body_mass[ids],
        "inertias": model.body_inertia[ids],
        "colours": colours,
    }


def with_dm_control(np, twin, path):
    import importlib.metadata

    import mujoco
    from dm_control import mjcf

    physics = mjcf.Physics.from_xml_path(str(path))
    model, data = physics.model.ptr, physics.data.ptr
    return of_mujoco(np, twin, mujoco, model, data, importlib.metadata.version("dm_control"))


def with_robosuite(np, twin, path):
    """As an object of a world, poses relative to its base."""
    import contextlib
    import importlib.util
    import os

    with contextlib.redirect_stdout(open(os.devnull, "w")):
        import mujoco
        import robosuite
        from robosuite.models.base import MujocoXML
        from robosuite.models.world import MujocoWorldBase

    spec = importlib.util.spec_from_file_location("robosuite_object", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    thing = module.Twin("thing")
    assert len(thing.hinges) == len(twin.joints) and thing.top_offset[2] > 0, (thing.hinges, thing.top_offset)
    world = MujocoWorldBase()
    MujocoXML.merge_assets(world, thing)
    world.worldbody.append(thing.get_obj())
    model = world.get_model(mode="mujoco")

    seen = of_mujoco(np, twin, mujoco, model, mujoco.MjData(model), robosuite.__version__, thing.naming_prefix)
    base = twin.names()[root_of(twin)]
    seen["poses"] = [{n: np.linalg.inv(p[base]) @ np.array(x) for n, x in p.items()} for p in seen["poses"]]
    return seen


def with_drake(np, twin, path):
    import importlib.metadata

    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
    from pydrake.systems.framework import DiagramBuilder

    builder = DiagramBuilder()
    plant, scene = AddMultibodyPlantSceneGraph(builder, 1e-3)
    Parser(plant).AddModels(str(path))
    root = twin.names()[root_of(twin)]
    if path.suffix == ".urdf":
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(root))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    poses = []
    for q in twin.configurations():
        for name, value in twin.named(q).items():
            joint = plant.GetJointByName(name)
            set_to = joint.set_angle if hasattr(joint, "set_angle") else joint.set_translation
            set_to(context, value)
        bodies = {name: plant.GetBodyByName(name) for name in twin.names()}
        poses.append({n: plant.EvalBodyPoseInWorld(context, b).GetAsMatrix4().tolist() for n, b in bodies.items()})
    spatial = [plant.GetBodyByName(n).default_spatial_inertia() for n in twin.names()]
    centred = [s.Shift(s.get_com()).CalcRotationalInertia().CalcPrincipalMomentsOfInertia() for s in spatial]
    visuals = scene.model_inspector().num_geometries()
    return {
        "version": importlib.metadata.version("drake"),
        "poses": poses,
        "masses": [s.get_mass() for s in spatial],
        "inertias": centred,
        "colours": f"{visuals} shapes",
    }


def root_of(twin):
    return next(i for i in range(len(twin.parts)) if all(j["child"] != i for j in twin.joints))


def with_pin(np, twin, path):
    import pinocchio

    model = pinocchio.buildModelFromUrdf(str(path))
    data = model.createData()
    poses = []
    for q in twin.configurations():
        at = pinocchio.neutral(model)
        for name, value in twin.named(q).items():
            joint = model.joints[model.getJointId(name)]
            at[joint.idx_q : joint.idx_q + joint.nq] = [value] if joint.nq == 1 else [math.cos(value), math.sin(value)]
        pinocchio.framesForwardKinematics(model, data, at)
        poses.append({n: data.oMf[model.getFrameId(n, pinocchio.FrameType.BODY)].homogeneous.tolist() for n in twin.names()})
    return {"version": pinocchio.__version__, "poses": poses}


def with_yourdfpy(np, twin, path):
    import yourdfpy

    robot = yourdfpy.URDF.load(str(path))
    root = twin.names()[root_of(twin)]
    poses = []
    for q in twin.configurations():
        robot.update_cfg({n: v for n, v in twin.named(q).items() if n in robot.actuated_joint_names})
        poses.append({n: robot.get_transform(n, root).tolist() for n in twin.names()})
    links = [robot.link_map[n].inertial for n in twin.names()]
    looks = sorted({type(g.visual).__name__ for g in robot.scene.geometry.values()})
    return {
        "version": yourdfpy.__version__,
        "poses": poses,
        "masses": [i.mass for i in links],
        "inertias": [np.linalg.eigvalsh(i.inertia) for i in links],
        "colours": ", ".join(looks),
    }


def with_pybullet(np, twin, path):
    import importlib.metadata

    import pybullet

    pybullet.connect(pybullet.DIRECT)
    body = pybullet.loadURDF(str(path), useFixedBase=True, flags=pybullet.URDF_USE_INERTIA_FROM_FILE)
    infos = [pybullet.getJointInfo(body, k) for k in range(pybullet.getNumJoints(body))]
    link = {info[12].decode(): k for k, info in enumerate(infos)}
    joint = {info[1].decode(): k for k, info in enumerate(infos)}
    root = twin.names()[root_of(twin)]
    poses = []
    for q in twin.configurations():
        for name, value in twin.named(q).items():
            pybullet.resetJointState(body, joint[name], value)
        found = {root: np.eye(4).tolist()}
        for name in twin.names():
            if name != root:
                at, turn = pybullet.getLinkState(body, link[name], computeForwardKinematics=True)[4:6]
                rotation = np.array(pybullet.getMatrixFromQuaternion(turn)).reshape(3, 3)
                found[name] = pose_of(np, rotation, at).tolist()
        poses.append(found)
    masses = [pybullet.getDynamicsInfo(body, link.get(name, -1))[0] for name in twin.names()]
    # A fixed base weighs nothing there.
    masses[root_of(twin)] = twin.parts[root_of(twin)]["mass"]
    return {"version": importlib.metadata.version("pybullet"), "poses": poses, "masses": masses}


def with_usd_core(np, twin, path):
    import importlib.metadata

    from pxr import Gf, Usd, UsdGeom, UsdPhysics, UsdShade, UsdValidation

    stage = Usd.Stage.Open(str(path))
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    wrong = UsdValidation.ValidationContext(validators).Validate(stage)
    if wrong:
        raise SystemExit(f"{wrong[0].GetName()}: {wrong[0].GetMessage()}")

    def shown(name, kind):
        named = (p for p in stage.Traverse() if p.GetMetadata("displayName") == name)
        return next(p for p in named if kind(p))

    links = {n: shown(n, lambda p: p.HasAPI(UsdPhysics.RigidBodyAPI)) for n in twin.names()}
    joints = {j["name"]: shown(j["name"], lambda p: p.IsA(UsdPhysics.Joint)) for j in twin.joints}
    upright = np.array(UsdGeom.XformCache().GetLocalToWorldTransform(stage.GetDefaultPrim())).T
    assert np.allclose(upright[:3, :3] @ twin.up, [0, 0, 1], atol=1e-6)

    def frame(position, rotation):
        matrix = Gf.Matrix4d().SetRotate(Gf.Quatd(rotation.Get()))
        return np.array(matrix.SetTranslateOnly(Gf.Vec3d(position.Get()))).T

    poses = []
    for q in twin.configurations():
        found = {}
        root = twin.names()[root_of(twin)]
        found[root] = np.array(UsdGeom.Xformable(links[root]).GetLocalTransformation()).T
        while len(found) < len(links):
            for joint, value in zip(twin.joints, q):
                carrier, carried = twin.names()[joint["parent"]], twin.names()[joint["child"]]
                if carrier not in found or carried in found:
                    continue
                prim = UsdPhysics.Joint(joints[joint["name"]])
                before = frame(prim.GetLocalPos0Attr(), prim.GetLocalRot0Attr())
                after = frame(prim.GetLocalPos1Attr(), prim.GetLocalRot1Attr())
                motion = np.eye(4)
                if prim.GetPrim().IsA(UsdPhysics.RevoluteJoint):
                    motion[:3, :3] = turned(np, [1, 0, 0], value)
                elif prim.GetPrim().IsA(UsdPhysics.PrismaticJoint):
                    motion[0, 3] = value
                found[carried] = found[carrier] @ before @ motion @ np.linalg.inv(after)
        poses.append({n: p.tolist() for n, p in found.items()})
    mass = {n: UsdPhysics.MassAPI(p) for n, p in links.items()}
    textures = sum(p.IsA(UsdShade.Material) for p in stage.Traverse())
    return {
        "version": importlib.metadata.version("usd-core"),
        "poses": poses,
        "masses": [mass[n].GetMassAttr().Get() for n in twin.names()],
        "inertias": [list(mass[n].GetDiagonalInertiaAttr().Get()) for n in twin.names()],
        "colours": f"{textures} textures",
    }


def with_trimesh(np, twin, path):
    import trimesh

    scene = trimesh.load(str(path))
    # y is up in glTF: back to the twin's world.
    root = scene.graph.get(scene.graph.transforms.children[scene.graph.base_frame][0])[0]
    found = {n: (np.linalg.inv(root) @ scene.graph.get(n)[0]).tolist() for n in twin.names()}
    rest = twin.poses([0.0] * len(twin.joints))
    off = max(np.abs(np.asarray(found[n]) - rest[i]).max() for i, n in enumerate(twin.names()))
    if off > MOST:
        raise SystemExit(f"links are {off} off with all joints at 0")
    looks = sorted({type(g.visual).__name__ for g in scene.geometry.values()})
    return {"version": trimesh.__version__, "colours": ", ".join(looks)}


if __name__ == "__main__":
    sys.exit(main())
