"""What every kind of torture needs: how commands are run, what is right, copies, tables of counts."""

import argparse
import concurrent.futures
import hashlib
import json
import os
import random
import re
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
import zlib
from collections import Counter, defaultdict
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent.parent
AT_ONCE = 2
# Longest that one command may take, seconds, and its address space, KiB.
HANG = 60
MEMORY_KIB = 4 * 1024 * 1024
SMALL = "--states 3 --views 6 --size 48 --test-views 1".split()
LEAST = "--states 2 --views 2 --size 16 --test-views 1".split()
# The cheapest build that still has all stages; one takes 3 to 8 seconds.
BUILD = ["--preset", "fast"] + [
    word
    for setting in (
        "fit.steps=30 fit.gaussians=600 screw.cells=24 screw.max_parts=2 track.steps=20 twin.voxel=0.03 "
        "twin.max_hulls=4 twin.max_faces=1000 twin.color_views=4"
    ).split()
    for word in ("--set", setting)
]
TRACK = ["--method", "track"]
LEFTOVER = re.compile(r"^\..+\.hingecast-\d+-[0-9a-f]{16}$")
NUMBER = re.compile(rb"-?\b\d+(?:\.\d+)?(?:[eE][-+]?\d+)?\b")
# System calls that change what is on the disk.
CHANGES = "rename,renameat,renameat2,unlink,unlinkat,rmdir,mkdir,mkdirat,fsync,fdatasync,write,pwrite64,ftruncate"


class Said:
    """How a command ended."""

    def __init__(self, argv, code, out, err, hung, secs):
        self.argv, self.code, self.out, self.err, self.hung, self.secs = argv, code, out, err, hung, secs

    def verdict(self):
        """`done`, `refused`, or what is wrong with it."""
        err = self.err.decode("utf-8", "replace")
        if self.hung:
            return "hang"
        if "memory allocation of" in err or "capacity overflow" in err:
            return "memory"
        if self.code == 101 or "panicked" in err:
            return "panic"
        if self.code < 0 or self.code >= 128:
            return f"signal {-self.code if self.code < 0 else self.code - 128}"
        if self.code == 0:
            return "done"
        # A bar that was missed, or a recording or file that did not pass: no error.
        if self.code == 1 and "error:" not in err:
            return "refused"
        lines = err.splitlines()
        shape = ["error: ", "  where: ", "  try: "]
        if self.code != 2 or len(lines) != 3 or not all(a.startswith(b) for a, b in zip(lines, shape)):
            return "not three lines"
        return "refused"


