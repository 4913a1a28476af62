"""Runs the real meshes through `scindo run`: the scene of each is written here: held at
one end, stretched at the other, cut across its longest axis; results.py judges what comes out.

    python tests/python/models.py SCINDO MODELS_DIR OUT_DIR [--steps N]

Without a folder of real meshes (MODELS_DIR is `made`) the body is a dirty surface made here: an
ellipsoid with holes, flipped and doubled triangles.
"""

import argparse
import pathlib
import subprocess
import sys
import time

import numpy as np
import pyvista

# File, kind of mesh, factor to metres (so that each is about 0.2 m long).
MODELS = [
    ("liver-smooth.obj", "surface", 0.03),
    ("liver.msh", "file", 0.03),
    ("liver.vtk", "surface", 0.001),
    ("stanford-bunny.obj", "surface", 1.0),
]


MADE = [("dirty.obj", "surface", 1.0)]


def make_dirty(path):
    """Writes an ellipsoid of 16 x 8 x 8 cm with a twentieth of its triangles lost, flipped or doubled."""
    sphere = pyvista.Icosphere(radius=0.04, nsub=4)
    points = np.asarray(sphere.points, float) * [2.0, 1.0, 1.0]
    triangles = np.array(sphere.faces).reshape(-1, 4)[:, 1:]
    chance = np.random.default_rng(1).random(len(triangles))
    triangles[chance > 0.98] = triangles[chance > 0.98][:, ::-1]
    triangles = np.concatenate([triangles[chance > 0.02], triangles[(chance > 0.5) & (chance < 0.51)]])
    lines = ["v {:.9g} {:.9g} {:.9g}".format(*point) for point in points]
    lines += ["f {} {} {}".format(*(triangle + 1)) for triangle in triangles]
    path.write_text("\n".join(lines) + "\n")


def points_of(path, scale):
    """Vertices of the file [m]."""
    if path.suffix == ".msh":
        # Gmsh 1: after $NOD the count, then lines `number x y z`.
        lines = path.read_text().split("\n")
        start = lines.index("$NOD") + 1
        rows = lines[start + 1 : start + 1 + int(lines[start])]
        points = np.array([row.split()[1:4] for row in rows], float)
    else:
        points = np.asarray(pyvista.read(path).points, float)
    return points * scale


def scene(path, kind, scale, depth):
    """TOML of the scene; its probe lies at a part `depth` of the way from the far tip into the body."""
    points = points_of(path, scale)
    low, high = points.min(axis=0), points.max(axis=0)
    size = high - low
    across, along, up = np.argsort(size)[::-1]
    margin = 0.2 * size[across]
    middle = low[across] + 0.507 * size[across]
    sweep = []
    for part in np.linspace(0.0, 1.0, 9):
        tip = np.zeros(3)
        tip[across] = middle
        tip[along] = low[along] - margin + part * (size[along] + 2 * margin)
        tip[up] = low[up] - margin
        heel = tip.copy()
        heel[up] = high[up] + margin
        sweep.append([tip.tolist(), heel.tolist()])
    axis = "xyz"[across]
    end = points[points[:, across] > high[across] - 0.15 * size[across]]
    tip = points[np.argmax(points[:, across])]
    probe = tip + depth * (end.mean(axis=0) - tip)
    pull = np.zeros(3)
    pull[across] = 0.1 * size[across]
    cells = "cells = 32, " if kind == "surface" else ""
    ends = [f'{{ slab = {{ axis = "{axis}", from = {a}, to = {b} }} }}' for a, b in [(0.0, 0.12), (0.88, 1.0)]]
    return f"""schema = 1
name = "{path.stem}"
[world]
step_s = 0.01
[[body]]
id = "body"
mesh = {{ {kind} = "{path}", {cells}scale = {scale} }}
law = "corotational"
young_pa = 2e4
poisson = 0.4
density_kg_m3 = 1000.0
rayleigh = {{ mass_1_s = 2.0, stiffness_s = 0.01 }}
[[body.fix]]
where = {ends[0]}
axes = "xyz"
# Stretched by a tenth, so that the cut opens.
[[body.fix]]
where = {ends[1]}
axes = "xyz"
displacement_m = {pull.tolist()}
[[cut]]
body = "body"
at_s = 0.3
method = "xfem"
sweep_m = {sweep}
[[probe]]
id = "end"
body = "body"
point_m = {probe.tolist()}
"""


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("scindo", type=pathlib.Path)
    parser.add_argument("models", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--steps", type=int, default=300)
    parser.add_argument("--only", help="one of the models")
    args = parser.parse_args()
    results = pathlib.Path(__file__).with_name("results.py")
    made = str(args.models) == "made"
    if made:
        args.models = args.out / "made"
        args.models.mkdir(parents=True, exist_ok=True)
        make_dirty(args.models / "dirty.obj")
    for name, kind, scale in MADE if made else MODELS:
        if args.only and name != args.only:
            continue
        folder = args.out / name
        folder.mkdir(parents=True, exist_ok=True)
        file = folder / "scene.toml"
        for depth in (0.2, 0.5, 0.1, 0.8, 0.05):
            file.write_text(scene((args.models / name).resolve(), kind, scale, depth))
            # A thin or hollow end may leave the probe outside; then the next depth.
            if subprocess.run([args.scindo, "check", file, "--no-solve"], capture_output=True, timeout=120).returncode == 0:
                break
        start = time.monotonic()
        run = [args.scindo, "run", file, "--fast", "--steps", str(args.steps), "--out", folder]
        subprocess.run(run, check=True, timeout=600, stdout=subprocess.DEVNULL)
        seconds = time.monotonic() - start
        print(f"{name}: {args.steps} steps in {seconds:.0f} s", flush=True)
        subprocess.run([sys.executable, results, folder, "--picture", folder / "cut.png"], check=True, timeout=300)


if __name__ == "__main__":
    try:
        main()
    except (subprocess.CalledProcessError, subprocess.TimeoutExpired) as error:
        sys.exit(f"models.py: {error}")
