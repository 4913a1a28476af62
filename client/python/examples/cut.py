# %% [markdown]
# Stretch a block, cut into its top, and measure how far the wound opens.

# %%
import numpy as np
import scindo

scene = scindo.Scene("cut", step_s=0.01)
scene.add_body(
    "flesh",
    mesh={"box": {"min_m": [-0.06, -0.03, 0], "max_m": [0.06, 0.03, 0.03], "cells": [18, 9, 6]}},
    young_pa=1e4,
    poisson=0.4,
    density_kg_m3=1000,
    rayleigh={"mass_1_s": 2, "stiffness_s": 0.01},
)
scene.fix("flesh", where={"slab": {"axis": "x", "from": 0, "to": 0.02}})
scene.fix("flesh", where={"slab": {"axis": "x", "from": 0.98, "to": 1}}, displacement_m=[0.012, 0, 0])

# %% The blade goes along y, 15 mm deep. The simulation stands still between the orders, so nothing depends on timing.
blade = scindo.sweep([(0.0013, -0.04, 0.015), (0.0013, 0.04, 0.015)], heel=(0, 0, 0.03))
with scindo.serve(scene) as server, server.connect() as session:
    session.pause()
    session.reset()
    session.step(100)
    pending = session.begin_cut(blade, "flesh")
    session.step(100)
    cut = pending.result()
    print(f"{cut.elements} elements were cut")
    wound = session.body("flesh").wait(step=200, epoch=cut.epochs["flesh"])

# %% Faces of the wound have the number of the cut as their tag; their ends at the top are the lips.
lips = wound.positions[np.unique(wound.triangles[wound.tags > 0])]
upper = lips[lips[:, 2] > 0.028]
gap = upper[:, 0].max() - upper[:, 0].min()
print(f"the wound is {gap * 1e3:.1f} mm wide at the top")
assert cut.elements > 50 and gap > 0.002
