"""Compares what `scindo check` foretells of twelve organs and bodies with what `scindo run` does.

    python tests/organs/organs.py SCINDO OUT_DIR [--models DIR] [--only NAME]... [--steps N] [--cells N]

Each body gets the same scene. Eight are made by shapes.py; with --models (or SCINDO_MODELS) four real ones
join them: liver.msh, liver.vtk, liver-smooth.obj, stanford-bunny.obj. The table holds, per body: whether check and
run agree that every step converges, the largest displacement foretold and seen (within 20 %), the processor
time of a step foretold and measured (within a factor of 1.5). Exit code 1 when one of them is not met.
"""

import argparse
import json
import os
import pathlib
import subprocess
import sys

import shapes

MADE = ["bean", "lobes", "shell", "vessel", "plate", "dirty", "tiny", "millimetres"]
# Kind of mesh and factor to metres.
REAL = {
    "liver.msh": ("file", 0.03),
    "liver.vtk": ("surface", 0.001),
    "liver-smooth.obj": ("surface", 0.03),
    "stanford-bunny.obj": ("surface", 1.0),
}
DISPLACEMENT, COST = 0.20, 1.5


def scene(name, kind, path, scale, cells):
    """An organ held at its lowest tenth; the fix is a slab, because every body has another size."""
    mesh = f'{kind} = "{path}", scale = {scale}' + (f", cells = {cells}" if kind == "surface" else "")
    return f"""schema = 1
name = "{name}"
[world]
gravity_m_s2 = [0.0, -9.81, 0.0]
step_s = 0.02
[[body]]
id = "organ"
mesh = {{ {mesh} }}
law = "corotational"
young_pa = 5e3
poisson = 0.45
density_kg_m3 = 1060
[[body.fix]]
where = {{ slab = {{ axis = "y", from = 0.0, to = 0.1 }} }}
"""


def bodies(args, folder):
    """Name, kind of mesh, file and factor to metres of every body."""
    for name in MADE:
        path = folder / f"{name}.obj"
        shapes.write(path, *getattr(shapes, name)())
        yield name, "surface", path, 0.001 if name == "millimetres" else 1.0
    for name, (kind, scale) in REAL.items() if args.models else ():
        yield name, kind, (args.models / name).resolve(), scale


def output(command):
    done = subprocess.run(command, capture_output=True, text=True, timeout=900)
    return done.stdout, done.returncode, done.stderr


def compare(args, folder, name, kind, path, scale):
    """The row of a body, and what is not met."""
    file = folder / f"{name}.toml"
    file.write_text(scene(name, kind, path, scale, args.cells))
    steps = ["--steps", str(args.steps)]
    out, code, errors = output([args.scindo, "check", file, "--json", *steps])
    if code != 0:
        return [name], [f"check ended with {code}: {out}{errors}"]
    said = json.loads(out)
    if said["forecast"] is None:
        return [name], [f"no forecast: {said['no_forecast']}"]
    foretold, body = said["forecast"], said["forecast"]["bodies"][0]
    output([args.scindo, "run", file, "--fast", *steps, "--out", folder / name, "--json"])
    summary = json.loads((folder / name / "summary.json").read_text())
    seen = summary["bodies"][0]
    solver = seen["solver"]
    converged = solver["unconverged_steps"] + solver["rolled_back_steps"] == 0
    moves = body["largest_displacement_m"] / max(seen["largest_displacement_m"], 1e-12)
    cost = foretold["cost"]["mean_ms"] / summary["timing"]["processor_mean_ms"]
    wrong = []
    if body["converges"] != converged:
        wrong.append(f"check says converges = {body['converges']}, the run {solver}")
    if abs(moves - 1) > DISPLACEMENT:
        wrong.append(f"displacement is foretold {moves:.2f} times what it is")
    if not 1 / COST <= cost <= COST:
        wrong.append(f"cost is foretold {cost:.2f} times what it is")
    row = [
        name,
        seen["elements"],
        f"{body['converges']}/{converged}",
        f"{solver['max_iterations']}",
        f"{1e3 * body['largest_displacement_m']:.2f}",
        f"{1e3 * seen['largest_displacement_m']:.2f}",
        f"{moves:.2f}",
        f"{foretold['cost']['mean_ms']:.2f}",
        f"{summary['timing']['processor_mean_ms']:.2f}",
        f"{cost:.2f}",
        body["displacement"],
        foretold["ending"],
        foretold["steps"],
        len(said["warnings"]),
    ]
    return row, wrong


HEAD = ["body", "elements", "converges", "iterations", "mm foretold", "mm seen", "ratio", "ms foretold"]
HEAD += ["ms seen", "ratio", "how", "ending", "steps", "warnings"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("scindo", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--models", type=pathlib.Path, default=os.environ.get("SCINDO_MODELS"))
    parser.add_argument("--only", action="append", help="one of the bodies")
    parser.add_argument("--steps", type=int, default=150)
    parser.add_argument("--cells", type=int, default=20)
    args = parser.parse_args()
    args.models = args.models and pathlib.Path(args.models)
    args.scindo = args.scindo.resolve()
    folder = args.out.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    print(" | ".join(HEAD))
    failed = 0
    for name, kind, path, scale in bodies(args, folder):
        if args.only and name not in args.only:
            continue
        row, wrong = compare(args, folder, name, kind, path, scale)
        print(" | ".join(map(str, row)), flush=True)
        for text in wrong:
            print(f"    not so: {text}")
        failed += bool(wrong)
    sys.exit(f"{failed} bodies are not as foretold" if failed else 0)


if __name__ == "__main__":
    main()
