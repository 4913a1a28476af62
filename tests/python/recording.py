"""Opens a recording with the public readers, and its exports with those of VTK and glTF.

Records a run, then checks that the Python package `mcap` with `mcap-protobuf-support` decodes every message by the
descriptors in the file, that a killed server's file is read as far as it goes, that pyvista opens the series and
sees the cut, and that `pygltflib` reads the glTF and its accessors stay within their buffers and bounds.

    python tests/python/recording.py PROGRAM FOLDER
"""

import csv
import json
import math
import pathlib
import struct
import subprocess
import sys

import numpy as np
import pygltflib
import pyvista
from mcap.exceptions import McapError
from mcap.stream_reader import StreamReader
from mcap_protobuf.decoder import DecoderFactory
from mcap.reader import make_reader

STEPS = 80
SCENE = """
schema = 1
name = "pressed and cut"
world = { gravity_m_s2 = [0, 0, -9.81], step_s = 0.01 }
[[body]]
id = "block"
mesh = { box = { min_m = [0, 0, 0], max_m = [0.1, 0.1, 0.1], cells = [5, 5, 5] } }
young_pa = 2e4
poisson = 0.4
density_kg_m3 = 1000
rayleigh = { stiffness_s = 0.02 }
fix = [{ where = { slab = { axis = "z", from = 0, to = 0 } } }]
[[cut]]
body = "block"
at_s = 0.3
sweep_m = [[[0.05, -0.1, 0.04], [0.05, -0.1, 0.2]], [[0.05, 0.2, 0.04], [0.05, 0.2, 0.2]]]
[[tool]]
id = "finger"
shape = { sphere = { radius_m = 0.01 } }
path = [
  { at_s = 0.0, tip_m = [0.07, 0.05, 0.130], mode = "touch" },
  { at_s = 0.5, tip_m = [0.07, 0.05, 0.103] },
]
"""


def check(condition, claim):
    if not condition:
        raise AssertionError(f"not so: {claim}")


def read_recording(file):
    with open(file, "rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        counts = {}
        hashes = []
        force = 0.0
        for _, channel, _, message in reader.iter_decoded_messages():
            counts[channel.topic] = counts.get(channel.topic, 0) + 1
            if channel.topic == "record/scene":
                check(json.loads(message.json)["name"] == "pressed and cut", "the scene is in the file")
            if channel.topic == "record/step":
                check(message.number == len(hashes) + 1, "steps stand in their order")
                check(len(message.hash) == 16, "every step has its hash")
                hashes.append(message.hash)
            if channel.topic == "record/forces":
                force = max(force, message.tools[0].force_n.z)
        summary = reader.get_summary()
    print("messages:", counts)
    check(counts["record/step"] == STEPS and len(set(hashes)) == STEPS, "a step and a state each")
    check(counts["record/surface"] == STEPS and counts["record/forces"] == STEPS, "surfaces and forces")
    check(counts["record/checkpoint"] >= 2 and counts["record/event"] >= 1, "checkpoints and the cut")
    check(force > 0.05, f"the finger presses with {force} N")
    check(summary.statistics.message_count == sum(counts.values()), "the summary counts them")


def read_half(file, half):
    """The stream reader gives every complete chunk of a file without end."""
    half.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    records = 0
    try:
        with open(half, "rb") as stream:
            for _ in StreamReader(stream, record_size_limit=None).records:
                records += 1
    except (McapError, EOFError):
        pass
    check(records > 3, f"{records} records are read")


def read_series(folder):
    reader = pyvista.get_reader(str(folder / "series.pvd"))
    times = reader.time_values
    check(len(times) == 9 and abs(times[-1] - 0.01 * STEPS) < 1e-9, f"frames at {times}")
    points, volumes = [], []
    for time in times:
        reader.set_active_time_value(time)
        blocks = reader.read()
        solid = blocks[0]
        surface = blocks[1].extract_surface(algorithm=None) if blocks[1].n_cells else blocks[1]
        check(np.isfinite(solid.points).all(), "all points are finite")
        points.append(surface.n_points)
        volumes.append(solid.compute_cell_sizes()["Volume"].sum())
    check(points[-1] > points[0], f"the cut makes vertices: {points}")
    check(all(abs(v - 1e-3) < 1e-4 for v in volumes), f"the volume stays: {volumes}")


def read_gltf(file):
    gltf = pygltflib.GLTF2().load(str(file))
    blob = gltf.binary_blob()
    check(gltf.asset.version == "2.0" and gltf.buffers[0].byteLength == len(blob), "the buffer is complete")
    for accessor in gltf.accessors:
        view = gltf.bufferViews[accessor.bufferView]
        size = {"SCALAR": 1, "VEC3": 3}[accessor.type] * 4
        check(accessor.count * size == view.byteLength, "accessors fill their views")
        check(view.byteOffset % 4 == 0 and view.byteOffset + view.byteLength <= len(blob), "within the buffer")
    for mesh in gltf.meshes:
        primitive = mesh.primitives[0]
        accessor = gltf.accessors[primitive.attributes.POSITION]
        view = gltf.bufferViews[accessor.bufferView]
        x = np.frombuffer(blob, "<f4", 3 * accessor.count, view.byteOffset).reshape(-1, 3)
        check(np.allclose(x.min(0), accessor.min) and np.allclose(x.max(0), accessor.max), "bounds are right")
        indices = gltf.accessors[primitive.indices]
        offset = gltf.bufferViews[indices.bufferView].byteOffset
        check(max(struct.unpack_from(f"<{indices.count}I", blob, offset)) < accessor.count, "indices are right")
    frames = len(gltf.nodes)
    check(2 <= frames <= 50 and len(gltf.animations[0].channels) == frames, f"{frames} key frames")


def read_forces(file):
    with open(file, newline="") as stream:
        rows = list(csv.DictReader(stream))
    check(len(rows) == STEPS, "a row per step and tool")
    check(all(math.isfinite(float(row["fz_n"])) for row in rows), "forces are finite")
    check(max(float(row["fz_n"]) for row in rows) > 0.05, "the finger presses")


def main():
    program, folder = sys.argv[1], pathlib.Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    scene, file = folder / "recorded.toml", folder / "recorded.mcap"
    scene.write_text(SCENE)
    file.unlink(missing_ok=True)
    run = lambda *arguments: subprocess.run([program, *map(str, arguments)], check=True)  # noqa: E731
    run("run", scene, "--fast", "--steps", STEPS, "--record", file, "--record-surfaces", "--checkpoint-s", 0.05)
    run("replay", file, "--verify")
    series, glb, table = folder / "series", folder / "recorded.glb", folder / "recorded.csv"
    run("export", file, "--vtu", series, "--gltf", glb, "--csv", table)
    read_recording(file)
    read_half(file, folder / "half.mcap")
    read_series(series)
    read_gltf(glb)
    read_forces(table)
    print("recording, series, glTF and table are read")


if __name__ == "__main__":
    main()
