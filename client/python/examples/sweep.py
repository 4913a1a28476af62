# %% [markdown]
# How fine must the mesh be? The sag of a beam under its weight, over the number of cells, with `scindo.run`.

# %%
import numpy as np
import scindo


def beam(cells: int) -> scindo.Scene:
    scene = scindo.Scene(f"beam-{cells}", gravity=(0, 0, -9.81), step_s=0.02)
    scene.add_body(
        "beam",
        mesh={"box": {"min_m": [0, 0, 0], "max_m": [0.2, 0.04, 0.04], "cells": [5 * cells, cells, cells]}},
        law="linear",
        integrator="static",
        young_pa=1e6,
        poisson=0.3,
        density_kg_m3=1000,
        solver={"iterations": 2000, "tolerance": 1e-8},
    )
    scene.fix("beam", where={"slab": {"axis": "x", "from": 0, "to": 0}})
    return scene.add_probe("tip", "beam", (0.2, 0.02, 0.02))


# %% One run for each mesh. Nothing is left on the disk.
sags = {}
for cells in (1, 2, 4):
    result = scindo.run(beam(cells), steps=1)
    sags[cells] = -result.probes["tip"].displacement[-1, 2]
    print(f"{cells} cells across: the tip sags {sags[cells] * 1e3:.3f} mm ({len(result.points)} points)")

# %% Euler and Bernoulli, with the shear of Timoshenko: w L⁴ / (8 E I) + w L² / (2 κ G A).
width, length, young, poisson = 0.04, 0.2, 1e6, 0.3
load = 1000 * 9.81 * width**2
theory = load * length**4 / (8 * young * width**4 / 12) + load * length**2 / (
    2 * 5 / 6 * young / (2 * (1 + poisson)) * width**2
)
errors = np.array([abs(sag / theory - 1) for sag in sags.values()])
print("error against beam theory:", ", ".join(f"{error:.1%}" for error in errors))
assert np.all(np.diff(errors) < 0) and errors[-1] < 0.2
