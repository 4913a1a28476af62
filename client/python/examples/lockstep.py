# %% [markdown]
# A loop in the manner of Gymnasium: a controller presses a ball on a block until it feels half a newton.
#
# The simulation makes its steps when the program asks for them, so a slow controller and a fast one see the same.

# %%
import numpy as np
import scindo

TARGET_N = 0.5

scene = scindo.Scene("lockstep", step_s=0.02)
scene.add_body(
    "block",
    mesh={"box": {"min_m": [0, 0, 0], "max_m": [0.1, 0.1, 0.04], "cells": [8, 8, 4]}},
    young_pa=2e4,
    poisson=0.4,
    density_kg_m3=1000,
    rayleigh={"stiffness_s": 0.02},
)
scene.fix("block", where={"slab": {"axis": "z", "from": 0, "to": 0}})
scene.add_tool("finger", shape={"sphere": {"radius_m": 0.01}}, stiffness_n_m=500, max_force_n=10)


def reward(seen, action):
    return -abs(seen["tool_force"][2] - TARGET_N)


# %% An integral controller: the ball goes down while the force is too small, and up while it is too large.
def episode(env):
    height, total = 0.055, 0.0
    seen, info = env.reset(options={"position": (0.05, 0.05, height)})
    while True:
        height += np.clip(4e-4 * (seen["tool_force"][2] - TARGET_N), -5e-4, 5e-4)
        seen, gain, terminated, truncated, info = env.step((0.05, 0.05, height))
        total += gain
        if terminated or truncated:
            return seen["tool_force"][2], total


# %% Two episodes are the same to the last bit.
with scindo.serve(scene) as server, server.connect() as session:
    env = scindo.Env(session, "finger", "block", steps=2, reward=reward, max_steps=120)
    first, second = episode(env), episode(env)
    env.close()
print(f"force {first[0]:.4f} N, reward {first[1]:.3f}")
assert first == second, (first, second)
assert abs(first[0] - TARGET_N) < 0.05, first
