#!/usr/bin/env python3
"""Recordings by a renderer that shares no code with hingecast, from scans to parts.

    scripts/other_renderer.py BINARY WORK_FOLDER OBJECT_FOLDER ... [--noise] [--seed N] [--push MM]

For every PartNet-Mobility folder: poses the links with yourdfpy, casts rays with Embree in a room (floor,
wall, clutter), seven configurations of 24 views at 320 x 240 from the front, and writes them twice: as seven
nerfstudio scans, each with a world of its own and without masks, and as one recording with a common world
and true masks. Both are built to parts. Prints a table: how far the imported worlds are off, parts and types,
errors of the axes in both, and their ratio. `--noise` adds errors of depth that neighbours share, flying
pixels and drifting cameras; `--push` moves the object by so much in state 3. Fetches its packages from PyPI.
Not in CI: it takes objects that are not ours and minutes for each.
"""
import argparse, itertools, json, pathlib, subprocess, sys

PACKAGES = ["numpy==2.4.6", "pillow==13.0.0", "scipy==1.17.1", "trimesh==4.8.3", "yourdfpy==0.0.60", "embreex==4.4.0.post1"]
STATES, VIEWS, WIDTH, HEIGHT, FOCAL = 7, 24, 320, 240, 265.0
DIAGONAL = 0.8  # metres, of every object
UNIT = 1e-4  # metres of one step of depth


def in_own_python(work):
    """Starts again in a Python with the packages, unless this is one."""
    python = work / "venv" / "bin" / "python"
    if pathlib.Path(sys.prefix).resolve() == (work / "venv").resolve():
        return
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", work / "venv"], check=True)
        subprocess.run([python, "-m", "pip", "install", "-q", *PACKAGES], check=True)
    sys.exit(subprocess.run([python, *sys.argv]).returncode)


class Thing:
    """An object on the floor of a room. World: metres, z up, the front towards -x."""

    def __init__(self, folder, rng):
        import yourdfpy

        self.urdf = yourdfpy.URDF.load(str(folder / "mobility.urdf"), load_collision_meshes=False)
        joints = [self.urdf.joint_map[name] for name in self.urdf.actuated_joint_names]
        self.joints = [j for j in joints if j.type != "continuous"]  # wheels: turned or not, they look alike
        low, high = [j.limit.lower for j in self.joints], [j.limit.upper for j in self.joints]
        shares = np.vstack([np.full(len(low), 0.5), rng.uniform(0.0, 1.0, (STATES - 1, len(low)))])
        self.values = np.array(low) + shares * (np.array(high) - np.array(low))
        points = np.vstack([self.posed(k)[0] for k in range(STATES)])
        rest = self.posed(0)[0]
        self.scale = DIAGONAL / np.linalg.norm(np.ptp(rest, axis=0))
        self.middle = np.append((rest.min(0) + rest.max(0))[:2] / 2, points[:, 2].min())
        self.extent = (points - self.middle) * self.scale

    def posed(self, state):
        """Vertices (n, 3) in the file's frame, triangles (m, 3), colours (n, 3) of a state."""
        self.urdf.update_cfg(dict(zip((j.name for j in self.joints), self.values[state])))
        scene, points, faces, colours, n = self.urdf.scene, [], [], [], 0
        for node in scene.graph.nodes_geometry:
            pose, name = scene.graph[node]
            mesh = scene.geometry[name]
            points.append(mesh.vertices @ pose[:3, :3].T + pose[:3, 3])
            faces.append(mesh.faces + n)
            colours.append(colours_of(mesh))
            n += len(mesh.vertices)
        return np.vstack(points), np.vstack(faces), np.vstack(colours)

    def axis(self, joint):
        """Direction of a joint in the world, state 0."""
        self.urdf.update_cfg(dict(zip((j.name for j in self.joints), self.values[0])))
        return self.urdf.get_transform(joint.child)[:3, :3] @ np.array(joint.axis)

    def in_room(self, state, push):
        """As `posed`, on the floor at the origin, and the room behind the object's own triangles."""
        points, faces, colours = self.posed(state)
        points = ((points - self.middle) * self.scale) @ push[:3, :3].T + push[:3, 3]
        own = len(faces)
        for corners, sides in self.room():
            faces = np.vstack([faces, sides + len(points)])
            points = np.vstack([points, corners])
            colours = np.vstack([colours, np.tile([[120, 90, 60]], (len(corners), 1)) + 9 * len(faces) % 60])
        return points, faces, colours, own

    def room(self):
        import trimesh

        back, side = self.extent[:, 0].max() + 0.06, np.abs(self.extent[:, 1]).max()
        floor = trimesh.creation.box(bounds=[[-4, -4, -0.1], [back + 0.1, 4, 0]])
        wall = trimesh.creation.box(bounds=[[back, -4, -0.1], [back + 0.2, 4, 2.5]])
        crate = trimesh.creation.box([0.3, 0.25, 0.35], transform=moved([back - 0.25, side + 0.4, 0.175], 0.4))
        low = trimesh.creation.box([0.2, 0.4, 0.15], transform=moved([-0.3, -side - 0.45, 0.075], -0.7))
        bin_ = trimesh.creation.cylinder(0.12, 0.4, transform=moved([back - 0.2, -side - 0.5, 0.2], 0.0))
        return [(np.array(m.vertices), np.array(m.faces)) for m in (floor, wall, crate, low, bin_)]

    def cameras(self, rng):
        """World from camera (OpenGL) of the views of one scan: a walk around the front."""
        start, to = rng.uniform(-80, -65), rng.uniform(65, 80)
        centre = np.array([0, 0, (self.extent[:, 2].max()) / 2])
        for i in range(VIEWS):
            azimuth = np.radians(start + (to - start) * i / (VIEWS - 1))
            height = np.radians(28 + 20 * np.sin(i * 0.9 + start))
            away = rng.uniform(1.15, 1.35)
            eye = centre + away * np.array([-np.cos(azimuth) * np.cos(height), np.sin(azimuth) * np.cos(height), np.sin(height)])
            yield looking(eye, centre + rng.normal(0, 0.02, 3))


