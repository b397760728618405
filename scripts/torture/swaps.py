"""Files of another run, and two commands in one folder."""

from base import *
from kills import lay_out, reference


def swaps(t, base, share):
    a, b = base / "a", base / "b"
    build = ["build", "rec", "-o", "run", *BUILD]
    before = {"rec": a / "rec", "rec.truth": a / "rec.truth"}
    whole, vary, _ = reference(t, before, build)
    whole = {k: v for k, v in whole.items() if k.startswith("run/")}
    files = ["run.json", "config.toml", "parts/parts.json", "parts/samples.ply", "parts/trace.json", "parts/stamp", "splat/gaussians.ply",
             "splat/placed.json", "splat/extent.json", "splat/fit.json", "splat/stamp", "joints/joints.json", "joints/stamp", "twin/twin.json",
             "twin/robot.urdf", "twin/robot.xml", "twin/simulator.json"]
    sets = [[f] for f in files] + [["parts"], ["splat"], ["joints"], ["twin"], ["parts", "splat"], ["parts", "splat", "joints", "twin"], ["joints", "twin", "run.json"], ["parts", "splat", "joints", "twin", "run.json"]]
    if share < 1:
        sets = t.random("swaps").sample(sets, max(3, round(len(sets) * share)))

    def one(names):
        at = t.folder()
        for name, source in before.items():
            clone(source, at / name)
        t.must(at, build)
        for name in names:
            to = at / "run" / name
            shutil.rmtree(to) if to.is_dir() else to.unlink(missing_ok=True)
            source = b / "run" / name
            shutil.copytree(source, to) if source.is_dir() else shutil.copy(source, to)
        note = f"{' '.join(names)} of the other run"
        for words in (["report", "run"], ["eval", "run", "--truth", "rec.truth"]):
            said = t.run(at, words)
            verdict = {"done": "right, accepted", "refused": "right, refused"}.get(said.verdict(), said.verdict())
            t.count(f"swap: {words[0]}", verdict, at, said, note)
        (at / "run/eval.json").unlink(missing_ok=True)
        said = t.run(at, build)
        verdict = said.verdict()
        if verdict == "done":
            now = {k: v for k, v in tree(at).items() if k.startswith("run/")}
            other = differences(whole, now, vary)
            verdict = "right, built again" if not other else "other bytes"
            note += f"; {other[:4]}" if other else ""
        elif verdict == "refused":
            verdict = "right, refused"
        t.count("swap: build", verdict, at, said, note)
        shutil.rmtree(at)

    def pictures(i):
        draw = t.random("pictures", i)
        at = t.folder()
        clone(a / "rec", at / "rec")
        folder = draw.choice(["rgb", "depth", "mask", "transforms.json"])
        for name in ["transforms.json"] if folder.endswith("json") else [f"{folder}/{p.name}" for p in sorted((at / "rec" / folder).iterdir()) if draw.random() < 0.5]:
            (at / "rec" / name).unlink()
            if (b / "rec" / name).exists():
                shutil.copy(b / "rec" / name, at / "rec" / name)
        for words in (["check", "rec"], build):
            said = t.run(at, words)
            verdict = {"done": "right, accepted", "refused": "right, refused"}.get(said.verdict(), said.verdict())
            t.count(f"swap of pictures: {words[0]}", verdict, at, said, f"case {i}: {folder}")
        shutil.rmtree(at)

    t.spread([lambda s=s: one(s) for s in sets] + [lambda i=i: pictures(i) for i in range(max(2, round(8 * share)))])


def at_once(t, base, share):
    a, b = base / "a", base / "b"
    cases = [
        ("build", {"rec": a / "rec"}, ["build", "rec", "-o", "run", *BUILD]),
        ("build track", {"rec": a / "rec"}, ["build", "rec", "-o", "run", *BUILD, *TRACK]),
        ("synth", {"rec": b / "rec", "rec.truth": b / "rec.truth"}, ["synth", "hinged_box", "-o", "rec", *SMALL]),
        ("import", {"src": a / "rec"}, ["import", "src", "-o", "rec"]),
        ("train", {"demos.hdf5": a / "demos.hdf5"}, ["train", "demos.hdf5", "-o", "policy", "--steps", 60]),
        ("demos", {}, ["demos", "--object", "covered_box", "-n", 2, "-o", "demos.hdf5"]),
        ("report", {"rec": a / "rec", "run": a / "run"}, ["report", "run"]),
    ]
    for name, before, words in cases:
        whole, vary, secs = reference(t, before, words)
        for i, wait in enumerate([0.0, 0.02, 0.3, 0.6][: max(1, round(4 * share))]):
            if t.over():
                return
            at = t.folder()
            lay_out(at, before)
            one = t.start(at, words)
            time.sleep(wait * secs)
            other = t.start(at, words)
            with concurrent.futures.ThreadPoolExecutor(2) as pool:
                saids = list(pool.map(lambda p: t.end(p, words), (one, other)))
            verdicts = sorted(s.verdict() for s in saids)
            note = f"{wait} of its time later: {verdicts}"
            said = next((s for s in saids if s.verdict() not in ("done", "refused")), saids[1])
            if verdicts not in (["done", "done"], ["done", "refused"]):
                verdict = next((v for v in verdicts if v not in ("done", "refused")), "both refused")
            elif name.startswith("build") and verdicts == ["done", "done"]:
                verdict = "both were let in"
            elif leftovers(at):
                verdict = "leftovers"
            elif differences(whole, tree(at), vary):
                verdict, note = "other bytes", f"{note}; {differences(whole, tree(at), vary)[:4]}"
            else:
                verdict = f"right, {'one refused' if 'refused' in verdicts else 'both done'}"
            t.count(f"two at once: {name}", verdict, at, said, note)
            shutil.rmtree(at)
