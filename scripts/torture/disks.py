"""Disks of several sizes that fill up."""

from base import *


def disk_verbs(base):
    a = base / "a"
    return [
        ("synth", ["synth", "hinged_box", "-o", "rec", *SMALL]),
        ("import", ["import", a / "rec", "-o", "rec"]),
        ("build", ["build", a / "rec", "-o", "run", *BUILD, *TRACK]),
        ("train", ["train", a / "demos.hdf5", "-o", "policy", "--steps", 20]),
        ("demos", ["demos", "--object", "covered_box", "-n", 2, "-o", "demos.hdf5"]),
        ("import-object", ["import-object", a / "run/twin/robot.urdf", "-o", "box"]),
        ("rollout", ["rollout", a / "policy", "--object", "covered_box", "-n", 1, "-o", "out"]),
        ("build screw", ["build", a / "rec", "-o", "run", *BUILD]),
    ]


def disks(t, base, n):
    mount = os.geteuid() == 0 and shutil.which("mount") is not None
    if mount:
        probe = t.folder()
        mount = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", probe], capture_output=True).returncode == 0
        if mount:
            subprocess.run(["umount", probe], check=True)
    if not mount:
        t.say("no small disks (they need root): files are limited in size instead")
    verbs = disk_verbs(base)
    known = {}

    def sizes(name, words):
        at = t.folder()
        t.must(at, words)
        # What is there at the end, in pages.
        bytes_ = sum((p.stat().st_size + 4095) // 4096 * 4096 for p in at.rglob("*") if p.is_file())
        largest = max((p.stat().st_size for p in at.rglob("*") if p.is_file()), default=0)
        one, other = tree(at), t.folder()
        t.must(other, words)
        known[name] = bytes_, largest, one, set(differences(one, tree(other)))
        shutil.rmtree(at)
        shutil.rmtree(other)

    t.spread([lambda v=v: sizes(*v) for v in verbs])

    def one(i):
        name, words = verbs[i % len(verbs)]
        if name not in known:
            return
        bytes_, largest, whole, vary = known[name]
        draw = t.random("disk", i)
        at = t.folder()
        share = draw.uniform(0.0, 0.98)
        size = max(4096, int((bytes_ if mount else largest) * share))
        note = f"{size} bytes, {share:.2f} of what it needs"
        before = []
        if mount:
            subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", at], check=True)
        else:
            before = ["sh", "-c", f'trap "" XFSZ; ulimit -f {size // 512}; exec "$@"', "sh"]
        try:
            said = t.run(at, words, before=before)
            verdict = said.verdict()
            if verdict in ("done", "refused"):
                room = "after " + verdict
                if mount:
                    subprocess.run(["mount", "-o", "remount,size=256m", at], check=True)
                again = t.run(at, words)
                if again.verdict() != "done":
                    verdict, said = f"with room again: {again.verdict()}", again
                elif leftovers(at):
                    verdict, note = "leftovers", f"{note}; {leftovers(at)[:3]}"
                elif differences(whole, tree(at), vary):
                    verdict, note = "other bytes", f"{note}; {room}; {differences(whole, tree(at), vary)[:4]}"
                else:
                    verdict = "right, refused" if verdict == "refused" else "right, was done"
            t.count("full disk", verdict, at, said, f"{name}: {note}")
        finally:
            if mount:
                subprocess.run(["umount", at], check=True)
        shutil.rmtree(at)

    t.spread([lambda i=i: one(i) for i in range(n)])
