"""Damaged inputs and run files."""

from base import *


ODD_NUMBERS = [
    b"0", b"-0.0", b"-1", b"1", b"0.5", b"3.7", b"1e308", b"-1e308", b"1e39", b"1e-320", b"NaN", b"nan", b"Infinity",
    b"inf", b"-inf", b"255", b"256", b"65536", b"2147483648", b"4294967295", b"4294967296", b"9223372036854775808",
    b"18446744073709551615", b"99999999999999999999", b"1e400", b"null", b"true", b"[]", b"{}", b'""', b"", b"1 2",
]
ODD_WORDS = [0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0x7FC00000, 0x7F800000,
             0x7FF8000000000000, 0x7FF0000000000000, 0x7FFFFFFFFFFFFFFF, 0xFFFFFFFFFFFFFFFF]


def damaged_bytes(draw, data, others):
    at = draw.randrange(len(data) + 1)
    length = min(draw.choice([1, 2, 4, 8, 64, 1024]), len(data) - at)
    how = draw.randrange(9)
    if how == 0 and data:
        at = draw.randrange(len(data))
        return data[:at] + bytes([data[at] ^ 1 << draw.randrange(8)]) + data[at + 1:]
    if how == 1:
        return data[:at] + draw.randbytes(length) + data[at + length:]
    if how == 2:
        return data[:at] + data[at + length:]
    if how == 3:
        return data[:at] + data[at:at + length] * draw.choice([2, 3, 100]) + data[at + length:]
    if how == 4:
        return data[:at]
    if how == 5 and others:
        other = draw.choice(others).read_bytes()
        cut = draw.randrange(len(other) + 1)
        return data[:at] + other[cut:]
    if how == 6:
        return draw.choice([b"", b"\0" * 100, b"\xff\xfe", data * 2, b"[" * 100_000, b"{}", b"<a/>", b"\n"])
    width = draw.choice([1, 2, 4, 8])
    at = draw.randrange(max(1, len(data) // width)) * width
    # The first bytes of a file of numbers say how many there are.
    at = draw.choice([at, at % 512 // width * width])
    word = draw.choice(ODD_WORDS) & ((1 << 8 * width) - 1)
    return data[:at] + word.to_bytes(width, draw.choice(["little", "big"])) + data[at + width:]


def damaged_number(draw, data):
    found = list(NUMBER.finditer(data[:2_000_000]))
    if not found:
        return None
    for _ in range(draw.choice([1, 1, 1, 3])):
        m = draw.choice(found)
        old = m.group()
        new = draw.choice([*ODD_NUMBERS, b"-" + old, old + b"0", old + b"00000", old + b"e9", old + b"e-9", old + b"1"])
        data = data[:m.start()] + new + data[m.end():]
        found = [f for f in found if f.end() <= m.start()]
        if not found:
            break
    return data


def damaged_json(draw, data):
    """A field that is missing, twice, of another type, or exchanged with another."""
    try:
        root = json.loads(data)
    except ValueError:
        return None
    spots = []

    def walk(value):
        if isinstance(value, (dict, list)) and value:
            for key in (value if isinstance(value, dict) else range(len(value))):
                spots.append((value, key))
                walk(value[key])
    walk(root)
    if not spots:
        return None
    # Short paths first: a list of a thousand numbers has a thousand spots and one length.
    within, key = draw.choice(spots if draw.random() < 0.5 else spots[:200])
    how = draw.randrange(6)
    if how == 0:
        del within[key]
    elif how == 1 and isinstance(within, list):
        within.extend(within[key:key + 1] * draw.choice([1, 5, 1000]))
    elif how == 2:
        within[key] = draw.choice([None, True, -1, 0, 1e300, 2**63, "x", "", "../../..", "a\nb", "/", [], {}, [[]], "\0", "é" * 300])
    elif how == 3:
        other, at = draw.choice(spots)
        within[key] = json.loads(json.dumps(other[at])) if at in (other if isinstance(other, dict) else range(len(other))) else None
    elif how == 4 and isinstance(within[key], (list, str)):
        within[key] = within[key][:len(within[key]) // 2]
    elif how == 5 and isinstance(within[key], (int, float)) and not isinstance(within[key], bool):
        within[key] = draw.choice([-within[key], within[key] * 1e6, within[key] + 1, within[key] - 1, within[key] / 1e6])
    else:
        within[key] = None
    return json.dumps(root).encode()


def damaged_xml(draw, data):
    """An element or an attribute that is missing, twice or somebody else's."""
    pieces = re.findall(rb"<[^>]+>|[^<]+", data)
    tags = [i for i, p in enumerate(pieces) if p.startswith(b"<") and len(p) > 3]
    if not tags:
        return None
    i, j = draw.choice(tags), draw.choice(tags)
    how = draw.randrange(4)
    if how == 0:
        del pieces[i]
    elif how == 1:
        pieces[i] *= draw.choice([2, 200])
    elif how == 2:
        pieces[i], pieces[j] = pieces[j], pieces[i]
    else:
        values = list(re.finditer(rb'"[^"]*"', data))
        if not values:
            return None
        m, other = draw.choice(values), draw.choice(values)
        new = draw.choice([other.group(), b'""', b'"x"', b'"../../.."', b'"0 0 0"', b'"1e30 1 1"', b'"nan nan nan"', b'"-1"'])
        return data[:m.start()] + new + data[m.end():]
    return b"".join(pieces)


def damaged_png(draw, data):
    """Behind the checksums: sizes, kinds and pixels."""
    chunks, at = [], 8
    while at + 8 <= len(data):
        size, name = struct.unpack(">I4s", data[at:at + 8])
        chunks.append([name, data[at + 8:at + 8 + size]])
        at += 12 + size
    head = bytearray(chunks[0][1])
    pixels = zlib.decompress(b"".join(body for name, body in chunks if name == b"IDAT"))
    how = draw.randrange(4)
    if how == 0:
        place = draw.choice([0, 4])
        size = draw.choice([0, 1, 2, 47, 49, 64, 65535, 100_000, 2**31 - 1, 2**32 - 1])
        head[place:place + 4] = struct.pack(">I", size)
    elif how == 1:
        head[8:13] = bytes([draw.choice([1, 2, 4, 8, 16]), draw.choice([0, 2, 3, 4, 6]), 0, 0, draw.choice([0, 1])])
    elif how == 2:
        pixels = damaged_bytes(draw, pixels, [])
    else:
        # A picture that is right, and of another size or without anything in it.
        width, height = draw.choice([(1, 1), (48, 47), (7, 48), (300, 300), (48, 48)])
        depth, channels = head[8], {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}[head[9]]
        row = b"\0" + bytes([draw.choice([0, 0, 255, 7])]) * ((width * channels * depth + 7) // 8)
        head[0:8], pixels = struct.pack(">II", width, height), row * height
    rest = [c for c in chunks[1:] if c[0] not in (b"IDAT", b"IEND")]
    if draw.random() < 0.1:
        rest = []
    out = data[:8]
    for name, body in [(b"IHDR", bytes(head)), *rest, (b"IDAT", zlib.compress(pixels)), (b"IEND", b"")]:
        out += struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
    return out


def damaged_safetensors(draw, data):
    """The header, with a length that is right."""
    size = struct.unpack("<Q", data[:8])[0]
    head = draw.choice([damaged_json, damaged_number])(draw, data[8:8 + size])
    return None if head is None else struct.pack("<Q", len(head)) + head + data[8 + size:]


def damaged(draw, path, others):
    data = path.read_bytes()
    kind = path.suffix
    ways = [lambda: damaged_bytes(draw, data, others)]
    if kind == ".json":
        ways += [lambda: damaged_number(draw, data), lambda: damaged_json(draw, data), lambda: damaged_json(draw, data)]
    elif kind in (".toml", ".obj"):
        ways += [lambda: damaged_number(draw, data)] * 2
    elif kind in (".urdf", ".xml"):
        ways += [lambda: damaged_number(draw, data), lambda: damaged_xml(draw, data)]
    elif kind == ".png":
        ways += [lambda: damaged_png(draw, data)] * 2
    elif kind == ".ply":
        head = data.find(b"end_header")
        ways += [lambda: (damaged_number(draw, data[:head]) or data[:head]) + data[head:]]
    elif kind == ".safetensors":
        ways += [lambda: damaged_safetensors(draw, data)]
    out = draw.choice(ways)()
    return damaged_bytes(draw, data, others) if out is None else out


def damage_kinds(base):
    """Kind, what is there, the files to damage, commands that read them, share of the cases.
    `bytes` after a kind: its numbers ask for long work, so a hang is not wrong."""
    a = base / "a"
    rec = {"rec": a / "rec", "rec.truth": a / "rec.truth"}
    run = {**rec, "run": a / "run", "policy": a / "policy"}
    track = {**rec, "run": a / "run_track"}
    twin = ["build", "rec", "-o", "run", *BUILD, "--from", "twin"]
    joints = ["build", "rec", "-o", "run", *BUILD, "--from", "joints"]
    report, evaluate = ["report", "run"], ["eval", "run", "--truth", "rec.truth"]
    rollout = ["rollout", "policy", "--twin", "run", "-n", 1]
    policy = {"policy": a / "policy", "run": a / "run"}
    roll = ["rollout", "policy", "--object", "covered_box", "-n", 1]
    more = ["train", "demos.hdf5", "-o", "policy", "--steps", 24]
    demos = {"demos.hdf5": a / "demos.hdf5"}
    parts = ["build", "rec", "-o", "new_run", *BUILD, "--to", "parts"]
    objects = Path(os.environ.get("HINGECAST_OBJECTS", REPOSITORY / "objects"))
    synth = lambda path: ["synth", path, "-o", "out", *LEAST]
    act = lambda path: ["demos", "--object", path, "-n", 1, "-o", "d.hdf5"]
    return [
        ("transforms.json", rec, ["rec/transforms.json"], [["check", "rec"]] * 6 + [parts, ["import", "rec", "-o", "out"], ["check", "rec", "--fix"]], 14),
        ("depth png", rec, ["rec/depth/*.png"], [["check", "rec"]] * 5 + [parts], 7),
        ("mask png", rec, ["rec/mask/*.png"], [["check", "rec"]] * 5 + [parts], 6),
        ("colour png", rec, ["rec/rgb/*.png"], [["check", "rec"]] * 5 + [["import", "rec", "-o", "out"]], 6),
        ("truth", run, ["rec.truth/truth.json", "rec.truth/**/*.*"], [evaluate], 5),
        ("urdf", {"twin": a / "run/twin"}, ["twin/robot.urdf"], [synth("twin/robot.urdf")] * 4 + [act("twin/robot.urdf"), ["import-object", "twin/robot.urdf", "-o", "box"]], 8),
        ("mjcf", {"twin": a / "run/twin"}, ["twin/robot.xml"], [synth("twin/robot.xml")] * 3 + [act("twin/robot.xml")], 8),
        ("mjcf of a sample", {"obj": objects / "microwave"}, ["obj/object.xml"], [synth("obj")] * 3 + [act("obj")], 6),
        ("texture", {"obj": objects / "microwave"}, ["obj/*.png"], [synth("obj")], 3),
        ("obj", {"obj": objects / "glasses"}, ["obj/*.obj"], [synth("obj")], 5),
        ("obj of a twin", {"twin": a / "run/twin"}, ["twin/meshes/visual/*.obj"], [synth("twin/robot.urdf")], 4),
        ("stl", {"twin": a / "run/twin"}, ["twin/meshes/collision/*.stl"], [synth("twin/robot.xml"), act("twin/robot.xml"), ["import-object", "twin/robot.urdf", "-o", "box"]], 6),
        ("demos", demos, ["demos.hdf5"], [["demos", "--inspect", "demos.hdf5"]] * 2 + [["train", "demos.hdf5", "-o", "p", "--steps", 3]], 9),
        ("config bytes", rec, [], [["build", "rec", "-o", "new_run", "--config", "mine.toml", "--to", "parts"]], 3),
        ("run.json", run, ["run/run.json"], [report, evaluate, rollout, twin], 5),
        ("config.toml of a run", run, ["run/config.toml"], [report, evaluate], 2),
        ("parts.json", run, ["run/parts/parts.json", "run/parts/trace.json"], [report] * 4 + [joints], 4),
        ("samples.ply", run, ["run/parts/samples.ply"], [report] * 4 + [joints], 3),
        ("joints.json", run, ["run/joints/joints.json"], [report, evaluate, report, twin], 6),
        ("splat json", run, ["run/splat/*.json"], [report, evaluate, report, evaluate, joints], 5),
        ("splat ply", run, ["run/splat/*.ply"], [evaluate, report, evaluate, joints], 5),
        ("twin.json", run, ["run/twin/twin.json", "run/twin/simulator.json"], [report, evaluate, rollout], 6),
        ("twin's files", run, ["run/twin/**/*.ply", "run/twin/*.urdf", "run/twin/*.xml"], [report, evaluate, rollout], 5),
        ("eval.json", run, ["run/eval.json"], [report], 2),
        ("track run", track, ["run/parts/*.json", "run/motion/*.ply", "run/joints/*.json", "run/splat/*"], [report, evaluate, evaluate], 5),
        ("policy", {**policy, "rec": a / "rec"}, ["policy/*.json", "policy/policy.safetensors"], [roll] * 3 + [rollout], 8),
        ("checkpoint", {**policy, **demos}, ["policy/checkpoint.safetensors", "policy/train.toml", "policy/losses.csv"], [more], 5),
    ]


def mutations(t, base, n):
    kinds = damage_kinds(base)
    total = sum(k[-1] for k in kinds)
    config = (base / "a/run/config.toml").read_bytes()

    # What is refused undamaged would test nothing.
    def sound(before, words):
        at = t.folder()
        for name, source in before.items():
            clone(source, at / name) if source.is_dir() else os.link(source, at / name)
        (at / "mine.toml").write_bytes(config)
        t.must(at, words)
        shutil.rmtree(at)

    checks = {(str(before), *map(str, words)): (before, words) for _, before, _, commands, _ in kinds for words in commands}
    t.spread([lambda c=c: sound(*c) for c in checks.values()])

    def one(kind, before, patterns, commands, i):
        draw = t.random("damage", kind, i)
        at = t.folder()
        for name, source in before.items():
            clone(source, at / name) if source.is_dir() else os.link(source, at / name)
        if patterns:
            files = sorted({p for pattern in patterns for p in at.glob(pattern) if p.is_file()})
            target = draw.choice(files)
            others = [p for p in files if p != target]
        else:
            target, others = at / "mine.toml", []
            target.write_bytes(config)
        new = damaged(draw, target, others)
        target.unlink()
        target.write_bytes(new)
        words = draw.choice(commands)
        said = t.run(at, words)
        verdict = said.verdict()
        if verdict == "hang" and kind.endswith("bytes"):
            verdict = "right, long"
        elif verdict == "done":
            verdict = "right, accepted"
        elif verdict == "refused":
            verdict = "right, refused"
        t.count(f"damage: {kind}", verdict, at, said, f"case {i}, {target.relative_to(at)}")
        shutil.rmtree(at)

    jobs = []
    for kind, before, patterns, commands, share in kinds:
        for i in range(max(1, round(n * share / total))):
            jobs.append(lambda c=(kind, before, patterns, commands, i): one(*c))
    # Whatever the time allows, all kinds have their share of it.
    t.random("order").shuffle(jobs)
    t.spread(jobs)
