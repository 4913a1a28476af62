"""Runs of the program, and its results as arrays."""

import os
import pathlib
import subprocess
import tempfile
import unittest
from unittest import mock

import numpy as np
import scindo
from common import ACROSS, ROOT, block
from scindo.program import find_program


class Runs(unittest.TestCase):
    def test_arrays_of_a_run(self):
        scene = block().add_cut("block", sweep_m=ACROSS, at_s=0.05)
        with tempfile.TemporaryDirectory() as folder:
            results = scindo.run(scene, steps=20, out=folder)
            self.assertEqual((results.status, results.summary["steps"]), ("done", 20))
            again = scindo.Results.read(folder)
        np.testing.assert_array_equal(results.points, again.points)
        probe = results.probes["top"]
        self.assertEqual(probe.position.shape, (21, 3))
        np.testing.assert_allclose(probe.position - probe.displacement, np.tile((0.06, 0.03, 0.039), (21, 1)))
        np.testing.assert_allclose(np.diff(probe.time_s), 0.01)
        solid = results.solid
        corners = solid.points[solid.cells]
        volumes = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6.0
        self.assertAlmostEqual(volumes.sum() / sum(b["volume_m3"] for b in results.summary["bodies"]), 1.0, 6)
        self.assertEqual(solid.cell_data["cauchy_stress_pa"].shape, (len(solid.cells), 6))
        moved = solid.point_data["rest_position_m"] + solid.point_data["displacement_m"]
        np.testing.assert_allclose(moved, solid.points, rtol=0, atol=1e-12)
        self.assertEqual(set(results.surface.cell_data["cut_tag"].tolist()), {0, 1})
        self.assertEqual(results.contacts, {})

    def test_contacts_and_overrides(self):
        path = [
            {"at_s": 0.0, "tip_m": [0.06, 0.03, 0.05], "mode": "touch"},
            {"at_s": 0.1, "tip_m": [0.06, 0.03, 0.04], "mode": "touch"},
        ]
        scene = block().add_tool("script", shape={"sphere": {"radius_m": 0.005}}, stiffness_n_m=300.0, path=path)
        soft, stiff = (scindo.run(scene, seconds=0.3, set={"body.block.young_pa": young}) for young in (1e4, 1e5))
        contact = soft.contacts["script", ""]
        self.assertGreater(contact.force[-1, 2], 0.0)
        self.assertLess(contact.normal[-1], stiff.contacts["script", ""].normal[-1])
        self.assertFalse(soft.folder.exists(), "without a folder nothing is left")

    def test_force_over_displacement(self):
        scene = ROOT / "server/world/scenes/tensile-test.toml"
        results = scindo.run(scene, seconds=1.0)
        left, right = (results.reactions["strip", fix] for fix in (0, 1))
        np.testing.assert_allclose(right.displacement_share, np.linspace(0.05, 1.0, 20))
        np.testing.assert_allclose(left.force, -right.force, rtol=0, atol=1e-4)
        self.assertTrue((np.diff(right.force[:, 0]) > 0.0).all())

    def test_failures(self):
        scene = block()
        self.assertRaises(scindo.InvalidValue, scindo.run, scene)
        self.assertRaises(FileNotFoundError, scindo.run, "no-such-scene.toml", steps=1)
        self.assertRaises(scindo.InvalidValue, scindo.Results.read, "/")
        with self.assertRaisesRegex(scindo.RunFailed, "blok") as caught:
            scindo.run(scene, steps=1, set={"body.blok.poisson": 0.3})
        self.assertEqual(caught.exception.exit_code, 2)
        with self.assertRaisesRegex(scindo.RunFailed, "longer than"):
            scindo.run(scene, steps=1_000_000, timeout=1.0)
        with self.assertRaises(scindo.RunFailed):
            scindo.serve(scene, set={"body.blok.poisson": 0.3})
        missing = {"SCINDO_BIN": "", "PATH": "/nowhere"}
        with mock.patch.dict(os.environ, missing), self.assertRaisesRegex(scindo.ProgramNotFound, "SCINDO_BIN"):
            scindo.run(scene, steps=1)
        with mock.patch.dict(os.environ, {"SCINDO_BIN": "/nowhere"}), self.assertRaises(scindo.ProgramNotFound):
            scindo.run(scene, steps=1)


class Versions(unittest.TestCase):
    def test_package_and_program_are_of_one_version(self):
        said = subprocess.run([find_program(), "--version"], capture_output=True, text=True, check=True).stdout
        self.assertEqual(said.split()[1], scindo.__version__)
        self.assertIn(f'version = "{scindo.__version__}"', (ROOT / "Cargo.toml").read_text())

    def test_the_wheel_is_typed_and_whole(self):
        folder = pathlib.Path(scindo.__file__).parent
        for file in ("py.typed", "schema.json", "v1/messages.binpb", "v1/tool_pb2.pyi"):
            self.assertTrue((folder / file).is_file(), file)


if __name__ == "__main__":
    unittest.main()
