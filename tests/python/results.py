"""Reads the results of `scindo run … --out DIR` with independent readers, and draws them.

Checks that summary.json, probes.csv, final.vtu and final-surface.vtp are complete and finite, that meshio,
pyvista and the Python package read the same grid, that displacements lead from rest to current positions, that the stress is
one symmetric tensor, that the surface is closed, and that a picture shows both lips of a cut.

    python tests/python/results.py DIR [--picture FILE.png] [--no-lips]
"""

import argparse
import csv
import json
import math
import os
import pathlib
import sys

import meshio
import numpy as np

os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
import pyvista  # noqa: E402  (reads the variable above)
import wire  # noqa: E402, F401  (so that the package is found)
from PIL import Image  # noqa: E402
from scindo.results import Results  # noqa: E402

PROBE_HEADER = ["step", "time_s", "id", "x_m", "y_m", "z_m", "ux_m", "uy_m", "uz_m"]
SKIN_COLOUR, BACKGROUND = (198, 150, 135), (255, 255, 255)
LIP_COLOURS = [(200, 30, 45), (30, 90, 200), (240, 160, 0), (20, 150, 70), (150, 40, 170), (0, 170, 180)]
# A lip counts as visible with this many pixels of a 640 × 480 picture.
VISIBLE_PIXELS = 20


def check(condition, claim):
    if not condition:
        raise AssertionError(f"not so: {claim}")


def numbers(value, path=""):
    """All numbers of a JSON tree with their paths."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from numbers(inner, f"{path}.{key}")
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            yield from numbers(inner, f"{path}[{index}]")
    elif isinstance(value, (int, float)) and not isinstance(value, bool):
        yield path, value


def read_summary(folder):
    summary = json.loads((folder / "summary.json").read_text())
    check(summary.get("status") == "done", f"the run is done: {summary.get('status')}")
    check(summary["steps"] > 0, "steps were made")
    for path, value in numbers(summary):
        check(math.isfinite(value), f"summary{path} = {value} is finite")
    return summary


def read_probes(folder, steps):
    with open(folder / "probes.csv", newline="") as file:
        rows = list(csv.reader(file))
    check(rows[0] == PROBE_HEADER, f"header of probes.csv: {rows[0]}")
    ids = {row[2] for row in rows[1:]}
    check(len(rows) - 1 == len(ids) * (steps + 1), f"{len(rows) - 1} rows: one per step and probe, and the start")
    for row in rows[1:]:
        values = [float(v) for v in row[:2] + row[3:]]
        check(all(map(math.isfinite, values)), f"probe row {row} is finite")
    return ids


POINT_FIELDS = {"displacement_m", "rest_position_m", "velocity_m_s", "copy"}


def check_fields(data, cell_fields):
    """All fields are there and finite; the points are where the displacement leads."""
    check(np.isfinite(data.points).all(), "positions are finite")
    check(POINT_FIELDS <= set(data.point_data), f"point fields: {list(data.point_data)}")
    check(cell_fields <= set(data.cell_data), f"cell fields: {list(data.cell_data)}")
    for fields in (data.point_data, data.cell_data):
        for name in fields:
            check(np.isfinite(fields[name]).all(), f"field {name} is finite")
    check(int(data.field_data["points_are_current_positions"][0]) == 1, "the file says what its points are")
    moved = data.point_data["rest_position_m"] + data.point_data["displacement_m"]
    check(np.allclose(moved, data.points, rtol=0, atol=1e-12), "rest position + displacement = point")


def check_stress(grid):
    """One tensor in VTK's order, whose von Mises stress is the one in the file."""
    tensor = grid.cell_data["cauchy_stress_pa"]
    check(tensor.shape == (grid.n_cells, 6), f"six components: {tensor.shape}")
    names = [grid.GetCellData().GetArray("cauchy_stress_pa").GetComponentName(i) for i in range(6)]
    check(names == ["XX", "YY", "ZZ", "XY", "YZ", "XZ"], f"VTK's order: {names}")
    xx, yy, zz, xy, yz, xz = tensor.T
    squares = 0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3 * (xy**2 + yz**2 + xz**2)
    check(np.allclose(np.sqrt(squares), grid.cell_data["von_mises_pa"], rtol=1e-9, atol=1e-9), "von Mises stress")


