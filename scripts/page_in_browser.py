#!/usr/bin/env python3
"""Opens the page of `hingecast view` in headless Chromium and takes hold of it.

    scripts/page_in_browser.py RUN/report/view.html [--chromium PATH]

Moves every joint to five values and compares where points of every part are drawn with where twin.json and the
page's camera put them; then drags every part that moves, from a pixel that shows it, and sees whether its joint
follows the pointer. Prints both; exit 1 beyond a pixel, or where a joint does not follow. Not in CI: it needs a
browser.
"""
import argparse
import json
import math
import pathlib
import re
import subprocess
import sys
import tempfile

FLAGS = (
    "--headless --no-sandbox --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader --disable-quic "
    "--no-first-run --disable-background-networking --disable-sync --window-size=1200,800 --virtual-time-budget=20000"
)
# Runs in the page: asks for pixels, drags, and leaves what it saw as the title.
ASKING = """<script>
const ask = () => {
  if (!window.hingecast) return setTimeout(ask, 50);
  const { configurations, points, movers } = ASKED, h = window.hingecast, seen = { pixels: [], drags: [] };
  const canvas = document.querySelector("canvas"), box = canvas.getBoundingClientRect();
  seen.camera = [...h.camera]; seen.size = [box.width, box.height];
  for (const q of configurations) {
    q.forEach((x, k) => h.set(k, x));
    seen.pixels.push(points.map(([part, p]) => h.pixel(part, p)));
  }
  const fire = (type, [x, y]) => canvas.dispatchEvent(new PointerEvent(type, { bubbles: true, clientX: box.left + x,
    clientY: box.top + y, pointerId: 5, button: 0, buttons: 1, isPrimary: true }));
  for (const { joint, grid, to } of movers) {
    h.values.forEach((_, k) => h.set(k, 0));
    let best = null;
    for (const [part, p] of grid) {
      // Held where a press takes this joint: what is before it takes another, or none.
      const at = h.pixel(part, p);
      h.set(joint, to); const there = h.pixel(part, p); h.set(joint, 0);
      fire("pointerdown", at);
      for (let k = 1; k <= 12; k++) fire("pointermove", [at[0] + (there[0] - at[0]) * k / 12, at[1] + (there[1] - at[1]) * k / 12]);
      fire("pointerup", there);
      const got = h.values[joint];
      if (best === null || Math.abs(got - to) < Math.abs(best - to)) best = got;
      h.values.forEach((_, k) => h.set(k, 0));
    }
    seen.drags.push(best);
  }
  document.title = "seen" + JSON.stringify(seen);
};
ask();
</script></body>"""


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("page", type=pathlib.Path)
    parser.add_argument("--chromium", default="chromium")
    args = parser.parse_args()
    html = args.page.read_text()
    twin = json.loads(re.search(r'id="twin">(.*?)</script>', html, re.S)[1])
    joints = twin["tree"]["joints"]
    free = [k for k, j in enumerate(joints) if j["screw"]["kind"] != "fixed"]
    followers = {c["follower"] for c in twin["tree"].get("couplings", [])}
    share = lambda j, s: j["limits"][0] + s * (j["limits"][1] - j["limits"][0])
    configurations = [[share(j, (0.0, 0.25, 0.5, 0.8, 1.0)[(k + c) % 5]) for k, j in enumerate(joints)] for c in range(5)]
    spots = [[part, vertex(twin, part, at)] for part in range(len(twin["parts"])) for at in range(6)]
    movers = []
    for k in free:
        if k not in followers:
            grid = [[joints[k]["child"], vertex(twin, joints[k]["child"], at)] for at in range(12)]
            far = max(joints[k]["limits"], key=abs)
            movers.append({"joint": k, "grid": grid, "to": 0.4 * far})
    asked = json.dumps({"configurations": configurations, "points": spots, "movers": movers}).replace("</", "<\\/")
    with tempfile.TemporaryDirectory() as folder:
        copy = pathlib.Path(folder) / "page.html"
        copy.write_text(html.replace("</body>", ASKING.replace("ASKED", asked)))
        command = [args.chromium, *FLAGS.split(), f"--user-data-dir={folder}/user", "--dump-dom", copy.as_uri()]
        dom = subprocess.run(command, capture_output=True, text=True, timeout=180).stdout
    found = re.search(r"<title>seen(.*?)</title>", dom)
    if not found:
        sys.exit("the page did not start: " + (re.search(r'id="trouble".*?</p>', dom) or [dom[:300]])[0])
    seen = json.loads(found[1])
    worst = 0.0
    for q, pixels in zip(configurations, seen["pixels"]):
        poses = placed(twin, q)
        for (part, point), pixel in zip(spots, pixels):
            should = projected(seen["camera"], seen["size"], poses[part], point)
            worst = max(worst, math.dist(should, pixel))
    print(f"{len(spots)} points at {len(configurations)} configurations: at most {worst:.4f} pixels off")
    fine = worst <= 1.0
    for mover, got in zip(movers, seen["drags"]):
        near = abs(got - mover["to"]) <= 0.1 * abs(mover["to"])
        fine &= near
        print(f"{joints[mover['joint']]['name']}: dragged towards {mover['to']:.4f}, came to {got:.4f}{'' if near else '  WRONG'}")
    return 0 if fine else 1


