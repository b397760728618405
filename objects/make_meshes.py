#!/usr/bin/env python3
"""Writes the few OBJ meshes which primitives cannot express (needs only the standard library).

    python3 make_meshes.py

glasses/rim.obj    closed ring, superellipse in the x-z plane, normal +-y
glasses/lens.obj   closed thin plate which fills the rim
desk_lamp/shade.obj  closed conical shell, axis +z, wide end at +z
All meshes are watertight, wound counter-clockwise seen from outside, in metres, with UVs.
"""
import math
import os

HERE = os.path.dirname(os.path.abspath(__file__))


def write(path, about, verts, uvs, quads):
    with open(os.path.join(HERE, path), "w") as f:
        f.write("# %s\n" % about)
        for v in verts:
            f.write("v %.6f %.6f %.6f\n" % tuple(v))
        for t in uvs:
            f.write("vt %.5f %.5f\n" % tuple(t))
        for q in quads:                      # each corner is (vertex, uv), 0-based
            a = ["%d/%d" % (v + 1, t + 1) for v, t in q]
            for k in range(1, len(a) - 1):
                f.write("f %s %s %s\n" % (a[0], a[k], a[k + 1]))


def superellipse(t, a, b, n):
    c, s = math.cos(t), math.sin(t)
    return (a * math.copysign(abs(c) ** (2 / n), c), b * math.copysign(abs(s) ** (2 / n), s))


A, B, N = 0.0295, 0.0225, 2.7               # rim centre line, half width and half height


def rim():
    m, k = 56, 8                            # around the ring, around the section
    ra, ry = 0.0022, 0.0020                 # section: in-plane and along y
    verts, uvs, quads = [], [], []
    for i in range(m):
        t = 2 * math.pi * i / m
        x, z = superellipse(t, A, B, N)
        x0, z0 = superellipse(t - 0.02, A, B, N)
        x1, z1 = superellipse(t + 0.02, A, B, N)
        nx, nz = z1 - z0, -(x1 - x0)        # outward normal
        r = math.hypot(nx, nz)
        nx, nz = nx / r, nz / r
        for j in range(k):
            p = 2 * math.pi * j / k
            verts.append((x + ra * math.cos(p) * nx, ry * math.sin(p), z + ra * math.cos(p) * nz))
    for i in range(m + 1):
        for j in range(k + 1):
            uvs.append((i / m, j / k))
    for i in range(m):
        for j in range(k):
            i1, j1 = (i + 1) % m, (j + 1) % k
            quads.append([(i * k + j, i * (k + 1) + j), (i * k + j1, i * (k + 1) + j + 1),
                          (i1 * k + j1, (i + 1) * (k + 1) + j + 1), (i1 * k + j, (i + 1) * (k + 1) + j)])
    write("glasses/rim.obj", "hingecast sample: glasses rim", verts, uvs, quads)


def lens():
    m, h = 48, 0.0009
    pts = [superellipse(2 * math.pi * i / m, A - 0.0012, B - 0.0012, N) for i in range(m)]
    verts = [(x, -h, z) for x, z in pts] + [(x, h, z) for x, z in pts]
    uv = [(0.5 + 0.5 * x / A, 0.5 + 0.5 * z / B) for x, z in pts]
    verts += [(0, -h, 0), (0, h, 0)]
    uvs = uv + [(0.5, 0.5)]
    quads = []
    for i in range(m):
        j = (i + 1) % m
        quads.append([(2 * m, m), (i, i), (j, j)])                              # front, -y
        quads.append([(2 * m + 1, m), (m + j, j), (m + i, i)])                  # back, +y
        quads.append([(i, i), (m + i, i), (m + j, j), (j, j)])                  # edge
    write("glasses/lens.obj", "hingecast sample: glasses lens", verts, uvs, quads)


def shade():
    m = 48
    # Profile (radius, z), closed: up the outside, back down the inside, with a cap at the neck.
    prof = [(0.022, 0.016), (0.027, 0.040), (0.066, 0.118), (0.0635, 0.118), (0.0245, 0.041), (0.0195, 0.019)]
    v_of = [0.0, 0.2, 1.0, 0.98, 0.2, 0.0]
    k = len(prof)
    verts = [(r * math.cos(2 * math.pi * i / m), r * math.sin(2 * math.pi * i / m), z)
             for i in range(m) for r, z in prof]
    uvs = [(i / m, 1 - v) for i in range(m + 1) for v in v_of]
    out, inn = len(verts), len(verts) + 1
    verts += [(0, 0, prof[0][1]), (0, 0, prof[-1][1])]
    uvs.append((0.5, 0.99))
    mid = len(uvs) - 1
    quads = []
    for i in range(m):
        i1 = (i + 1) % m
        for j in range(k - 1):
            quads.append([(i * k + j, i * k + j), (i1 * k + j, (i + 1) * k + j),
                          (i1 * k + j + 1, (i + 1) * k + j + 1), (i * k + j + 1, i * k + j + 1)])
        quads.append([(out, mid), (i1 * k, (i + 1) * k), (i * k, i * k)])
        quads.append([(inn, mid), (i * k + k - 1, i * k + k - 1), (i1 * k + k - 1, (i + 1) * k + k - 1)])
    write("desk_lamp/shade.obj", "hingecast sample: desk lamp shade", verts, uvs, quads)


if __name__ == "__main__":
    rim()
    lens()
    shade()
