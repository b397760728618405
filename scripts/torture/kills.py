"""Commands killed at random moments and at chosen system calls, then run again undisturbed."""

from base import *


def kill_verbs(base):
    """Name, what is there before, command, share of the kills."""
    a, b = base / "a", base / "b"
    tiny = "-d 1 -e 1 --train-seeds 1 --policy bc --policy-set steps=5 --world twin".split()
    return [
        ("synth over a recording", {"rec": b / "rec", "rec.truth": b / "rec.truth"},
         ["synth", "hinged_box", "-o", "rec", *SMALL], 8),
        ("import", {"src": a / "rec", "rec": b / "rec"}, ["import", "src", "-o", "rec"], 8),
        ("import-object", {"obj": a / "run/twin"}, ["import-object", "obj/robot.urdf", "-o", "box"], 6),
        ("check --fix", {"rec": a / "rec"}, ["check", "rec", "--fix"], 4),
        ("build screw", {"rec": a / "rec"}, ["build", "rec", "-o", "run", *BUILD], 6),
        ("build track", {"rec": a / "rec"}, ["build", "rec", "-o", "run", *BUILD, *TRACK], 6),
        ("build over another", {"rec": a / "rec", "run": b / "run"}, ["build", "rec", "-o", "run", *BUILD], 4),
        ("build --from twin", {"rec": a / "rec", "first": a / "run"},
         ["build", "rec", "-o", "run", *BUILD, "--from", "twin"], 6),
        ("report", {"rec": a / "rec", "run": a / "run"}, ["report", "run"], 6),
        ("demos", {}, ["demos", "--object", "covered_box", "-n", 2, "-o", "demos.hdf5"], 6),
        ("train", {"demos.hdf5": a / "demos.hdf5"}, ["train", "demos.hdf5", "-o", "policy", "--steps", 60], 6),
        ("rollout", {"policy": a / "policy"},
         ["rollout", "policy", "--object", "covered_box", "-n", 2, "-o", "out"], 4),
        ("bench", {}, ["bench", "hinged_box", "-o", "bench", *SMALL, *BUILD], 2),
        ("experiment", {}, ["experiment", "hinged_box", "-o", "exp", *tiny, *SMALL, *BUILD], 2),
    ]


def lay_out(at, before):
    for name, source in before.items():
        if source.is_dir():
            clone(source, at / name)
        else:
            os.link(source, at / name)
    neighbours(at)


def reference(t, before, words, prior=None):
    """Two undisturbed runs: the tree, the files that vary between them, the seconds."""
    trees, secs = [], []
    for _ in range(2):
        at = t.folder()
        lay_out(at, before)
        if prior:
            t.must(at, prior)
        secs.append(t.must(at, words, threads=2).secs)
        trees.append(tree(at))
        if leftovers(at):
            sys.exit(f"undisturbed, {words} leaves {leftovers(at)}")
        shutil.rmtree(at)
    vary = set(differences(*trees))
    return trees[0], vary, min(secs)


def traced(t, before, words, prior):
    """How often each changing system call comes, at most, in one thread."""
    at = t.folder()
    lay_out(at, before)
    if prior:
        t.must(at, prior)
    log = t.work / f"strace.{at.name}"
    t.run(at, words, before=["strace", "-f", "-qq", "-e", f"trace={CHANGES}", "-o", str(log)], threads=2)
    calls = Counter(tuple(re.match(r"(\d+) +(\w+)\(", line).groups()) for line in log.read_text("utf-8", "replace").splitlines() if re.match(r"\d+ +\w+\(", line))
    shutil.rmtree(at)
    log.unlink()
    most = Counter()
    for (_, call), n in calls.items():
        most[call] = max(most[call], n)
    return most


def kills(t, base, scale):
    strace = shutil.which("strace") is not None
    if not strace:
        t.say("no strace: kills by the clock only")
    varied = {}

    def verb(name, before, words, n):
        kind = f"kill: {name}"
        # A build of its own in this folder comes before what redoes its last stage.
        prior = [w for w in words if w not in ("--from", "twin")] if name == "build --from twin" else None
        whole, vary, secs = reference(t, before, words, prior)
        # What holds times differs now and then, not every time.
        varied[name] = vary
        calls = traced(t, before, words, prior) if strace else Counter()
        for i in range(max(1, round(n * scale))):
            if t.over():
                return
            draw = t.random(kind, i)
            at = t.folder()
            lay_out(at, before)
            if prior:
                t.must(at, prior)
            if calls and i % 2:
                call = draw.choice(sorted(calls))
                k = draw.randint(1, calls[call])
                note = f"killed at {call} {k}"
                inject = ["strace", "-f", "-qq", "-o", "/dev/null", "-e", f"trace={call}",
                          "-e", f"inject={call}:signal=SIGKILL:when={k}"]
                first = t.run(at, words, before=inject, threads=2)
            else:
                after = draw.uniform(0.0, 1.0) * secs
                note = f"killed after {after:.3f} s"
                first = t.end(t.start(at, words, threads=2), words, kill_after=after, hang=False)
            lost = [p for p in ("rec.tmp", ".rec.hingecast-1-notes", "run.old", "new") if not (at / p / "thesis.tex").is_file()]
            again = t.run(at, words, threads=2)
            verdict = again.verdict()
            if lost:
                verdict = "neighbour lost"
            elif verdict == "done":
                left, other = leftovers(at), differences(whole, tree(at), vary)
                other = [name for name in other if not any(name.startswith(l) for l in left)]
                if left:
                    verdict, note = "leftovers", f"{note}; left {left[:3]}"
                elif other:
                    verdict, note = "other bytes", f"{note}; {len(other)} differ: {other[:4]}"
                else:
                    verdict = "right" if first.code else "right, was done"
            elif verdict == "refused":
                verdict = "not resumed"
            t.count(kind, verdict, at, again, note)
            shutil.rmtree(at)

    verbs = kill_verbs(base)
    if scale < 1:
        verbs = t.random("verbs").sample(verbs, 5)
    t.spread([lambda v=v: verb(*v) for v in verbs])
    for name, vary in varied.items():
        t.say(f"differs between two undisturbed runs of {name}: {', '.join(sorted(vary)) or 'nothing'}")