def colours_of(mesh):
    """(n, 3) of a mesh's vertices, grey where it has no colour of its own."""
    try:
        told = np.asarray(mesh.visual.to_color().vertex_colors)[:, :3]
    except (TypeError, AttributeError, ValueError):
        told = np.empty((0, 3))
    return told if len(told) == len(mesh.vertices) else np.full((len(mesh.vertices), 3), 160)


def moved(shift, yaw):
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("z", yaw).as_matrix()
    pose[:3, 3] = shift
    return pose


def looking(eye, target):
    back = (eye - target) / np.linalg.norm(eye - target)
    right = np.cross([0, 0, 1.0], back)
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = np.stack([right, np.cross(back, right), back], 1), eye
    return pose


def picture(scene, geometry, camera):
    """Colour, depth in metres along z, and whether a pixel shows the object."""
    points, faces, colours, own = geometry
    x, y = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    rays = np.stack([(x - WIDTH / 2) / FOCAL, -(y - HEIGHT / 2) / FOCAL, -np.ones_like(x)], -1).reshape(-1, 3)
    origin = np.repeat(camera[None, :3, 3], len(rays), 0).astype(np.float32)
    hit = scene.run(origin, (rays @ camera[:3, :3].T).astype(np.float32), output=1)
    face, seen = hit["primID"], hit["primID"] >= 0
    depth = np.where(seen, hit["tfar"], 0.0)  # rays have z 1: t is depth
    corners = points[faces[face]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    light = np.abs(normal @ [0.3, 0.4, 0.85]) / np.maximum(np.linalg.norm(normal, axis=1), 1e-12)
    rgb = colours[faces[face, 0]] * (0.35 + 0.6 * light)[:, None] * seen[:, None]
    shape = (HEIGHT, WIDTH)
    return rgb.reshape(*shape, 3).clip(0, 255).astype(np.uint8), depth.reshape(shape), (seen & (face < own)).reshape(shape)


def disturbed(depth, rng):
    """Errors that neighbours share, pixels between front and back at edges, no depth at grazing angles."""
    from scipy.ndimage import gaussian_filter, uniform_filter

    blotches = gaussian_filter(rng.normal(size=depth.shape), 4) * 4 * np.sqrt(np.pi) * 2  # variance 1
    near = np.where(depth > 0, depth, 9.0)
    smooth = uniform_filter(near, 2)
    out = np.where(np.abs(smooth - near) < 0.3, smooth, near) + blotches * 0.0025 * near**2
    steep = np.hypot(*np.gradient(near)) * FOCAL / near > 8
    return np.where((depth > 0) & (near < 6) & ~(steep & (rng.random(depth.shape) < 0.5)), out, 0.0)


def drifting(rng):
    """Smooth errors of a scan's cameras: up to 0.6 deg and 6 mm from its beginning to its end."""
    turn, shift = rng.normal(size=3), rng.normal(size=3)
    for i in range(VIEWS):
        bend = np.sin(np.pi * i / VIEWS + turn[0])
        pose = np.eye(4)
        pose[:3, :3] = Rotation.from_rotvec(np.radians(0.6) * bend * turn / np.linalg.norm(turn)).as_matrix()
        pose[:3, 3] = 0.006 * bend * shift / np.linalg.norm(shift)
        yield pose


def recorded(folder, out, options):
    """Writes scans and the common recording; returns what is true."""
    from embreex import rtcore_scene
    from embreex.mesh_construction import TriangleMesh
    from PIL import Image

    rng = np.random.default_rng([options.seed, sum(map(ord, folder.name))])
    thing = Thing(folder, rng)
    top = dict(camera_model="PINHOLE", w=WIDTH, h=HEIGHT, fl_x=FOCAL, fl_y=FOCAL, cx=WIDTH / 2, cy=HEIGHT / 2, metric=True, up=[0, 0, 1])
    truth = {"worlds": [], "cameras": [], "values": thing.values.tolist(), "joints": [[j.type, thing.axis(j).tolist()] for j in thing.joints]}
    common = {**top, "frames": []}
    for state in range(STATES):
        push = np.eye(4)
        if options.push and state == 3:
            turn = rng.uniform(-np.pi, np.pi)
            push = moved([options.push / 1000 * np.cos(turn), options.push / 1000 * np.sin(turn), 0], np.radians(2))
        geometry = thing.in_room(state, push)
        scene = rtcore_scene.EmbreeScene(robust=True)
        TriangleMesh(scene, geometry[0].astype(np.float32), geometry[1].astype(np.int32))
        world = moved(rng.uniform(-2, 2, 3), rng.uniform(-np.pi, np.pi)) if state else np.eye(4)
        scan, drift = {**top, "frames": []}, drifting(rng)
        for view, camera in enumerate(thing.cameras(rng)):
            rgb, depth, mask = picture(scene, geometry, camera)
            wrong = next(drift)
            if options.noise:
                depth, told = disturbed(depth, rng), wrong @ camera
            else:
                told = camera
            name = f"{state}_{view:02}.png"
            for kind, image in (("rgb", rgb), ("depth", np.round(depth / UNIT).clip(0, 65535).astype(np.uint16)), ("mask", mask.astype(np.uint8) * 255)):
                file = out / "common" / kind / name
                file.parent.mkdir(parents=True, exist_ok=True)
                Image.fromarray(image).save(file)
                if kind != "mask":
                    own = out / f"scan_{state}" / kind / name
                    own.parent.mkdir(parents=True, exist_ok=True)
                    own.hardlink_to(file)
            files = {"file_path": f"rgb/{name}", "depth_file_path": f"depth/{name}", "depth_unit_scale_factor": UNIT}
            common["frames"].append({**files, "mask_path": f"mask/{name}", "state": state, "transform_matrix": told.tolist()})
            scan["frames"].append({**files, "transform_matrix": (world @ told).tolist()})
            truth["cameras"].append(camera.tolist())
        save(out / f"scan_{state}" / "transforms.json", scan)
    save(out / "common" / "transforms.json", common)
    save(out / "true.json", truth)
    return truth


def save(path, value):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(value))