def read_grid(folder, summary):
    """final.vtu by two readers that know nothing of each other."""
    file = str(folder / "final.vtu")
    grid, other = pyvista.read(file), meshio.read(file)
    check(grid.n_points == len(other.points), "pyvista and meshio see the same points")
    check(np.array_equal(grid.points, other.points), "pyvista and meshio see the same positions")
    check(grid.n_cells == sum(len(block.data) for block in other.cells), "and the same number of cells")
    check({block.type for block in other.cells} == {"tetra"}, "tetrahedra only")
    own = Results.read(folder)
    check(np.array_equal(own.points, grid.points), "the package sees the same positions")
    check(np.array_equal(own.solid.cells, other.cells[0].data), "and the same tetrahedra")
    check(set(own.solid.cell_data) == set(grid.cell_data), f"and the same fields: {list(own.solid.cell_data)}")
    for name, values in own.solid.cell_data.items():
        check(np.array_equal(values, grid.cell_data[name]), f"and the same {name}")
    surface = pyvista.read(str(folder / "final-surface.vtp"))
    check(np.array_equal(own.surface.cells, surface.regular_faces), "and the same triangles")
    check_fields(grid, {"body", "element", "piece", "volume_fraction", "von_mises_pa", "cauchy_stress_pa"})
    check_stress(grid)
    fraction = grid.cell_data["volume_fraction"]
    check((fraction > 0).all() and (fraction <= 1 + 1e-9).all(), "fractions lie in (0, 1]")
    volumes = grid.compute_cell_sizes(length=False, area=False)["Volume"]
    expected = sum(body["volume_m3"] for body in summary["bodies"])
    check(abs(volumes.sum() / expected - 1) < 1e-6, f"no tetrahedra overlap: {volumes.sum()} of {expected} m³")
    return grid


def read_surface(folder):
    """final-surface.vtp: points n × 3, triangles m × 3 and their cut tags; closed."""
    surface = pyvista.read(str(folder / "final-surface.vtp"))
    check_fields(surface, {"body", "cut_tag"})
    check(surface.is_all_triangles, "triangles only")
    triangles = surface.regular_faces
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    _, uses = np.unique(edges, axis=0, return_counts=True)
    check((uses == 2).all(), "two triangles at every edge: the surface is closed and 2-manifold")
    blocks = pyvista.read(str(folder / "final.vtm"))
    check(blocks.keys() == ["solid", "surface"], f"both files in one: {blocks.keys()}")
    check(blocks["surface"].n_cells == surface.n_cells, "the block is the surface")
    return np.asarray(surface.points), triangles, np.asarray(surface.cell_data["cut_tag"])


