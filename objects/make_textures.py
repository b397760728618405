#!/usr/bin/env python3
"""Draws every PNG texture of the sample objects (needs only numpy).

    python3 make_textures.py            # writes <object>/<name>.png next to this file

Deterministic: each texture seeds its own generator. Colours are posterised so
that the files stay small. 8-bit RGB, at most 256 x 256, row 0 is the top.
"""
import os
import struct
import zlib

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))

# 5x7 capital letters and digits, drawn for this project; one string per row.
FONT_ROWS = {
    "A": ".###. #...# #...# ##### #...# #...# #...#", "B": "####. #...# #...# ####. #...# #...# ####.",
    "C": ".###. #...# #.... #.... #.... #...# .###.", "D": "####. #...# #...# #...# #...# #...# ####.",
    "E": "##### #.... #.... ####. #.... #.... #####", "F": "##### #.... #.... ####. #.... #.... #....",
    "G": ".###. #...# #.... #.### #...# #...# .###.", "H": "#...# #...# #...# ##### #...# #...# #...#",
    "I": ".###. ..#.. ..#.. ..#.. ..#.. ..#.. .###.", "J": "..### ...#. ...#. ...#. ...#. #..#. .##..",
    "K": "#...# #..#. #.#.. ##... #.#.. #..#. #...#", "L": "#.... #.... #.... #.... #.... #.... #####",
    "M": "#...# ##.## #.#.# #.#.# #...# #...# #...#", "N": "#...# ##..# #.#.# #..## #...# #...# #...#",
    "O": ".###. #...# #...# #...# #...# #...# .###.", "P": "####. #...# #...# ####. #.... #.... #....",
    "R": "####. #...# #...# ####. #.#.. #..#. #...#", "S": ".#### #.... #.... .###. ....# ....# ####.",
    "T": "##### ..#.. ..#.. ..#.. ..#.. ..#.. ..#..", "U": "#...# #...# #...# #...# #...# #...# .###.",
    "V": "#...# #...# #...# #...# #...# .#.#. ..#..", "W": "#...# #...# #...# #.#.# #.#.# ##.## #...#",
    "X": "#...# #...# .#.#. ..#.. .#.#. #...# #...#", "Y": "#...# #...# .#.#. ..#.. ..#.. ..#.. ..#..",
    "Z": "##### ....# ...#. ..#.. .#... #.... #####", " ": "..... ..... ..... ..... ..... ..... .....",
    "0": ".###. #...# #..## #.#.# ##..# #...# .###.", "1": "..#.. .##.. ..#.. ..#.. ..#.. ..#.. .###.",
    "2": ".###. #...# ....# ...#. ..#.. .#... #####", "3": "####. ....# ....# .###. ....# ....# ####.",
    "4": "...#. ..##. .#.#. #..#. ##### ...#. ...#.", "5": "##### #.... ####. ....# ....# #...# .###.",
    "6": ".###. #.... #.... ####. #...# #...# .###.", "7": "##### ....# ...#. ..#.. ..#.. .#... .#...",
    "8": ".###. #...# #...# .###. #...# #...# .###.", "9": ".###. #...# #...# .#### ....# ....# .###.",
    "-": "..... ..... ..... .###. ..... ..... .....", ":": "..... ..#.. ..... ..... ..... ..#.. .....",
    "+": "..... ..#.. ..#.. ##### ..#.. ..#.. .....", ".": "..... ..... ..... ..... ..... ..##. ..##.",
}
FONT = {k: np.array([[c == "#" for c in row] for row in v.split()]) for k, v in FONT_ROWS.items()}


