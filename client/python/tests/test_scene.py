"""The builder of scenes, and its checks against those of the program."""

import json
import pathlib
import subprocess
import tempfile
import unittest

import numpy as np
import scindo
from common import ROOT, block
from scindo import _schema
from scindo.program import find_program

SCENES = ROOT / "server/world/scenes"


class Schema(unittest.TestCase):
    def test_it_uses_only_words_that_are_checked(self):
        _schema.words(_schema.schema())
        with self.assertRaises(NotImplementedError):
            _schema.words({"properties": {"x": {"multipleOf": 2}}})

    def test_it_is_that_of_the_program(self):
        said = subprocess.run([find_program(), "check", "--schema"], capture_output=True, check=True)
        self.assertEqual(json.loads(said.stdout), _schema.schema())

    def test_every_shipped_scene_fits(self):
        files = sorted(SCENES.glob("*.toml"))
        self.assertGreater(len(files), 15)
        try:
            scindo.Scene.load(files[0])
        except scindo.SceneError as error:
            self.skipTest(str(error))
        for file in files:
            self.assertGreaterEqual(len(scindo.Scene.load(file).bodies), 1, file)


class Mistakes(unittest.TestCase):
    """What the builder refuses, the program refuses as well."""

    WRONG = [
        (lambda d: d["body"][0].update(yung_pa=1.0), "body[0]", "young_pa"),
        (lambda d: d["body"][0].update(poisson=0.6), "body[0].poisson", "0.4999"),
        (lambda d: d["body"][0].update(young_pa="soft"), "body[0].young_pa", "number"),
        (lambda d: d["body"][0].update(young_pa=True), "body[0].young_pa", "number"),
        (lambda d: d["body"][0].update(law="corotatonal"), "body[0].law", "corotational"),
        (lambda d: d["body"][0].update(id="Block!"), "body[0].id", "a-z"),
        (lambda d: d["body"][0].update(mesh={}), "body[0].mesh", "exactly one"),
        (lambda d: d["body"][0]["mesh"]["box"].update(cells=[2, 2]), "body[0].mesh.box.cells", "3"),
        (lambda d: d["body"][0].pop("id"), "body[0]", "'id' is missing"),
        (lambda d: d["world"].update(step_s=0.0), "world.step_s", "more than 0"),
        (lambda d: d.update(schema=2), "schema", "at most 1"),
        (lambda d: d.update(description=""), "description", "200"),
        (lambda d: d.update(description="two lines\n"), "description", "one plain sentence"),
        (lambda d: d.update(wrold={}), "", "world"),
        (lambda d: d["tool"][0].update(shape={"cube": {}}), "tool[0].shape", "cube"),
        (lambda d: d.update(cut=[{"body": "block", "path_m": [[0, 0, 0], [1, 0, 0]]}]), "cut[0]", "exactly one"),
    ]

    def test_builder_and_program_agree(self):
        for wrong, path, word in self.WRONG:
            data = block().to_dict()
            wrong(data)
            with self.assertRaises(scindo.SceneError) as caught:
                scindo.Scene.from_dict(data)
            self.assertEqual(caught.exception.path, path, caught.exception)
            self.assertIn(word, str(caught.exception))
            with tempfile.TemporaryDirectory() as folder:
                file = pathlib.Path(folder) / "scene.json"
                file.write_text(json.dumps(data))
                said = subprocess.run([find_program(), "check", file, "--no-solve"], capture_output=True, check=False)
            self.assertEqual(said.returncode, 2, f"{path}: {said.stderr!r}")

    def test_a_part_that_is_wrong_changes_nothing(self):
        scene = block()
        before = scene.to_dict()
        for attempt in (
            lambda: scene.add_body("block", mesh={"organ": {"shape": "liver"}}),
            lambda: scene.add_body("b", mesh={"organ": {"shape": "livr"}}),
            lambda: scene.set("body.block.poisson", 0.6),
            lambda: scene.set("body.blok.poisson", 0.3),
            lambda: scene.fix("blok", where={}),
            lambda: scene.fix("block", where={}),
        ):
            self.assertRaises(scindo.ScindoError, attempt)
            self.assertEqual(scene.to_dict(), before)
        self.assertEqual(scene.set("body.block.poisson", np.float64(0.3)).bodies[0]["poisson"], 0.3)

    def test_the_program_judges_what_the_schema_cannot(self):
        scene = block().add_cut("blok", sweep_m=[[[0, 0, 0], [0, 0, 1]], [[0, 1, 0], [0, 1, 1]]])
        scene.check(whole=False)
        with self.assertRaisesRegex(scindo.SceneError, "blok"):
            scene.check()
        block().check()


class Files(unittest.TestCase):
    def test_meshes_are_found_from_anywhere(self):
        with tempfile.TemporaryDirectory() as folder:
            scene = scindo.Scene()
            scene.folder = pathlib.Path(folder)
            scene.add_body("a", mesh={"surface": "a.obj"}, young_pa=1e4, poisson=0.3, density_kg_m3=1e3)
            file = scene.save(pathlib.Path(folder) / "scene.json")
            saved = json.loads(file.read_text())
            self.assertEqual(saved["body"][0]["mesh"]["surface"], str(pathlib.Path(folder).resolve() / "a.obj"))
            self.assertEqual(scindo.Scene.load(file).to_dict(), saved)
            self.assertRaises(scindo.SceneError, scene.save, pathlib.Path(folder) / "scene.toml")
            (pathlib.Path(folder) / "bad.json").write_text("{")
            self.assertRaises(scindo.SceneError, scindo.Scene.load, pathlib.Path(folder) / "bad.json")


if __name__ == "__main__":
    unittest.main()
