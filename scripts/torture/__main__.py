"""What a built hingecast does when things go wrong around it: killed, out of disk, damaged files,
files of another run, two commands at once.

    python3 scripts/torture BINARY [WORK_FOLDER] [--quick | --seconds N] [--seed N] [--only KIND,...]

Needs Python's standard library alone; strace and root make it better (kills at chosen system calls;
small disks). The same seed tries the same damage; the moments of kills by the clock are as random as
the clock. Exit 1 when anything went wrong; the first example of each wrong kind stays in
WORK_FOLDER/wrong, with the command and what it said in torture.txt.
"""

from base import *
from damage import mutations
from disks import disks
from kills import kills
from swaps import at_once, swaps


def table(t):
    print(f"\n{'kind':34} {'tried':>6} {'right':>6}  of these; wrong")
    tried = wrong = 0
    for kind, counts in sorted(t.counts.items()):
        right = {k: n for k, n in counts.items() if k.startswith("right")}
        bad = {k: n for k, n in counts.items() if k not in right}
        tried, wrong = tried + sum(counts.values()), wrong + sum(bad.values())
        of = ", ".join(f"{n} {k.removeprefix('right, ')}" for k, n in sorted(right.items()) if k != "right")
        print(f"{kind:34} {sum(counts.values()):6} {sum(right.values()):6}  {of}")
        for verdict, n in sorted(bad.items()):
            print(f"{'':50}WRONG: {n} {verdict}; the first: {t.kept[kind, verdict]}")
    print(f"\n{tried} tried, {wrong} wrong, seed {t.seed}, {time.monotonic() - t.started:.0f} s")
    return wrong


def main():
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("binary")
    ask.add_argument("work", nargs="?", help="folder for all that is made; new or empty [default: a temporary one]")
    ask.add_argument("--quick", action="store_true", help="a tenth of everything, some two minutes")
    ask.add_argument("--seconds", type=float, help="begin nothing new after so many seconds")
    ask.add_argument("--seed", type=int, default=0)
    ask.add_argument("--only", default="kills,disks,damage,swaps,once", help="which kinds")
    ask.add_argument("--damages", type=int, default=1200, help="how many damaged files")
    asked = ask.parse_args()
    if asked.work and Path(asked.work).exists() and any(Path(asked.work).iterdir()):
        sys.exit(f"{asked.work} is not empty")
    work = Path(asked.work or tempfile.mkdtemp(prefix="torture-"))
    for name in ("cases", "wrong"):
        (work / name).mkdir(parents=True, exist_ok=True)
    t = Torture(asked.binary, work, asked.seed, asked.seconds)
    share = 0.1 if asked.quick else 1.0
    t.say(f"everything is in {t.work}")
    base = prepare(t)
    before = tree(base)
    steps = {
        "damage": lambda: mutations(t, base, round(asked.damages * share)),
        "swaps": lambda: swaps(t, base, share),
        "once": lambda: at_once(t, base, share),
        "disks": lambda: disks(t, base, max(8, round(24 * share))),
        "kills": lambda: kills(t, base, share),
    }
    for name, step in steps.items():
        if name in asked.only.split(",") and not t.over():
            t.say(name)
            step()
    # A command may change nothing but its outputs.
    if differences(before, tree(base)):
        print("inputs were changed in place:", differences(before, tree(base)))
        t.counts["inputs"]["changed in place"] += 1
        t.kept["inputs", "changed in place"] = base
    wrong = table(t)
    shutil.rmtree(t.work / "cases", ignore_errors=True)
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
