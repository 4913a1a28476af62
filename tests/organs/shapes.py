"""Closed surfaces of organs and bodies, made with numpy alone: vertices (n, 3) [m] and triangles (m, 3)."""

import numpy as np


def sphere(level=4):
    """An icosphere of radius 1."""
    t = (1 + 5**0.5) / 2
    points = [[-1, t, 0], [1, t, 0], [-1, -t, 0], [1, -t, 0], [0, -1, t], [0, 1, t]]
    points += [[0, -1, -t], [0, 1, -t], [t, 0, -1], [t, 0, 1], [-t, 0, -1], [-t, 0, 1]]
    faces = [[0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4], [11, 10, 2]]
    faces += [[10, 7, 6], [7, 1, 8], [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9], [4, 9, 5]]
    faces += [[2, 4, 11], [6, 2, 10], [8, 6, 7], [9, 8, 1]]
    points = [np.array(p, float) / np.linalg.norm(p) for p in points]
    for _ in range(level):
        middle, finer = {}, []

        def between(a, b):
            key = (min(a, b), max(a, b))
            if key not in middle:
                p = points[a] + points[b]
                points.append(p / np.linalg.norm(p))
                middle[key] = len(points) - 1
            return middle[key]

        for a, b, c in faces:
            ab, bc, ca = between(a, b), between(b, c), between(c, a)
            finer += [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
        faces = finer
    return np.array(points), np.array(faces)


def join(*parts):
    """Several surfaces as one, which may pass through each other."""
    points, faces, first = [], [], 0
    for p, f in parts:
        points.append(p)
        faces.append(f + first)
        first += len(p)
    return np.concatenate(points), np.concatenate(faces)


def tube(path, radius, sides=24):
    """A rod of round section along `path` (n, 3), with flat ends."""
    path = np.asarray(path, float)
    tangent = np.gradient(path, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    across = np.cross(tangent, [0.0, 0.3, 1.0])
    across /= np.linalg.norm(across, axis=1)[:, None]
    other = np.cross(tangent, across)
    angle = 2 * np.pi * np.arange(sides) / sides
    rings = path[:, None] + radius * (np.cos(angle)[:, None] * across[:, None] + np.sin(angle)[:, None] * other[:, None])
    n = len(path)
    points = np.concatenate([rings.reshape(-1, 3), path[:1], path[-1:]])
    at = lambda i, k: i * sides + k % sides
    faces = []
    for k in range(sides):
        for i in range(n - 1):
            a, b, c, d = at(i, k), at(i, k + 1), at(i + 1, k + 1), at(i + 1, k)
            faces += [[a, b, c], [a, c, d]]
        faces += [[n * sides, at(0, k + 1), at(0, k)], [n * sides + 1, at(n - 1, k), at(n - 1, k + 1)]]
    return points, np.array(faces)


def bean():
    """A kidney of 11 x 6 x 5 cm."""
    p, f = sphere()
    p = p * [0.055, 0.030, 0.025]
    p[:, 1] += 6.0 * p[:, 0] ** 2 - 0.009
    return p, f


def lobes():
    """Two lobes of different thickness, 16 cm, one surface with bumps."""
    p, f = sphere()
    bumps = 1 + 0.08 * np.sin(5 * p[:, 0] + 1) * np.cos(4 * p[:, 2])
    p = p * bumps[:, None] * [0.08, 0.035, 0.05]
    p[:, 1] *= 1 + 5 * p[:, 0]
    return p, f


def shell():
    """A bladder of 10 cm with a wall of 8 mm."""
    (p, f), (q, g) = sphere(), sphere(3)
    return join((0.05 * p, f), (0.042 * q, g[:, ::-1]))


def vessel():
    """A bent rod of 2 cm and 20 cm length."""
    t = np.linspace(0, np.pi, 40)
    return tube(np.stack([0.06 * np.cos(t), 0.06 * np.sin(t), 0.01 * t], axis=1), 0.01)


def plate():
    """A flap of 14 x 10 x 1.2 cm."""
    p, f = sphere()
    sign, size = np.sign(p), np.abs(p) ** 0.35
    return sign * size * [0.07, 0.05, 0.006], f


def dirty():
    """Two balls through each other; of their triangles some are lost, flipped or doubled."""
    (p, f), (q, g) = sphere(), sphere()
    p, f = join((0.045 * p, f), (0.035 * q + [0.04, 0.01, 0.0], g))
    chance = np.random.default_rng(1).random(len(f))
    f[chance > 0.98] = f[chance > 0.98][:, ::-1]
    return p, np.concatenate([f[chance > 0.02], f[(chance > 0.5) & (chance < 0.51)]])


def tiny():
    """A lymph node of 8 mm."""
    p, f = sphere(3)
    return p * [0.004, 0.003, 0.0025], f


def millimetres():
    """A spleen of 12 cm, in a file in millimetres."""
    p, f = sphere()
    p = p * [60.0, 20.0, 35.0]
    p[:, 1] += 0.006 * p[:, 0] ** 2
    return p, f


def write(path, points, faces):
    lines = ["v {:.7g} {:.7g} {:.7g}".format(*p) for p in points]
    lines += ["f {} {} {}".format(*(face + 1)) for face in faces]
    path.write_text("\n".join(lines) + "\n")
