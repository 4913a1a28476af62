"""The rules by which a surface is put together from keyframes, topologies and frames.

A topology has an epoch, and every frame names the epoch that it belongs to. A frame that fits no known topology is a
gap: then the keyframe is asked for. What is shown is always whole, triangles and positions of one epoch.
"""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass, replace
from typing import Any, Optional

import numpy as np
from numpy.typing import NDArray

from ._link import Link
from ._newest import Newest
from .errors import Closed, Refused, TimedOut
from .v1 import surface_pb2

# Pause between two questions for the keyframe [s].
RETRY_S = 0.1


@dataclass(frozen=True)
class Surface:
    """Surface of a body at one step. The arrays are read-only, and later frames do not change them."""

    #: Number of the topology. It rises with every cut.
    epoch: int
    #: Steps since the start of the scene or its last reset.
    step: int
    #: Simulated time [s].
    time_s: float
    #: Vertices, n × 3 [m].
    positions: NDArray[np.float32]
    #: Numbers of the vertices of each triangle, m × 3, counter-clockwise seen from outside.
    triangles: NDArray[np.uint32]
    #: For each triangle 0 (skin) or the number of the cut whose face it is.
    tags: NDArray[np.uint32]
    #: Vertices at rest, n × 3 [m]; empty if the server does not send them.
    rest_positions: NDArray[np.float32]
    #: Places on the image of the skin, for the three corners of every triangle with tag 0, in order: k × 3 × 2; empty for a
    #: body without a texture.
    texture_coordinates: NDArray[np.float32]
    #: Number of the frame, which rises while one server runs.
    seq: int


def to_surface(topology: surface_pb2.SurfaceTopology, frame: surface_pb2.SurfaceFrame) -> Optional[Surface]:
    """Both as arrays; ``None`` if they do not fit together."""
    n, m = topology.vertex_count, topology.triangle_count
    sizes = (len(frame.positions), len(topology.triangles), len(topology.tags))
    if topology.epoch != frame.epoch or frame.vertex_count != n or sizes != (12 * n, 12 * m, 4 * m):
        return None
    triangles = np.frombuffer(topology.triangles, "<u4").reshape(-1, 3)
    positions = np.frombuffer(frame.positions, "<f4").reshape(-1, 3)
    if (m and int(triangles.max()) >= n) or not np.isfinite(positions).all():
        return None
    rest = np.frombuffer(topology.rest_positions if len(topology.rest_positions) == 12 * n else b"", "<f4")
    tags = np.frombuffer(topology.tags, "<u4")
    fits = len(topology.texture_coordinates) == 24 * int((tags == 0).sum())
    image = np.frombuffer(topology.texture_coordinates if fits else b"", "<f4").reshape(-1, 3, 2)
    arrays = (positions, triangles, tags, rest.reshape(-1, 3), image)
    return Surface(topology.epoch, frame.sim_step, frame.sim_time_s, *arrays, frame.seq)


class Assembly:
    """Applies messages. Each method returns whether the keyframe is needed."""

    def __init__(self) -> None:
        self.surface: Optional[Surface] = None
        self._pending: Optional[surface_pb2.SurfaceTopology] = None

    def keyframe(self, message: surface_pb2.SurfaceKeyframe) -> bool:
        """The present state of the server, which always replaces the surface."""
        surface = to_surface(message.topology, message.frame)
        if surface is None:
            return True
        self._pending, self.surface = None, surface
        return False

    def topology(self, message: surface_pb2.SurfaceTopology) -> bool:
        """A newer topology, which waits for its first frame."""
        if self.surface is None or message.epoch > self.surface.epoch:
            self._pending = message
        return False

    def frame(self, message: surface_pb2.SurfaceFrame) -> bool:
        """Positions, which move the surface of their epoch."""
        if self._pending is not None and self._pending.epoch == message.epoch:
            whole = to_surface(self._pending, message)
            if whole is not None:
                self._pending, self.surface = None, whole
                return False
        held = self.surface
        if held is None or held.epoch != message.epoch or len(held.positions) != message.vertex_count:
            return True
        if message.sim_step < held.step and message.seq < held.seq:
            return False
        if len(message.positions) != 12 * message.vertex_count:
            return True
        positions = np.frombuffer(message.positions, "<f4")
        if not np.isfinite(positions).all():
            return True
        self.surface = replace(
            held,
            step=message.sim_step,
            time_s=message.sim_time_s,
            positions=positions.reshape(-1, 3),
            seq=message.seq,
        )
        return False


class Mirror:
    """Follows the surface of one body from the first use on, and asks for the keyframe whenever one is needed."""

    def __init__(self, link: Link, body: str) -> None:
        self.newest: Newest[Surface] = Newest()
        self.keyframes = 0
        self._link, self._key = link, link.keys.keyframe(body)
        self._assembly, self._lock = Assembly(), threading.Lock()
        self._gap, self._ended = threading.Event(), False
        self._gap.set()
        self._subscribers = [
            link.subscribe(link.keys.topology(body), surface_pb2.SurfaceTopology, lambda m: self._apply(m, "topology")),
            link.subscribe(link.keys.frame(body), surface_pb2.SurfaceFrame, lambda m: self._apply(m, "frame")),
        ]
        threading.Thread(target=self._ask, name=f"scindo-mirror-{body}", daemon=True).start()

    def renew(self) -> None:
        """Asks for the keyframe, because the server is another one or frames stay away."""
        self._gap.set()

    def close(self) -> None:
        """Ends the thread and the subscriptions."""
        self._ended = True
        self._gap.set()
        for subscriber in self._subscribers:
            self._link.unsubscribe(subscriber)

    def _apply(self, message: Any, kind: str) -> None:
        with self._lock:
            before = self._assembly.surface
            gap = getattr(self._assembly, kind)(message)
            surface = self._assembly.surface
        if surface is not None and surface is not before:
            self.newest.put(surface)
        if gap:
            self._gap.set()

    def _ask(self) -> None:
        while True:
            self._gap.wait()
            if self._ended:
                return
            self._gap.clear()
            try:
                keyframe = self._link.ask(self._key, surface_pb2.SurfaceKeyframe, timeout=1.0)
            except Closed:
                return
            except (TimedOut, Refused):
                self._gap.set()
            except Exception:
                # The session is being closed under the question; whoever reads the mirror is told.
                if self._ended or self._link.closed:
                    return
                self._gap.set()
            else:
                self.keyframes += 1
                self._apply(keyframe, "keyframe")
            time.sleep(RETRY_S)
