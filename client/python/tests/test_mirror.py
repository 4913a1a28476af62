"""The rules of epochs, without a network."""

import unittest

import numpy as np
from scindo._mirror import Assembly
from scindo.v1 import surface_pb2


def topology(epoch, vertices):
    triangles = np.arange(3, dtype="<u4") % vertices
    return surface_pb2.SurfaceTopology(
        epoch=epoch, vertex_count=vertices, triangle_count=1, triangles=triangles.tobytes(), tags=bytes(4)
    )


def frame(epoch, vertices, step):
    positions = np.full((vertices, 3), step, "<f4").tobytes()
    return surface_pb2.SurfaceFrame(epoch=epoch, vertex_count=vertices, sim_step=step, seq=step, positions=positions)


def keyframe(epoch, vertices, step):
    return surface_pb2.SurfaceKeyframe(topology=topology(epoch, vertices), frame=frame(epoch, vertices, step))


class Rules(unittest.TestCase):
    def setUp(self):
        self.assembly = Assembly()

    def test_a_frame_before_the_keyframe_is_a_gap(self):
        self.assertTrue(self.assembly.frame(frame(0, 4, 1)))
        self.assertFalse(self.assembly.keyframe(keyframe(0, 4, 1)))
        self.assertFalse(self.assembly.frame(frame(0, 4, 3)))
        self.assertFalse(self.assembly.frame(frame(0, 4, 2)), "an old frame is no gap")
        self.assertEqual(self.assembly.surface.step, 3)

    def test_a_surface_is_shown_only_whole(self):
        self.assembly.keyframe(keyframe(0, 4, 1))
        self.assertFalse(self.assembly.topology(topology(1, 6)))
        self.assertEqual((self.assembly.surface.epoch, len(self.assembly.surface.positions)), (0, 4))
        self.assertFalse(self.assembly.frame(frame(1, 6, 2)))
        self.assertEqual((self.assembly.surface.epoch, len(self.assembly.surface.positions)), (1, 6))

    def test_a_lost_topology_is_a_gap_until_the_keyframe(self):
        self.assembly.keyframe(keyframe(0, 4, 1))
        self.assertTrue(self.assembly.frame(frame(2, 8, 5)))
        self.assertFalse(self.assembly.keyframe(keyframe(2, 8, 6)))
        self.assertFalse(self.assembly.topology(topology(1, 6)), "an old topology is dropped")
        self.assertFalse(self.assembly.frame(frame(2, 8, 7)))

    def test_another_server_begins_again(self):
        self.assembly.keyframe(keyframe(3, 9, 500))
        self.assertTrue(self.assembly.frame(frame(0, 4, 1)))
        self.assertFalse(self.assembly.keyframe(keyframe(0, 4, 2)))
        self.assertFalse(self.assembly.frame(frame(0, 4, 3)))

    def test_what_does_not_fit_together_is_a_gap(self):
        broken = keyframe(0, 4, 1)
        broken.topology.triangles = np.array([0, 1, 9], "<u4").tobytes()
        self.assertTrue(self.assembly.keyframe(broken), "a triangle of a vertex that does not exist")
        self.assembly.keyframe(keyframe(0, 4, 1))
        for positions in (bytes(5), np.full((4, 3), np.nan, "<f4").tobytes()):
            bad = frame(0, 4, 2)
            bad.positions = positions
            self.assertTrue(self.assembly.frame(bad))
        self.assertEqual(self.assembly.surface.step, 1)


if __name__ == "__main__":
    unittest.main()
