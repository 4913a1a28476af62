"""A session with a real server: mirror, tools, cuts, orders, and what goes wrong."""

import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from unittest import mock

import numpy as np
import scindo
from common import ACROSS, PATIENCE, ROOT, block, until
from google.protobuf import descriptor_pb2
from scindo.v1 import _files, server_pb2


class WithServer(unittest.TestCase):
    def setUp(self):
        self.server = self.enterContext2(scindo.serve(block()))
        self.session = self.enterContext2(self.server.connect(timeout=PATIENCE))

    def enterContext2(self, context):
        value = context.__enter__()
        self.addCleanup(context.__exit__, None, None, None)
        return value

    def refused(self, code):
        return _Refused(self, code)


class _Refused:
    """A block that ends with an error of this code, whose message ends with a next step."""

    def __init__(self, test, code):
        self.test, self.code = test, code

    def __enter__(self):
        return self

    def __exit__(self, kind, error, _):
        self.test.assertIsInstance(error, scindo.ScindoError)
        self.test.assertEqual(error.code, self.code, error)
        self.test.assertTrue(error.hint, error)
        self.test.assertIn(error.hint, str(error))
        return True


class Watching(WithServer):
    def test_the_messages_are_those_of_the_server(self):
        link = self.session.link
        reply = link.ask(link.keys.rpc("schema"), server_pb2.SchemaReply)
        theirs = descriptor_pb2.FileDescriptorSet.FromString(reply.file_descriptor_set)
        strip = lambda files: {f.name: f.SerializeToString(deterministic=True) for f in map(_without_extras, files)}
        self.assertEqual(strip(theirs.file), strip(_files.file))

    def test_scene_body_and_surface(self):
        info = self.session.info
        self.assertEqual(
            (info.scene, [b.id for b in info.bodies], self.session.tools), ("block", ["block"], {"finger": ""})
        )
        body = self.session.body("block")
        surface = body.surface
        self.assertEqual(surface.positions.shape[1:] + surface.triangles.shape[1:], (3, 3))
        self.assertLess(surface.triangles.max(), len(surface.positions))
        self.assertEqual(len(surface.rest_positions), len(surface.positions))
        edges = np.sort(surface.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        self.assertTrue((np.unique(edges, axis=0, return_counts=True)[1] == 2).all(), "the surface is closed")
        self.assertGreater(body.wait(step=surface.step + 5).step, surface.step)
        self.assertFalse(surface.positions.flags.writeable)
        self.assertEqual(body.von_mises().shape, (len(surface.positions),))
        measures = self.session.measures()
        self.assertLess(np.linalg.norm(measures.probes["top"] - measures.rest["top"]), 0.01)
        self.assertGreater(self.session.stats(wait=True).step_rate_hz, 0.0)
        with self.refused("unknown-body"):
            self.session.body("blok")
        self.assertFalse(info.bodies[0].textured)
        self.assertEqual(surface.texture_coordinates.shape, (0, 3, 2))
        with self.refused("no-texture"):
            _ = body.texture

    def test_an_image_on_the_skin(self):
        image = ROOT / "tests/browser/quarters.png"
        scene = scindo.Scene("textured", step_s=0.01)
        scene.add_body(
            "cube",
            mesh={"box": {"min_m": (0.0, 0.0, 0.0), "max_m": (0.1, 0.1, 0.1), "cells": [3, 3, 3]}},
            young_pa=4e4,
            poisson=0.4,
            density_kg_m3=1000.0,
            look={"texture": {"image": str(image), "repeat_m": 0.05}},
        )
        session = self.enterContext2(self.enterContext2(scindo.serve(scene)).connect(timeout=PATIENCE))
        self.assertTrue(session.info.bodies[0].textured)
        body = session.body("cube")
        self.assertEqual(body.texture, ("image/png", image.read_bytes()))
        surface = body.surface
        self.assertEqual(surface.texture_coordinates.shape, (len(surface.triangles), 3, 2))
        self.assertAlmostEqual(float(np.ptp(surface.texture_coordinates)), 2.0, places=5)

    def test_a_missed_epoch_is_made_good_by_the_keyframe(self):
        body = self.session.body("block")
        before = body.surface
        body.mirror._assembly.topology = lambda _: False
        asked = body.mirror.keyframes
        result = self.session.cut(ACROSS, timeout=PATIENCE)
        after = body.wait(epoch=result.epochs["block"], timeout=PATIENCE)
        self.assertGreater(len(after.positions), len(before.positions))
        self.assertGreater(body.mirror.keyframes, asked)

    def test_another_server_takes_the_place_of_the_first(self):
        body = self.session.body("block")
        self.session.cut(ACROSS, timeout=PATIENCE)
        until(lambda: body.surface.epoch == 1, "the cut is seen")
        self.server.close()
        second = self.enterContext2(scindo.serve(block(), arguments=["--listen", self.server.endpoint]))
        until(lambda: body.surface.epoch == 0, "the surface of the new server is seen")
        step = body.surface.step
        until(lambda: body.surface.step > step, "it moves on")
        self.assertTrue(second.running)


class Touching(WithServer):
    def test_a_tool_is_taken_felt_and_released(self):
        tool = self.session.tool("finger")
        for z in np.linspace(0.06, 0.038, 23):
            tool.move((0.06, 0.03, z))
        until(lambda: tool.force[2] > 0.1, "the finger is pushed up")
        until(lambda: self.session.forces().of("block", "finger")[2] < -0.1, "and pushes the block down")
        (force,) = self.session.body("block").forces
        self.assertEqual((force.on, force.by, force.kind), ("block", "finger", "tool"))
        if len(force.points) == force.contacts:
            np.testing.assert_allclose(force.point_forces.sum(axis=0), force.force, rtol=1e-4, atol=1e-6)
        self.assertEqual(self.session.tools["finger"], self.session.id)
        tool.release()
        self.assertFalse(tool.held)
        until(lambda: self.session.tools["finger"] == "", "the tool is free")
        until(lambda: len(self.session.forces()) == 0, "nothing touches any more")

    def test_two_sessions_share_two_tools(self):
        mine = self.session.tool("finger")
        brought = self.session.tool("guest", shape={"sphere": {"radius_m": 0.004}})
        mine.move((0.03, 0.03, 0.1))
        brought.move((0.09, 0.03, 0.1))
        other = self.enterContext2(self.server.connect(timeout=PATIENCE))
        with self.refused("not-owner"):
            other.tool("finger").move((0.0, 0.0, 0.2))
        mine.release()
        until(lambda: self.session.tools["finger"] == "", "one is free")
        until(lambda: self.session.tools.get("guest") == self.session.id, "the other is held on")
        other.tool("finger").move((0.0, 0.0, 0.2))
        self.assertEqual(self.session.tools["finger"], other.id)
        other.close()
        until(lambda: self.session.tools["finger"] == "", "a client that leaves loses its tool")

    def test_wrong_poses_are_not_sent(self):
        tool = self.session.tool("finger")
        for wrong in (
            dict(position=(0, 0)),
            dict(position=(0, 0, float("nan"))),
            dict(position=(0, 0, 2e4)),
            dict(position="here"),
            dict(position=(0, 0, 0), orientation=(0, 0, 0, 0)),
            dict(position=(0, 0, 0), mode="push"),
            dict(position=(0, 0, 0), closed=1.5),
            dict(position=(0, 0, 0), velocity=(1e9, 0, 0)),
        ):
            self.assertRaises(scindo.InvalidValue, tool.move, **wrong)
        with self.refused("unknown-tool"):
            self.session.tool("fingr")
        self.assertRaises(scindo.InvalidValue, self.session.tool, "guest", {"cube": {}})
        self.assertRaises(scindo.InvalidValue, self.session.tool, "guest", {"sphere": {"radius": 1}})
        self.assertEqual(self.session.stats(wait=True).refused, {})

    def test_grabbing_holds_and_letting_go_frees(self):
        tool = self.session.tool("finger")
        tool.move((0.06, 0.03, 0.0405))
        tool.move((0.06, 0.03, 0.0405), mode="grab")
        until(lambda: tool.state.held_point is not None, "tissue is held")
        tool.move((0.06, 0.03, 0.05), mode="grab")
        until(lambda: tool.force[2] < -0.1, "it pulls the hand back")
        tool.hover()
        until(lambda: tool.state.held_point is None, "nothing is held")


class Cutting(WithServer):
    def test_a_cut_is_made_once_however_often_it_is_sent(self):
        pending = self.session.begin_cut(ACROSS, "block")
        for _ in range(5):
            pending._cutter.send(pending._command)
        result = pending.result(PATIENCE)
        self.assertGreater(result.elements, 50)
        self.assertEqual(pending.result(0.0), result)
        self.session.body("block").wait(epoch=result.epochs["block"], timeout=PATIENCE)
        until(lambda: self.session.stats(wait=True).cuts_applied > 0, "the cut is counted")
        self.assertEqual(self.session.stats(wait=True).cuts_applied, 1)
        until(lambda: any(event.name == "cut-answered" for event in self.session.events), "the event came")
        self.session.undo()
        self.session.body("block").wait(epoch=result.epochs["block"] + 1, timeout=PATIENCE)

    def test_refusals_say_why(self):
        with self.refused("unknown-body"):
            self.session.cut(ACROSS, "blok", timeout=PATIENCE)
        with self.refused("bad-sweep"):
            self.session.cut(np.zeros((1, 2, 3)))
        with self.refused("bad-sweep"):
            self.session.cut(np.zeros((1025, 2, 3)))
        with self.refused("out-of-range"):
            self.session.cut(np.full((2, 2, 3), np.inf))
        self.session.tool("finger").move((0.0, 0.0, 0.2))
        with self.enterContext2(self.server.connect(timeout=PATIENCE)) as other, self.refused("not-owner"):
            other.cut(ACROSS, tool="finger", timeout=PATIENCE)

    def test_a_paused_simulation_answers_after_a_step(self):
        self.session.pause()
        pending = self.session.begin_cut(ACROSS)
        with self.refused("timeout"):
            pending.result(0.5)
        self.session.step()
        self.assertGreater(pending.result(PATIENCE).elements, 50)


class People(WithServer):
    def test_others_read_who_holds_a_tool(self):
        with self.enterContext2(self.server.connect(timeout=PATIENCE, client="anna", person="Änne O'Neill")) as other:
            other.tool("finger").move((0.0, 0.0, 0.2))
            until(lambda: "finger" in self.session.stats(wait=True).holders, "the name came")
            stats = self.session.stats(wait=True)
            self.assertEqual(stats.holders["finger"], "Änne O'Neill")
            self.assertEqual(stats.clients["anna"], "client")
        for bad in ["x" * 33, "a\nb"]:
            with self.assertRaises(scindo.InvalidValue):
                self.server.connect(timeout=PATIENCE, person=bad)
        until(lambda: "anna" not in self.session.stats(wait=True).clients, "who left is not listed")


class Orders(WithServer):
    def test_pause_step_reset_set(self):
        with self.refused("not-paused"):
            self.session.step()
        self.session.pause()
        body = self.session.body("block")
        self.session.reset()
        until(lambda: body.surface.step == 0, "back at the start")
        self.session.step()
        self.session.step(6)
        until(lambda: body.surface.step == 7, "seven steps")
        # More than the server answers in one go, so the answer is "still running".
        self.session.step(2500)
        until(lambda: body.surface.step == 2507, "2500 steps more")
        self.session.set("body.block.young_pa", 2e4)
        self.session.set("world.gravity_m_s2", (0.0, 0.0, -5.0))
        params = self.session.params
        self.assertEqual(float(params["body.block.young_pa"].value), 2e4)
        self.assertEqual(params["world.gravity_m_s2"].value, "[0.0, 0.0, -5.0]")
        with self.refused("cannot-set"):
            self.session.set("body.block.young_pa", -1.0)
        with self.refused("cannot-undo"):
            self.session.undo()
        self.session.resume()
        until(lambda: body.surface.step > 2507, "it runs on")

    def test_a_kept_state_comes_back_with_its_cuts(self):
        self.session.pause()
        body = self.session.body("block")
        self.session.reset()
        self.session.step(3)
        self.session.snapshot("whole")
        whole = len(body.wait(timeout=PATIENCE).triangles)
        pending = self.session.begin_cut(ACROSS)
        self.session.step(2)
        epoch = pending.result(PATIENCE).epochs["block"]
        self.assertGreater(len(body.wait(epoch=epoch, timeout=PATIENCE).triangles), whole)
        self.session.restore("whole")
        until(lambda: body.surface.step == 3, "back at step 3")
        self.assertEqual(len(body.wait(epoch=epoch + 1, timeout=PATIENCE).triangles), whole)
        with self.refused("cannot-restore"):
            self.session.restore("wohle")
        with self.refused("out-of-range"):
            self.session.snapshot("Not a name")
        self.session.resume()

    def test_a_recording_and_a_state_in_a_file(self):
        with tempfile.TemporaryDirectory() as folder:
            state = Path(folder) / "state.mcap"
            size = self.session.save_state(state)
            self.assertEqual(state.stat().st_size, size)
            self.assertEqual(state.read_bytes()[1:5], b"MCAP")
        # The server of these tests has no folder for recordings.
        with self.refused("cannot-record"):
            self.session.record()

    def test_another_scene(self):
        self.assertIn("kidney", self.session.scenes)
        with self.refused("unknown-scene"):
            self.session.load("kidny")
        self.session.load("vessel", timeout=PATIENCE)
        self.assertNotIn("block", self.session.bodies)
        self.assertGreater(len(next(iter(self.session.bodies.values())).wait(timeout=PATIENCE).positions), 100)


class Connections(WithServer):
    def test_nobody_there(self):
        with self.refused("unreachable"):
            scindo.connect("tcp/127.0.0.1:9", timeout=0.5)
        with self.refused("timeout"):
            self.server.connect(session="another", timeout=0.5)
        with self.refused("bad-key"):
            self.server.connect(client="A B")
        with mock.patch("scindo.session.WIRE_VERSION", 2), self.refused("wire-version"):
            self.server.connect()
        # A client whose keys are of another version as well: the server itself says what is wrong.
        for version in (0, 2):
            with mock.patch("scindo.keys.WIRE_VERSION", version), self.refused("wire-version"):
                self.server.connect()
        with self.assertRaisesRegex(scindo.InvalidValue, "no-such.json5"):
            scindo.connect(zenoh_config="no-such.json5")

    def test_a_closed_session_says_so(self):
        other = self.server.connect()
        body = other.body("block")
        body.surface
        other.close()
        other.close()
        for use in (lambda: other.info, lambda: body.surface, other.pause, other.forces, lambda: other.cut(ACROSS)):
            with self.refused("closed"):
                use()

    def test_a_script_that_leaves_its_session_open_ends(self):
        script = (
            "import sys, scindo\n"
            "session = scindo.connect(sys.argv[1], timeout=60.0)\n"
            "print(len(session.body('block').surface.triangles))\n"
        )
        done = subprocess.run(
            [sys.executable, "-c", script, self.session.link.endpoint], capture_output=True, text=True, timeout=PATIENCE
        )
        self.assertEqual((done.returncode, done.stdout), (0, f"{len(self.session.body('block').surface.triangles)}\n"))

    def test_a_forked_session_says_so(self):
        child = os.fork()
        if child == 0:
            try:
                self.session.info
            except scindo.Closed as error:
                os._exit(0 if error.code == "forked" else 1)
            finally:
                os._exit(2)
        self.assertEqual(os.waitpid(child, 0)[1], 0)
        self.assertEqual(self.session.info.scene, "block")


def _without_extras(file):
    """A descriptor without what compilers differ in."""
    copy = descriptor_pb2.FileDescriptorProto()
    copy.CopyFrom(file)
    copy.ClearField("source_code_info")
    for field in (f for m in _all(copy.message_type) for f in m.field):
        field.ClearField("json_name")
    return copy


def _all(messages):
    for message in messages:
        yield message
        yield from _all(message.nested_type)


if __name__ == "__main__":
    unittest.main()
