"""A soft body of the session as numpy arrays."""

from __future__ import annotations

import time
from typing import List, Optional, Tuple

import numpy as np
from numpy.typing import NDArray

from ._host import Host
from ._mirror import Mirror, Surface
from ._newest import Newest
from .errors import TimedOut
from .forces import Force
from .v1 import server_pb2, surface_pb2


class Body:
    """One body. From the first use on, its surface is kept up to date in the background."""

    def __init__(self, session: Host, id: str) -> None:
        #: Name in the scene.
        self.id = id
        self._session = session
        self._mirror: Optional[Mirror] = None
        self._stress: Optional[Newest[Tuple[int, NDArray[np.float32]]]] = None

    def __repr__(self) -> str:
        return f"<scindo.Body {self.id!r}>"

    @property
    def surface(self) -> Surface:
        """The newest surface: positions and triangles of one step, which belong together."""
        return self.wait()

    @property
    def positions(self) -> NDArray[np.float32]:
        """Vertices of the newest surface, n × 3 [m]."""
        return self.surface.positions

    @property
    def triangles(self) -> NDArray[np.uint32]:
        """Triangles of the newest surface, m × 3. Take both from one ``surface`` while somebody cuts."""
        return self.surface.triangles

    @property
    def texture(self) -> Tuple[str, bytes]:
        """The image on its skin: ``image/png`` or ``image/jpeg``, and the file.

        Raises:
            Refused: the body has none; ``session.info`` says which bodies are textured.
        """
        link = self._session.link
        request = server_pb2.TextureRequest(body_id=self.id)
        reply = link.ask(link.keys.rpc("texture"), server_pb2.TextureReply, request, timeout=30.0)
        return reply.media_type, reply.image

    @property
    def forces(self) -> List[Force]:
        """What touches this body at present, and how."""
        return [force for force in self._session.forces() if force.on == self.id]

    def wait(self, step: Optional[int] = None, epoch: Optional[int] = None, timeout: Optional[float] = None) -> Surface:
        """The newest surface, once it is of this step or a later one, and of this epoch or a later one.

        Raises:
            TimedOut: there was none within ``timeout`` [s].
        """
        self._session.check()
        mirror = self.mirror
        patience = self._session.timeout if timeout is None else timeout

        def accepts(surface: Surface) -> bool:
            return (step is None or surface.step >= step) and (epoch is None or surface.epoch >= epoch)

        surface = mirror.newest.wait(min(patience, 1.0), accepts)
        if surface is None:
            # A frame may have been lost on its way, and a simulation that stands still sends no other.
            mirror.renew()
            surface = mirror.newest.wait(max(patience - 1.0, 1.0), accepts)
        if surface is None:
            raise TimedOut(
                f"body '{self.id}' has no surface{_wanted(step, epoch)} after {patience:g} s; "
                f"the newest is {_state(mirror)}",
                hint="A paused simulation goes on with session.step() or session.resume()",
                code="timeout",
            )
        return surface

    def wait_exactly(self, step: int, timeout: float, after: int = -1) -> Surface:
        """The surface of exactly this step, out of those that came after the first ``after`` ones."""
        self._session.check()
        mirror, end = self.mirror, time.monotonic() + timeout
        while time.monotonic() < end:
            surface = mirror.newest.wait(1.0, lambda s: s.step == step, after)
            if surface is not None:
                return surface
            mirror.renew()
        raise TimedOut(
            f"body '{self.id}' has no surface of step {step} after {timeout:g} s; the newest is {_state(mirror)}",
            hint="Nobody else may step, reset or resume the simulation meanwhile",
            code="timeout",
        )

    def von_mises(self, timeout: Optional[float] = None) -> NDArray[np.float32]:
        """Von Mises stress [Pa] at each vertex of the newest surface. The server computes it from the first call
        on."""
        self._session.check()
        if self._stress is None:
            stress = self._stress = Newest()
            key = self._session.link.keys.field(self.id, "von-mises")

            def on_field(message: surface_pb2.SurfaceField) -> None:
                values = np.frombuffer(message.values, "<f4")
                if len(values) == message.vertex_count:
                    stress.put((message.epoch, values))

            self._session.link.subscribe(key, surface_pb2.SurfaceField, on_field)
        patience = self._session.timeout if timeout is None else timeout
        epoch = self.surface.epoch
        newest = self._stress.wait(patience, lambda value: value[0] >= epoch)
        if newest is None:
            raise TimedOut(
                f"the stress of body '{self.id}' did not come within {patience:g} s",
                hint="It is sent after a step; a paused simulation makes none",
                code="timeout",
            )
        return newest[1]

    @property
    def mirror(self) -> Mirror:
        """What keeps the surface; for tests and measurements."""
        if self._mirror is None:
            self._mirror = Mirror(self._session.link, self.id)
        return self._mirror

    def _renew(self) -> None:
        if self._mirror is not None:
            self._mirror.renew()

    def _close(self) -> None:
        if self._mirror is not None:
            self._mirror.close()


def _wanted(step: Optional[int], epoch: Optional[int]) -> str:
    wanted = [f"{name} {value}" for name, value in (("step", step), ("epoch", epoch)) if value is not None]
    return f" of {' and '.join(wanted)}" if wanted else ""


def _state(mirror: Mirror) -> str:
    surface = mirror.newest.value
    return "none" if surface is None else f"of step {surface.step} and epoch {surface.epoch}"
