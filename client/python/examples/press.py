# %% [markdown]
# Press on a block with a ball, and read the force over the depth.
#
# Run it as a script (`python press.py`) or cell by cell in an editor that knows `# %%`. It starts a server of its own;
# `SCINDO_BIN` or `PATH` says where the program is.

# %%
import numpy as np
import scindo

scene = scindo.Scene("press", gravity=(0, 0, -9.81), step_s=0.01)
scene.add_body(
    "block",
    mesh={"box": {"min_m": [0, 0, 0], "max_m": [0.12, 0.06, 0.04], "cells": [12, 6, 4]}},
    young_pa=2e4,
    poisson=0.45,
    density_kg_m3=1000,
    rayleigh={"mass_1_s": 1, "stiffness_s": 0.01},
)
scene.fix("block", where={"slab": {"axis": "z", "from": 0, "to": 0}})
scene.add_tool("finger", shape={"sphere": {"radius_m": 0.008}}, stiffness_n_m=800, max_force_n=10)

# %% The ball goes down in steps of half a millimetre, and waits 0.3 simulated seconds for the tissue each time.
depths, forces = [], []
with scindo.serve(scene) as server, server.connect() as session:
    finger, block = session.tool("finger"), session.body("block")
    top = block.positions[:, 2].max()
    for depth in np.arange(0.0, 0.0045, 0.0005):
        finger.move((0.06, 0.03, top + 0.008 - depth))
        block.wait(step=block.surface.step + 30)
        depths.append(depth)
        forces.append(finger.force[2])
        print(f"{depth * 1e3:4.1f} mm deep: {forces[-1]:6.3f} N")
    print("where the ball bears:", session.forces()[0].contacts, "points")

# %% The deeper, the harder.
assert np.all(np.diff(forces) >= -1e-3) and forces[-1] > 0.3, forces
print(f"stiffness at the end: {(forces[-1] - forces[-2]) / 0.0005:.0f} N/m")