# ---------------------------------------------------------------- helpers
def save(path, img):
    img = np.clip(np.rint(img), 0, 255).astype(np.uint8)
    h, w, _ = img.shape
    assert h <= 256 and w <= 256
    raw = b"".join(b"\0" + img[y].tobytes() for y in range(h))

    def chunk(tag, data):
        return struct.pack(">I", len(data)) + tag + data + struct.pack(">I", zlib.crc32(tag + data))

    png = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", w, h, 8, 2, 0, 0, 0))
    png += chunk(b"IDAT", zlib.compress(raw, 9)) + chunk(b"IEND", b"")
    full = os.path.join(HERE, path)
    os.makedirs(os.path.dirname(full), exist_ok=True)
    with open(full, "wb") as f:
        f.write(png)


def plain(w, h, rgb):
    return np.ones((h, w, 3)) * np.array(rgb, float)


def noise(rng, w, h, nx, ny):
    """Smooth value noise in 0..1 with nx x ny cells."""
    g = rng.random((ny + 1, nx + 1))
    x = np.linspace(0, nx, w, endpoint=False)
    y = np.linspace(0, ny, h, endpoint=False)
    xi, yi = x.astype(int), y.astype(int)
    fx, fy = x - xi, (y - yi)[:, None]
    fx, fy = fx * fx * (3 - 2 * fx), fy * fy * (3 - 2 * fy)
    a = g[yi][:, xi] * (1 - fx) + g[yi][:, xi + 1] * fx
    b = g[yi + 1][:, xi] * (1 - fx) + g[yi + 1][:, xi + 1] * fx
    return a * (1 - fy) + b * fy


def ramp(t, colours, levels):
    """Maps t in 0..1 through a list of colours, posterised."""
    t = np.rint(np.clip(t, 0, 1) * (levels - 1)) / (levels - 1)
    c = np.array(colours, float)
    s = t * (len(c) - 1)
    i = np.minimum(s.astype(int), len(c) - 2)
    f = (s - i)[..., None]
    return c[i] * (1 - f) + c[i + 1] * f