class Torture:
    def __init__(self, binary, work, seed, seconds):
        self.binary, self.work, self.seed = Path(binary).resolve(), Path(work).resolve(), seed
        self.until = time.monotonic() + seconds if seconds else None
        self.env = dict(os.environ)
        self.env.setdefault("HINGECAST_OBJECTS", str(REPOSITORY / "objects"))
        libraries = [str(REPOSITORY / "third_party/mujoco/lib"), self.env.get("LD_LIBRARY_PATH", "")]
        self.env["LD_LIBRARY_PATH"] = ":".join(filter(None, libraries))
        self.counts, self.kept, self.lock = defaultdict(Counter), {}, threading.Lock()
        self.started = time.monotonic()

    def random(self, *names):
        return random.Random("/".join(map(str, (self.seed, *names))))

    def command(self, words, threads):
        return [str(self.binary), *map(str, words), "-q", "--threads", str(threads)]

    def start(self, at, words, before=(), threads=1):
        limits = f'ulimit -c 0; ulimit -v {MEMORY_KIB}; exec "$@"'
        argv = ["sh", "-c", limits, "sh", *before, *self.command(words, threads)]
        pipe = subprocess.PIPE
        null = subprocess.DEVNULL
        return subprocess.Popen(
            argv, cwd=at, env=self.env, stdin=null, stdout=pipe, stderr=pipe, start_new_session=True
        )

    def end(self, process, words, kill_after=HANG, hang=True):
        began = time.monotonic()
        hung = False
        try:
            out, err = process.communicate(timeout=kill_after)
        except subprocess.TimeoutExpired:
            hung = hang
            os.killpg(process.pid, signal.SIGKILL)
            out, err = process.communicate()
        return Said([str(w) for w in words], process.returncode, out, err, hung, time.monotonic() - began)

    def run(self, at, words, **how):
        return self.end(self.start(at, words, **how), words)

    def must(self, at, words, **how):
        said = self.run(at, words, **how)
        if said.verdict() != "done":
            sys.exit(f"undisturbed, this fails: {words} in {at}: {said.verdict()}\n{said.err.decode()}")
        return said

    def count(self, kind, verdict, folder, said, note=""):
        """`verdict`: right ..., or what is wrong, and then the folder stays."""
        with self.lock:
            self.counts[kind][verdict] += 1
            if verdict.startswith("right"):
                return
            first = (kind, verdict) not in self.kept
            if first:
                place = self.work / "wrong" / re.sub(r"\W+", "_", f"{kind} {verdict}")
                self.kept[kind, verdict] = place
            with open(self.work / "wrong.txt", "a") as log:
                print(kind, "|", verdict, "|", note, "|", " ".join(said.argv), "|", said.code, "|",
                      said.err.decode("utf-8", "replace")[-400:].replace("\n", " / "), file=log)
        if first:
            shutil.rmtree(place, ignore_errors=True)
            shutil.copytree(folder, place, symlinks=True)
            text = f"{note}\n{' '.join(said.argv)}\nexit {said.code}\n\n"
            (place / "torture.txt").write_text(text + said.err.decode("utf-8", "replace"))

    def over(self):
        return self.until is not None and time.monotonic() > self.until

    def spread(self, jobs):
        """Runs the jobs, two at a time; stops to begin new ones when the time is over."""
        def one(job):
            if not self.over():
                job()
        with concurrent.futures.ThreadPoolExecutor(AT_ONCE) as pool:
            for done in concurrent.futures.as_completed([pool.submit(one, job) for job in jobs]):
                done.result()

    def folder(self):
        return Path(tempfile.mkdtemp(dir=self.work / "cases"))

    def say(self, text):
        print(f"[{time.monotonic() - self.started:5.0f} s] {text}", flush=True)


# Trees -------------------------------------------------------------------------------------------


def clone(source, target):
    """A copy whose files are links: the program replaces files and never writes into them, and so do
    we. The lock of a run is its file: two copies with one would keep each other out."""

    def link_or_copy(a, b):
        return shutil.copy2(a, b) if os.path.basename(a) == ".lock" else os.link(a, b)

    shutil.copytree(source, target, copy_function=link_or_copy, symlinks=True, dirs_exist_ok=True)


def tree(root):
    """Hash of every file; the folder's own name, where files tell it, does not count."""
    own = str(root).encode()
    out = {}
    for at, folders, files in os.walk(root):
        for name in folders:
            out[os.path.relpath(os.path.join(at, name), root)] = "folder"
        for name in files:
            path = os.path.join(at, name)
            bytes_ = Path(path).read_bytes().replace(own, b"HERE")
            out[os.path.relpath(path, root)] = hashlib.sha256(bytes_).hexdigest()
    return out


def differences(a, b, vary=()):
    return sorted(name for name in a.keys() | b.keys() if name not in vary and a.get(name) != b.get(name))


def leftovers(root):
    return [str(p.relative_to(root)) for p in root.rglob(".*") if LEFTOVER.match(p.name)]


def neighbours(at):
    """What a person may have beside the outputs."""
    for name in ("rec.tmp", ".rec.hingecast-1-notes", "run.old", "new"):
        (at / name).mkdir()
        (at / name / "thesis.tex").write_text("years")


# Base: what everything starts from ----------------------------------------------------------------


def prepare(t):
    base = t.work / "base"
    base.mkdir()
    for name, thing, seed in (("a", "hinged_box", 0), ("b", "microwave", 1)):
        at = base / name
        at.mkdir()
        t.must(at, ["synth", thing, "-o", "rec", *SMALL, "--seed", seed])
        t.must(at, ["build", "rec", "-o", "run", *BUILD])
        t.must(at, ["build", "rec", "-o", "run_track", *BUILD, *TRACK])
        t.must(at, ["eval", "run", "--truth", "rec.truth"])
    a = base / "a"
    t.must(a, ["demos", "--object", "covered_box", "-n", 2, "-o", "demos.hdf5"])
    t.must(a, ["train", "demos.hdf5", "-o", "policy", "--steps", 20])
    t.must(a, ["import-object", "run/twin/robot.urdf", "-o", "object"])
    return base
