"""A tool in the hand of this program."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, Dict, Optional

import numpy as np
import zenoh

from ._host import Host
from ._newest import Newest
from .errors import InvalidValue, Refused, TimedOut
from .v1 import tool_pb2
from .values import Array, Vector, from_vec3, put_vec3, quaternion, vector

MODES: Dict[str, Any] = {
    "hover": tool_pb2.ToolSample.MODE_HOVER,
    "touch": tool_pb2.ToolSample.MODE_TOUCH,
    "grab": tool_pb2.ToolSample.MODE_GRAB,
    "cut": tool_pb2.ToolSample.MODE_CUT,
    "scalpel": tool_pb2.ToolSample.MODE_SCALPEL,
}
MAX_VELOCITY_M_S = 1.0e3


@dataclass(frozen=True)
class ToolState:
    """A tool as the server sees it after a step."""

    #: Steps since the start of the scene or its last reset, and simulated time [s].
    step: int
    time_s: float
    #: Position of the tool in the hand [m], and where the tissue allows it to be.
    position: Array
    allowed_position: Array
    #: Force of the tissue on the tool [N].
    force: Array
    #: ``hover``, ``touch``, ``grab``, ``cut`` or ``scalpel``.
    mode: str
    #: The client that holds it, ``script`` or nobody.
    owner: str
    #: How far the jaws of forceps are closed, 0 (open) to 1.
    closed: float
    #: Centre of the tissue in the grip [m]; ``None`` if nothing is held.
    held_point: Optional[Array]


class Tool:
    """Moves one tool of the scene, or one that this program brings.

    The first ``move`` takes the tool. The server keeps it for this program until ``release`` or the end of the
    session, even if the program dies.
    """

    def __init__(self, session: Host, id: str, shape: Optional[tool_pb2.ToolShape]) -> None:
        #: Name of the tool.
        self.id = id
        self._session, self._shape = session, shape
        self._held = False
        self._seq = 0
        self._sample: Optional[tool_pb2.ToolSample] = None
        self._states: Newest[ToolState] = Newest()
        self._key = session.link.keys.pose(session.id, id)
        session.link.subscribe(
            session.link.keys.tool_state(id), tool_pb2.ToolState, lambda m: self._states.put(_to_state(m))
        )

    def __repr__(self) -> str:
        return f"<scindo.Tool {self.id!r}, {'held' if self._held else 'not held'}>"

    def __enter__(self) -> Tool:
        return self

    def __exit__(self, *_: Any) -> None:
        if self._held and not self._session.link.closed:
            self.release()

    @property
    def held(self) -> bool:
        """Whether this program holds the tool."""
        return self._held

    def move(
        self,
        position: Vector,
        orientation: Vector = (0.0, 0.0, 0.0, 1.0),
        mode: str = "touch",
        *,
        closed: Optional[float] = None,
        velocity: Optional[Vector] = None,
    ) -> None:
        """Puts the tip of the tool at ``position`` [m]. A pose is a state: only the newest counts.

        Args:
            position: where the tip shall be.
            orientation: quaternion (x, y, z, w) from the axes of the tool to those of the world. The shaft points along
                +z of the tool.
            mode: ``hover`` (touches nothing), ``touch``, ``grab`` (holds the tissue nearest to the tip; forceps close),
                ``cut`` (a blade cuts along its path) or ``scalpel`` (cuts as deep as it is pressed).
            closed: how far the jaws of forceps are closed, 0 to 1.
            velocity: velocity of the tip [m/s].

        Raises:
            InvalidValue: a value that the server would refuse.
            Refused: another client holds the tool (``not-owner``), or there is none of this name (``unknown-tool``).
        """
        sample = tool_pb2.ToolSample(client_id=self._session.id, tool_id=self.id, name=self._session.person)
        if mode not in MODES:
            raise InvalidValue(f"mode = {mode!r} of tool '{self.id}'", hint=f"Use one of {', '.join(MODES)}")
        sample.mode = MODES[mode]
        put_vec3(sample.pose.position_m, vector("position", position))
        turn = quaternion("orientation", orientation)
        sample.pose.qx, sample.pose.qy, sample.pose.qz, sample.pose.qw = (float(q) for q in turn)
        if velocity is not None:
            put_vec3(sample.velocity_m_s, vector("velocity", velocity, MAX_VELOCITY_M_S, "m/s"))
        if closed is not None:
            if not 0.0 <= closed <= 1.0:
                raise InvalidValue(
                    f"closed = {closed} of tool '{self.id}'", hint="Give a number from 0 (open) to 1 (closed)"
                )
            sample.closed = closed
        if self._shape is not None:
            sample.shape.CopyFrom(self._shape)
        self._session.check()
        self._refuse_if_lost()
        self._send(sample)
        if not self._held:
            self._take()

    def hover(self) -> None:
        """Lets go of what the tool touches, without moving it."""
        if self._sample is not None:
            self._sample.mode = MODES["hover"]
            self._send(self._sample)

    def release(self) -> None:
        """Gives the tool back, so that others may take it. It goes where its script wants it, or rests."""
        if self._held:
            self._held = False
            self._sample = None
            self._session._let_go(self)

    @property
    def state(self) -> ToolState:
        """The newest state, as the server publishes it."""
        return self.wait()

    @property
    def force(self) -> Array:
        """Force of the tissue on the tool [N], from the newest step."""
        return self.state.force

    @property
    def states(self) -> int:
        """How many states have come so far."""
        return self._states.count

    def wait(self, step: Optional[int] = None, timeout: Optional[float] = None, after: int = -1) -> ToolState:
        """The newest state, once it is of exactly this step, out of those that came after the first ``after`` ones."""
        patience = self._session.timeout if timeout is None else timeout
        self._session.check()
        state = self._states.wait(patience, lambda s: step is None or s.step == step, after)
        if state is None:
            wanted = "" if step is None else f" of step {step}"
            raise TimedOut(
                f"tool '{self.id}' has no state{wanted} after {patience:g} s",
                hint="A tool that this program brings appears after its first move and a step",
                code="timeout",
            )
        return state

    def _send(self, sample: tool_pb2.ToolSample) -> None:
        self._seq += 1
        sample.seq, sample.client_time_ns = self._seq, time.time_ns()
        self._sample = sample
        self._session.link.put(self._key, sample, zenoh.Priority.REAL_TIME)

    def _take(self) -> None:
        """Waits until the server says who holds the tool."""
        end = time.monotonic() + self._session.timeout
        while time.monotonic() < end:
            owner = self._owner()
            if owner == self._session.id:
                self._held = True
                return
            if owner not in ("", "script"):
                raise self._not_owner(owner)
            time.sleep(0.01)
        raise TimedOut(
            f"the server did not give tool '{self.id}' to this program within {self._session.timeout:g} s",
            hint="session.stats().refused counts messages that the server refused, by reason",
            code="timeout",
        )

    def _again(self) -> None:
        """Takes the tool again after the token of this program was renewed."""
        if self._held and self._sample is not None:
            self._send(self._sample)

    def _refuse_if_lost(self) -> None:
        state = self._states.value
        if not self._held or state is None or state.owner in ("", "script", self._session.id):
            return
        # The state may be older than the moment in which this program took the tool.
        owner = self._owner()
        if owner not in ("", "script", self._session.id):
            self._held = False
            raise self._not_owner(owner)

    def _owner(self) -> str:
        return next((tool.owner for tool in self._session.info.tools if tool.id == self.id), "")

    def _not_owner(self, owner: str) -> Refused:
        return Refused(
            f"tool '{self.id}' is held by '{owner}'",
            hint="Take another tool, or wait until it is free",
            code="not-owner",
        )


def _to_state(message: tool_pb2.ToolState) -> ToolState:
    names = {number: name for name, number in MODES.items()}
    held = from_vec3(message.held_point_m) if message.HasField("held_point_m") else None
    allowed = message.proxy_pose if message.HasField("proxy_pose") else message.pose
    return ToolState(
        step=message.sim_step,
        time_s=message.sim_time_s,
        position=from_vec3(message.pose.position_m),
        allowed_position=from_vec3(allowed.position_m),
        force=from_vec3(message.force_n),
        mode=names.get(message.mode, "hover"),
        owner=message.owner,
        closed=message.closed,
        held_point=held,
    )


_FIELDS = {
    "sphere": ("radius_m",),
    "capsule": ("radius_m", "length_m"),
    "blade": ("length_m", "thickness_m"),
    "forceps": ("radius_m", "length_m", "opening_m", "grip_force_n", "friction"),
    "retractor": ("radius_m", "length_m", "width_m", "height_m"),
    "hook": ("radius_m", "length_m", "reach_m", "point_m"),
}


def to_shape(shape: Dict[str, Dict[str, float]]) -> tool_pb2.ToolShape:
    """A shape as a scene writes it, such as ``{"sphere": {"radius_m": 0.005}}``, as a message."""
    if len(shape) != 1 or next(iter(shape)) not in _FIELDS:
        raise InvalidValue(
            f"shape = {shape!r}",
            hint=f"Give exactly one of {', '.join(_FIELDS)}, such as {{'sphere': {{'radius_m': 0.005}}}}",
        )
    ((kind, values),) = shape.items()
    wanted = _FIELDS[kind]
    if set(values) != set(wanted) or not all(np.isfinite(v) and v >= 0.0 for v in values.values()):
        raise InvalidValue(f"{kind} = {values!r}", hint=f"Give {', '.join(wanted)}, all finite and not negative")
    message = tool_pb2.ToolShape()
    part = getattr(message, kind)
    for name in wanted:
        setattr(part, name, float(values[name]))
    return message