def states_of(recording):
    frames = json.loads((recording / "transforms.json").read_text())["frames"]
    return [(f["state"], np.array(f["transform_matrix"])) for f in frames]


def worlds_off(recording, truth):
    """Largest turn (deg) and shift (mm, at the object) between states' mean frames and state 0's."""
    mean = []
    told = states_of(recording)
    for state in range(STATES):
        pairs = [(pose, np.array(true)) for (s, pose), true in zip(told, truth["cameras"]) if s == state]
        turn = Rotation.from_matrix([p[:3, :3] @ t[:3, :3].T for p, t in pairs]).mean()
        here = np.array([0, 0, DIAGONAL / 4])
        mean.append((turn, np.mean([p[:3, 3] + p[:3, :3] @ t[:3, :3].T @ (here - t[:3, 3]) for p, t in pairs], 0)))
    turns = [np.degrees((a.inv() * mean[0][0]).magnitude()) for a, _ in mean]
    return max(turns), max(1000 * np.linalg.norm(b - mean[0][1]) for _, b in mean)


def judged(run, recording, truth):
    """(found joints, whether all types fit, errors of the axes in degrees)."""
    file = run / "parts" / "parts.json"
    if not file.exists():
        return 0, False, []
    parts = json.loads(file.read_text())
    turns = []
    for i, (state, _) in enumerate(states_of(recording)):
        if state == 0 and str(i) in parts["cameras"]:
            true = np.array(truth["cameras"][i])[:3, :3] @ np.diag([1, -1, -1.0])  # OpenGL to OpenCV
            turns.append((Rotation.from_quat(parts["cameras"][str(i)]["rot"]).inv() * Rotation.from_matrix(true).inv()).as_quat())
    frame = Rotation.from_quat(turns).mean()
    found, true = parts["tree"]["joints"], truth["joints"]
    best = (1e9, False, [])
    for order in itertools.permutations(range(len(found)), min(len(found), len(true))):
        errors, same = [], len(found) == len(true)
        for k, (kind, axis) in zip(order, true):
            same &= found[k]["screw"]["kind"][:4].lower() == {"prismatic": "pris"}.get(kind, "revo")
            a, b = np.array(found[k]["screw"]["axis"]), frame.apply(axis)
            errors.append(float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), abs(a @ b)))))
        best = min(best, (sum(errors) + 1e3 * (not same), same, errors))
    return len(found), best[1], best[2]