def wood(seed, w, h, colours, rings=7, vertical=False, knots=2, boards=0):
    """Wood grain along u (or along v with vertical=True)."""
    if vertical:
        return wood(seed, h, w, colours, rings, False, knots, boards).transpose(1, 0, 2)
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:h, 0:w]
    u, v = x / w, y / h
    field = v * rings + 1.6 * noise(rng, w, h, 3, 5) + 0.5 * noise(rng, w, h, 5, 14)
    for _ in range(knots):
        ku, kv = rng.uniform(0.1, 0.9, 2)
        d2 = ((u - ku) * 5) ** 2 + ((v - kv) * 14) ** 2
        field += 2.2 * np.exp(-d2)
    t = 0.5 + 0.5 * np.sin(2 * np.pi * field)
    t = 0.55 * t ** 1.6 + 0.30 * noise(rng, w, h, 6, h // 3) + 0.20 * noise(rng, w, h, 4, 4)
    if boards:
        k = (v * boards).astype(int)
        t = t * 0.8 + rng.random(boards)[k] * 0.22
        t = np.where((v * boards) % 1 < boards * 1.5 / h, 1.0, t)
    return ramp(t, colours, 10)


def rect(img, x0, y0, x1, y1, rgb):
    h, w, _ = img.shape
    img[max(0, int(y0)):min(h, int(y1)), max(0, int(x0)):min(w, int(x1))] = rgb


def disc(img, cx, cy, r, rgb, r_in=0):
    y, x = np.mgrid[0:img.shape[0], 0:img.shape[1]]
    d = np.hypot(x + 0.5 - cx, y + 0.5 - cy)
    img[(d <= r) & (d >= r_in)] = rgb


def frame(img, m, t, rgb):
    h, w, _ = img.shape
    rect(img, m, m, w - m, m + t, rgb)
    rect(img, m, h - m - t, w - m, h - m, rgb)
    rect(img, m, m, m + t, h - m, rgb)
    rect(img, w - m - t, m, w - m, h - m, rgb)


def text(img, x, y, s, rgb, k=2):
    for ch in s:
        g = np.kron(FONT[ch], np.ones((k, k))).astype(bool)
        sub = img[y:y + g.shape[0], x:x + g.shape[1]]
        sub[g[:sub.shape[0], :sub.shape[1]]] = rgb
        x += 6 * k


def text_mid(img, cx, y, s, rgb, k=2):
    text(img, int(cx - (6 * len(s) - 1) * k / 2), y, s, rgb, k)


def barcode(img, seed, x0, y0, x1, y1):
    rng = np.random.default_rng(seed)
    rect(img, x0 - 3, y0 - 3, x1 + 3, y1 + 3, (250, 250, 248))
    x = x0
    while x < x1:
        n = int(rng.integers(1, 4))
        rect(img, x, y0, min(x + n, x1), y1, (20, 20, 24))
        x += n + int(rng.integers(1, 4))


def lines(img, seed, x0, y0, x1, y1, step, rgb, t=2):
    """Rows of short bars that stand for small print."""
    rng = np.random.default_rng(seed)
    y = y0
    while y + t <= y1:
        x = x0
        while x < x1:
            n = int(rng.integers(4, 16))
            rect(img, x, y, min(x + n, x1), y + t, rgb)
            x += n + 3
        y += step


OAK = [(214, 178, 128), (190, 148, 96), (150, 108, 64)]
PINE = [(238, 212, 160), (222, 184, 122), (182, 134, 76)]
WALNUT = [(150, 104, 70), (116, 76, 48), (70, 44, 28)]


# ---------------------------------------------------------------- hinged_box
def hinged_box():
    save("hinged_box/wood.png", wood(11, 256, 160, WALNUT, rings=5, knots=3, boards=3))
    img = wood(12, 256, 168, WALNUT, rings=4, knots=1)
    ink, gold = (44, 26, 18), (226, 190, 96)
    frame(img, 10, 4, gold)
    frame(img, 18, 2, ink)
    h, w, _ = img.shape
    y, x = np.mgrid[0:h, 0:w]
    dx, dy = x + 0.5 - w / 2, y + 0.5 - h / 2
    ang, rad = np.arctan2(dy, dx), np.hypot(dx, dy)
    for n, off, r0, col in ((4, np.pi / 4, 44, ink), (4, 0.0, 58, gold)):      # compass rose
        a = (ang - off + np.pi / n) % (2 * np.pi / n) - np.pi / n
        img[(rad < r0 * 0.30 / (0.30 + 1.1 * np.abs(a))) & (rad > 6)] = col
    disc(img, w / 2, h / 2, 36, ink, 34)
    disc(img, w / 2, h / 2, 64, gold, 62)
    text(img, 34, 30, "TEA", gold, 3)
    text(img, 176, 118, "1+2", gold, 3)
    save("hinged_box/lid.png", img)
    img = plain(128, 64, (236, 226, 196))
    frame(img, 3, 2, (150, 40, 36))
    text_mid(img, 64, 10, "HINGE", (150, 40, 36), 3)
    barcode(img, 13, 16, 38, 78, 56)
    disc(img, 102, 46, 11, (40, 92, 120))
    save("hinged_box/label.png", img)


# ---------------------------------------------------------------- cabinet_two_door
def cabinet():
    save("cabinet_two_door/oak.png", wood(21, 200, 256, OAK, rings=6, vertical=True, knots=3))
    save("cabinet_two_door/oak_top.png", wood(22, 256, 128, OAK, rings=5, knots=2, boards=4))
    img = plain(160, 200, (250, 246, 232))
    frame(img, 4, 3, (30, 90, 80))
    text_mid(img, 80, 16, "PANTRY", (30, 90, 80), 3)
    for i, s in enumerate(("RICE  12", "BEANS  8", "TEA   24", "SALT   3", "FLOUR  6")):
        text(img, 20, 52 + 24 * i, s, (60, 50, 40), 2)
        rect(img, 126, 52 + 24 * i, 140, 66 + 24 * i, ((200, 70, 50), (240, 180, 60))[i % 2])
    lines(img, 23, 20, 176, 140, 194, 8, (120, 110, 100))
    save("cabinet_two_door/notice.png", img)
    # Sticker: a fruit shape on plain ground.
    img = plain(96, 96, (244, 240, 224))
    frame(img, 2, 2, (70, 70, 70))
    disc(img, 48, 54, 28, (206, 56, 44))
    disc(img, 38, 46, 6, (240, 150, 130))
    rect(img, 46, 16, 51, 32, (90, 60, 30))
    disc(img, 62, 22, 9, (70, 140, 60))
    save("cabinet_two_door/sticker.png", img)


# ---------------------------------------------------------------- glasses
def glasses():
    rng = np.random.default_rng(31)
    t = 0.65 * noise(rng, 192, 64, 14, 5) + 0.35 * noise(rng, 192, 64, 40, 13)
    t = np.clip((t - 0.28) * 2.2, 0, 1)
    save("glasses/tortoise.png", ramp(t, [(40, 20, 12), (104, 54, 22), (214, 140, 58)], 8))
    img = ramp(np.clip((noise(rng, 256, 16, 22, 3) - 0.28) * 2.2, 0, 1),
               [(40, 20, 12), (104, 54, 22), (214, 140, 58)], 8)
    for x0 in (20, 200):
        rect(img, x0, 4, x0 + 14, 12, (240, 226, 180))
    text(img, 40, 5, "HC 52-18-125", (240, 226, 180), 1)
    save("glasses/temple.png", img)


# ---------------------------------------------------------------- microwave
def microwave():
    w, h = 192, 144
    img = plain(w, h, (24, 26, 30))
    y, x = np.mgrid[0:h, 0:w]
    hole = (((x + 4 * ((y // 8) % 2)) % 8 - 3.5) ** 2 + (y % 8 - 3.5) ** 2) < 5
    img[hole] = (74, 78, 84)
    frame(img, 0, 6, (14, 14, 16))
    save("microwave/window.png", img)
    img = plain(112, 216, (44, 46, 52))
    rect(img, 10, 10, 102, 46, (10, 22, 18))
    text_mid(img, 56, 18, "12:30", (90, 240, 150), 3)
    for r in range(4):
        for c in range(3):
            x0, y0 = 10 + c * 32, 58 + r * 28
            rect(img, x0, y0, x0 + 28, y0 + 23, (206, 208, 210))
            s = ("123", "456", "789", "-0+")[r][c]
            text(img, x0 + 9, y0 + 5, s, (30, 30, 36), 2)
    rect(img, 10, 174, 54, 204, (60, 150, 84))
    rect(img, 58, 174, 102, 204, (196, 62, 52))
    text(img, 17, 182, "GO", (255, 255, 255), 2)
    text(img, 61, 182, "OFF", (255, 255, 255), 2)
    save("microwave/keypad.png", img)
    img = plain(96, 128, (248, 248, 246))
    rect(img, 0, 0, 96, 20, (30, 80, 150))
    text_mid(img, 48, 4, "ENERGY", (255, 255, 255), 2)
    for i, col in enumerate(((20, 140, 70), (120, 180, 50), (230, 210, 40), (236, 150, 40), (210, 50, 40))):
        rect(img, 6, 28 + 14 * i, 36 + 10 * i, 38 + 14 * i, col)
        text(img, 9, 30 + 14 * i, "ABCDE"[i], (255, 255, 255), 1)
    rect(img, 74, 40, 92, 54, (20, 20, 20))
    text(img, 78, 43, "B", (255, 255, 255), 1)
    barcode(img, 42, 12, 104, 84, 120)
    save("microwave/sticker.png", img)
    img = plain(128, 64, (228, 229, 230))
    for i in range(9):
        rect(img, 8, 6 + 6 * i, 120, 9 + 6 * i, (70, 72, 76))
    save("microwave/vents.png", img)


# ---------------------------------------------------------------- folding_chair
def folding_chair():
    rng = np.random.default_rng(51)
    w, h = 192, 192
    img = plain(w, h, (232, 222, 196))
    for x0, x1, col in ((10, 34, (34, 78, 122)), (44, 50, (200, 76, 50)), (66, 90, (34, 78, 122)),
                        (102, 126, (34, 78, 122)), (142, 148, (200, 76, 50)), (158, 182, (34, 78, 122))):
        rect(img, x0, 0, x1, h, col)
    weave = np.kron(rng.integers(0, 3, (h // 4, w // 4)), np.ones((4, 4)))[..., None]
    y, x = np.mgrid[0:h, 0:w]
    img = img * (0.90 + 0.05 * weave) - 8 * (((x // 2 + y // 2) % 2)[..., None])
    save("folding_chair/canvas.png", img)
    img = plain(256, 80, (34, 78, 122))
    frame(img, 4, 2, (232, 222, 196))
    text_mid(img, 128, 16, "SEAT 42", (232, 222, 196), 5)
    rect(img, 20, 58, 236, 63, (200, 76, 50))
    rect(img, 20, 67, 236, 69, (232, 222, 196))
    save("folding_chair/back.png", img)


# ---------------------------------------------------------------- pedal_bin
def pedal_bin():
    rng = np.random.default_rng(61)
    w, h = 64, 256
    t = 0.5 * noise(rng, w, h, 2, 128) + 0.3 * noise(rng, w, h, 1, 40) + 0.2 * noise(rng, w, h, 2, 6)
    img = ramp(t, [(150, 154, 158), (184, 188, 192), (210, 213, 216)], 7)
    rect(img, 0, 60, w, 68, (40, 96, 74))
    rect(img, 0, 72, w, 75, (40, 96, 74))
    for x0 in range(0, w, 16):                                       # checker band
        rect(img, x0, 200, x0 + 8, 208, (40, 96, 74))
        rect(img, x0 + 8, 208, x0 + 16, 216, (40, 96, 74))
    save("pedal_bin/wall.png", img)
    img = plain(112, 160, (240, 240, 232))
    frame(img, 4, 3, (40, 96, 74))
    text_mid(img, 56, 14, "PAPER", (40, 96, 74), 3)
    for k in range(3):                                               # three turning bars
        a = 2 * np.pi * k / 3 - np.pi / 2
        cx, cy = 56 + 26 * np.cos(a), 84 + 26 * np.sin(a)
        disc(img, cx, cy, 14, (40, 96, 74))
        disc(img, cx, cy, 7, (240, 240, 232))
        disc(img, 56 + 26 * np.cos(a + 1.05), 84 + 26 * np.sin(a + 1.05), 6, (222, 160, 50))
    lines(img, 62, 16, 130, 96, 152, 8, (110, 116, 110), 3)
    save("pedal_bin/label.png", img)
    img = plain(96, 48, (58, 60, 62))
    for x0 in range(4, 92, 12):
        rect(img, x0, 4, x0 + 6, 44, (150, 152, 154))
    save("pedal_bin/tread.png", img)
    img = plain(80, 48, (250, 214, 60))
    frame(img, 2, 2, (30, 30, 30))
    text_mid(img, 40, 10, "12L", (30, 30, 30), 3)
    rect(img, 12, 36, 68, 40, (30, 30, 30))
    save("pedal_bin/badge.png", img)


# ---------------------------------------------------------------- three_drawers
def three_drawers():
    save("three_drawers/pine.png", wood(71, 256, 128, PINE, rings=4, knots=3))
    save("three_drawers/pine_side.png", wood(72, 160, 256, PINE, rings=5, vertical=True, knots=3, boards=3))
    save("three_drawers/pine_top.png", wood(73, 200, 200, PINE, rings=5, knots=2, boards=3))
    # Liner paper on the drawer floors.
    img = plain(160, 160, (236, 240, 236))
    y, x = np.mgrid[0:160, 0:160]
    img[((x + y) % 32) < 4] = (120, 160, 190)
    img[((x - y) % 32) < 4] = (210, 130, 120)
    for i in range(5):
        for j in range(5):
            disc(img, 18 + 32 * i, 18 + 32 * j, 5, (70, 110, 90))
    save("three_drawers/liner.png", img)
    for name, s, col in (("card1", "SOCKS", (170, 50, 60)), ("card2", "TOOLS", (40, 80, 140)),
                         ("card3", "MISC 3", (50, 110, 60))):
        img = plain(128, 64, (250, 248, 238))
        frame(img, 2, 3, col)
        text_mid(img, 64, 14, s, col, 3)
        lines(img, len(s) + col[0], 14, 44, 114, 58, 7, (90, 90, 90))
        save("three_drawers/%s.png" % name, img)


# ---------------------------------------------------------------- desk_lamp
def desk_lamp():
    w, h = 256, 96
    img = plain(w, h, (224, 92, 48))
    y, x = np.mgrid[0:h, 0:w]
    img[((x * 8 // w) % 2 == 0) & (y > 30) & (y < 70)] = (246, 226, 190)
    rect(img, 0, 76, w, 82, (52, 40, 60))
    rect(img, 0, 18, w, 22, (52, 40, 60))
    for k in range(8):
        if k % 2:
            disc(img, (k + 0.5) * w / 8, 50, 9, (52, 40, 60))
    rect(img, 0, 36, 10, 64, (60, 130, 130))                          # one odd patch: no symmetry
    save("desk_lamp/shade.png", img)
    rng = np.random.default_rng(81)
    t = 0.5 * noise(rng, 192, 192, 40, 40) + 0.5 * noise(rng, 192, 192, 12, 12)
    img = ramp((t - 0.2) * 1.5, [(58, 62, 72), (92, 98, 108), (160, 164, 168)], 5)
    text_mid(img, 96, 150, "LUX 7", (240, 236, 220), 3)
    save("desk_lamp/base.png", img)
    img = plain(32, 192, (206, 208, 212))
    for i in range(0, 192, 16):
        rect(img, 0, i, 32 if i % 64 == 0 else 16, i + 3, (40, 44, 60))
    save("desk_lamp/scale.png", img)


# ---------------------------------------------------------------- covered_box
def covered_box():
    rng = np.random.default_rng(91)
    t = 0.6 * noise(rng, 96, 64, 24, 16) + 0.4 * noise(rng, 96, 64, 6, 4)
    img = ramp(t, [(196, 164, 120), (208, 178, 134), (220, 192, 150)], 5)
    rect(img, 0, 46, 96, 52, (96, 66, 44))
    for x0 in range(6, 96, 14):
        rect(img, x0, 14, x0 + 5, 30, (150, 104, 70))
    save("covered_box/wall.png", img)
    t = 0.6 * noise(rng, 112, 120, 30, 24) + 0.4 * noise(rng, 112, 120, 6, 5)
    img = ramp(t, [(70, 112, 128), (84, 128, 142), (100, 144, 156)], 5)
    frame(img, 5, 3, (232, 220, 188))
    disc(img, 60, 50, 28, (232, 220, 188), 24)
    rect(img, 70, 92, 100, 106, (210, 96, 62))
    text_mid(img, 60, 43, "BOX", (232, 220, 188), 2)
    text(img, 16, 92, "NO 9", (232, 220, 188), 2)
    save("covered_box/lid.png", img)


if __name__ == "__main__":
    for f in (hinged_box, cabinet, glasses, microwave, folding_chair, pedal_bin, three_drawers,
              desk_lamp, covered_box):
        f()