def lips_of(points, triangles, tags):
    """Lip number per triangle (0: skin). A lip is a connected part of the faces of one cut; where
    the two lips meet at the crack front the surface folds back, which separates them."""
    a, b, c = (points[triangles[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    by_edge = {}
    for t in np.flatnonzero(tags > 0):
        for i in range(3):
            edge = tuple(sorted((triangles[t, i], triangles[t, (i + 1) % 3])))
            by_edge.setdefault(edge, []).append(t)
    neighbours = {}
    for pair in by_edge.values():
        if len(pair) == 2 and tags[pair[0]] == tags[pair[1]] and normals[pair[0]] @ normals[pair[1]] > -0.5:
            for one, other in (pair, pair[::-1]):
                neighbours.setdefault(one, []).append(other)
    lip, count, sizes = np.zeros(len(triangles), int), 0, []
    for start in np.flatnonzero(tags > 0):
        if lip[start]:
            continue
        count += 1
        stack, size = [start], 0
        lip[start] = count
        while stack:
            t = stack.pop()
            size += 1
            for other in neighbours.get(t, []):
                if not lip[other]:
                    lip[other] = count
                    stack.append(other)
        sizes.append(size)
    # Largest first, so that colours are stable.
    order = np.argsort(sizes)[::-1]
    rank = np.zeros(count + 1, int)
    for new, old in enumerate(order):
        rank[old + 1] = new + 1
    return rank[lip], count


def colours_of(lip):
    palette = np.array([SKIN_COLOUR] + [LIP_COLOURS[i % len(LIP_COLOURS)] for i in range(lip.max(initial=0))])
    return palette[lip].astype(np.uint8)


class Camera:
    """One window; unlit colours are exact."""

    def __init__(self, mesh):
        self.plotter = pyvista.Plotter(off_screen=True, window_size=(640, 480))
        self.plotter.background_color = BACKGROUND
        self.actor = self.plotter.add_mesh(mesh, scalars="colour", rgb=True, lighting=False)
        self.plotter.show(auto_close=False)

    def picture(self, view, focus, radius, lit=False):
        up = (0, 1, 0) if abs(view[2]) > 0.9 else (0, 0, 1)
        self.plotter.camera_position = [tuple(focus + 2.2 * radius * view), tuple(focus), up]
        # Wide, so that both walls of a gap are seen.
        self.plotter.camera.view_angle = 58
        self.plotter.reset_camera_clipping_range()
        self.actor.prop.lighting = lit
        self.plotter.render()
        return self.plotter.screenshot(return_img=True)


def pixels_per_lip(picture, lips):
    return [int((picture[..., :3] == LIP_COLOURS[i]).all(axis=-1).sum()) for i in range(min(lips, len(LIP_COLOURS)))]


def picture_of(points, triangles, lip, lips, file):
    """Looks from all sides and keeps the view in which the second-best lip shows most."""
    faces = np.hstack([np.full((len(triangles), 1), 3), triangles]).ravel()
    mesh = pyvista.PolyData(points.astype(np.float32), faces)
    mesh.cell_data["colour"] = colours_of(lip)
    low, high = points.min(axis=0), points.max(axis=0)
    focus, radius = (low + high) / 2, np.linalg.norm(high - low) / 2
    grid = [np.array(v, float) for v in np.ndindex(3, 3, 3) if v != (1, 1, 1)]
    views = [(v - 1) / np.linalg.norm(v - 1) for v in grid]
    close = [(focus, radius)]
    if lips:
        centre = points[triangles[lip > 0]].reshape(-1, 3)
        middle = (centre.min(axis=0) + centre.max(axis=0)) / 2
        close.append((middle, 0.6 * np.linalg.norm(centre.max(axis=0) - centre.min(axis=0))))
    camera, best = Camera(mesh), (-1, None, None)
    for where in close:
        for view in views:
            seen = sorted(pixels_per_lip(camera.picture(view, *where), lips), reverse=True)
            score = seen[1] if len(seen) > 1 else 0
            if score > best[0]:
                best = (score, view, where)
        if best[0] >= 10 * VISIBLE_PIXELS:
            break
    _, view, where = best
    seen = pixels_per_lip(camera.picture(view, *where), lips)
    picture = camera.picture(view, *where, lit=True)
    check((picture != 255).any(axis=-1).mean() > 0.02, "the picture shows a body")
    if file:
        file.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(picture).save(file)
    return sum(n >= VISIBLE_PIXELS for n in seen), seen


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--picture", type=pathlib.Path, help="where to keep the picture (PNG)")
    parser.add_argument("--no-lips", action="store_true", help="the scene cuts nothing")
    args = parser.parse_args()
    summary = read_summary(args.folder)
    probes = read_probes(args.folder, summary["steps"])
    grid = read_grid(args.folder, summary)
    points, triangles, tags = read_surface(args.folder)
    lip, lips = lips_of(points, triangles, tags)
    visible, pixels = picture_of(points, triangles, lip, lips, args.picture)
    print(
        f"{args.folder}: {summary['steps']} steps, {grid.n_points} points, {grid.n_cells} tetrahedra, "
        f"{len(triangles)} triangles, probes {sorted(probes)}, {lips} lips, {visible} visible {pixels[:4]}"
    )
    if not args.no_lips:
        check(lips >= 2, f"two or more lips: {lips}")
        check(visible >= 2, f"two or more lips are visible: pixels {pixels}")


if __name__ == "__main__":
    try:
        main()
    except (AssertionError, KeyError, OSError, ValueError) as error:
        print(f"results.py: {type(error).__name__}: {error}", file=sys.stderr)
        sys.exit(1)