def vertex(twin, part, at):
    """A corner of a part's collision pieces, its link's frame."""
    lines = [line.split()[1:4] for text in twin["collision"][part] for line in text.splitlines() if line.startswith("v ")]
    return [float(x) for x in lines[(at * 7919) % len(lines)]] if lines else [0.0, 0.0, 0.0]


def placed(twin, q):
    """Of each part: rotation (rows) and place of its link in the canonical world."""
    tree = twin["tree"]
    q = list(q)
    for c in tree.get("couplings", []):
        q[c["follower"]] = sum(a * q[c["leader"]] ** n for n, a in enumerate(c["polynomial"]))
    one = [[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]]
    motions = {part: (one, [0.0] * 3) for part in range(len(twin["parts"]))}
    for part in motions:
        chain, at = [], part
        while (k := next((k for k, j in enumerate(tree["joints"]) if j["child"] == at), None)) is not None:
            chain.append(k)
            at = tree["joints"][k]["parent"]
        for k in chain:
            motions[part] = after(motion(tree["joints"][k]["screw"], q[k]), motions[part])
    out = []
    for part, (turn, shift) in motions.items():
        origin = twin["parts"][part]["link_origin"]
        out.append((turn, [sum(turn[r][c] * origin[c] for c in range(3)) + shift[r] for r in range(3)]))
    return out


def motion(screw, value):
    a = screw["axis"]
    if screw["kind"] == "prismatic":
        return [[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]], [value * x for x in a]
    c, s = math.cos(value), math.sin(value)
    cross = [[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]]
    turn = [[c * (i == j) + s * cross[i][j] + (1 - c) * a[i] * a[j] for j in range(3)] for i in range(3)]
    p = screw["pivot"]
    return turn, [p[i] - sum(turn[i][j] * p[j] for j in range(3)) for i in range(3)]


def after(one, other):
    """First the other motion, then the one."""
    (a, s), (b, t) = one, other
    turn = [[sum(a[i][k] * b[k][j] for k in range(3)) for j in range(3)] for i in range(3)]
    return turn, [sum(a[i][k] * t[k] for k in range(3)) + s[i] for i in range(3)]


def projected(camera, size, pose, point):
    turn, at = pose
    x = [sum(turn[i][j] * point[j] for j in range(3)) + at[i] for i in range(3)] + [1.0]
    clip = [sum(camera[4 * j + i] * x[j] for j in range(4)) for i in range(4)]
    return [(clip[0] / clip[3] + 1) / 2 * size[0], (1 - clip[1] / clip[3]) / 2 * size[1]]


if __name__ == "__main__":
    sys.exit(main())
