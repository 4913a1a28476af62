"""The scene that these tests touch and cut."""

import pathlib
import time

import scindo

ROOT = pathlib.Path(__file__).resolve().parents[3]
# Only a server that hangs makes anything take this long, however busy the machine is [s].
PATIENCE = 60.0
LOW, HIGH = (0.0, 0.0, 0.0), (0.12, 0.06, 0.04)
# Across the middle of the block, off the planes of its nodes.
ACROSS = scindo.sweep([(0.0613, -0.01, -0.01), (0.0617, 0.07, -0.01)], heel=(0.0, 0.0, 0.06))


def block() -> scindo.Scene:
    """A block on a table, a ball that a client may hold, and a probe on top."""
    scene = scindo.Scene("block", gravity=(0.0, 0.0, -9.81), step_s=0.01)
    scene.add_body(
        "block",
        mesh={"box": {"min_m": LOW, "max_m": HIGH, "cells": [12, 6, 4]}},
        young_pa=4e4,
        poisson=0.4,
        density_kg_m3=1000.0,
        rayleigh={"mass_1_s": 1.0, "stiffness_s": 0.01},
    )
    scene.fix("block", where={"slab": {"axis": "z", "from": 0.0, "to": 0.0}})
    scene.add_tool("finger", shape={"sphere": {"radius_m": 0.005}}, stiffness_n_m=300.0, max_force_n=5.0)
    scene.add_probe("top", "block", (0.06, 0.03, 0.039))
    return scene


def until(condition, claim):
    """Waits for a condition that other threads or programs bring about."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, f"not within {PATIENCE:.0f} s: {claim}"
        time.sleep(0.02)