def ran(binary, *arguments):
    return subprocess.run([binary, *map(str, arguments)], capture_output=True, text=True)


def main():
    parse = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parse.add_argument("binary")
    parse.add_argument("work", type=pathlib.Path)
    parse.add_argument("objects", type=pathlib.Path, nargs="+")
    parse.add_argument("--noise", action="store_true", help="errors of depth and drifting cameras [default: exact]")
    parse.add_argument("--seed", type=int, default=0, help="[default: 0]")
    parse.add_argument("--push", type=float, default=0.0, help="mm, in state 3 [default: 0]")
    options = parse.parse_args()
    in_own_python(options.work)
    global np, Rotation
    import numpy as np
    from scipy.spatial.transform import Rotation

    print("| object | worlds deg, mm | parts | axes deg | common world and masks: parts | axes deg | worst ratio |\n|---|---|---|---|---|---|---|")
    for folder in options.objects:
        kind = f"{folder.name}_{options.seed}" + "_noise" * options.noise + (f"_push{options.push:g}" if options.push else "")
        out = options.work / kind
        truth = json.loads((out / "true.json").read_text()) if (out / "true.json").exists() else recorded(folder, out, options)
        scans = [out / f"scan_{k}" for k in range(STATES)]
        told = ran(options.binary, "import", *scans, "-o", out / "rec")
        rows, error = [], told.stderr if told.returncode else ""
        for recording, run in ((out / "rec", out / "run"), (out / "common", out / "run_common")):
            if recording.exists():
                built = ran(options.binary, "build", recording, "-o", run, "--preset", "fast", "--to", "parts", "--threads", 1)
                error += built.stderr if built.returncode else ""
            rows.append(judged(run, recording, truth))
        worlds = "%.3f, %.2f" % worlds_off(out / "rec", truth) if (out / "rec").exists() else "refused"
        n = len(truth["joints"]) + 1
        cell = lambda r: f"{r[0] + 1} of {n}{'' if r[1] else ' **wrong**'} | {', '.join('%.3f' % e for e in r[2])}"
        ratio = max((a / max(b, 1e-9) for a, b in zip(rows[0][2], rows[1][2])), default=float("nan"))
        print(f"| {folder.name} | {worlds} | {cell(rows[0])} | {cell(rows[1])} | {ratio:.2f} |", flush=True)
        if error:
            print("  ".join(line for line in error.splitlines() if "rror" in line or "what" in line.lower())[:400], file=sys.stderr)


if __name__ == "__main__":
    main()
