"""Cuts: a blade swept through a body, applied exactly once."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from typing import Any, Dict, Sequence, Union

import numpy as np
from numpy.typing import NDArray

from ._host import Host
from ._link import sentence
from ._newest import Newest
from .errors import InvalidValue, Refused, TimedOut
from .v1 import cut_pb2
from .values import MAX_COORDINATE_M, Array, Vector, put_vec3, vector

#: Positions [tip, heel] of the blade, n × 2 × 3 [m].
Sweep = Union[NDArray[Any], Sequence[Any]]

MIN_SEGMENTS, MAX_SEGMENTS = 2, 1024
# Pause before a cut without an answer is sent again [s]. The server applies it once.
RESEND_S = 0.2


@dataclass(frozen=True)
class CutResult:
    """What a cut did."""

    #: Number of the cut.
    seq: int
    #: Elements that were cut.
    elements: int
    #: Epochs of the bodies after the cut, by their names: ``body.wait(epoch=…)`` gives the surface with the cut.
    epochs: Dict[str, int]


def sweep(path: Union[NDArray[Any], Sequence[Vector]], heel: Vector) -> Array:
    """A blade that is moved along ``path``, n × 3 points of its tip [m], with its heel at ``tip + heel`` [m]."""
    tips = np.array([vector(f"path[{i}]", tip) for i, tip in enumerate(path)]).reshape(-1, 3)
    return check_sweep(np.stack([tips, tips + vector("heel", heel)], axis=1))


def check_sweep(value: Sweep) -> Array:
    """``value`` as an array of n × 2 × 3 that the server takes."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise InvalidValue("the sweep is no array of numbers", hint="Give n pairs [tip, heel] of points [m]") from None
    if array.ndim != 3 or array.shape[1:] != (2, 3) or not MIN_SEGMENTS <= len(array) <= MAX_SEGMENTS:
        raise InvalidValue(
            f"the sweep has the shape {array.shape}",
            hint=f"Give {MIN_SEGMENTS} to {MAX_SEGMENTS} pairs [tip, heel] of points [m]: "
            "scindo.sweep(path, heel) makes them",
            code="bad-sweep",
        )
    if not np.isfinite(array).all() or np.abs(array).max() > MAX_COORDINATE_M:
        raise InvalidValue(
            "the sweep has a coordinate that is not finite or too large",
            hint=f"Every coordinate lies in ±{MAX_COORDINATE_M:g} m",
            code="out-of-range",
        )
    return array


class PendingCut:
    """A cut on its way. ``result()`` waits for its answer."""

    def __init__(self, cutter: Cutter, command: cut_pb2.CutCommand) -> None:
        self._cutter, self._command = cutter, command
        self._answer: Newest[cut_pb2.CutAck] = Newest()

    @property
    def seq(self) -> int:
        """Number of the cut."""
        return self._command.seq

    @property
    def done(self) -> bool:
        """Whether the answer is there."""
        return self._answer.value is not None

    def result(self, timeout: float = 5.0) -> CutResult:
        """The answer. The command is sent again while none comes; the server applies it once.

        Raises:
            Refused: the server did not make the cut; ``code`` and message say why.
            TimedOut: no answer came. It may still come: ``result()`` can be called again.
        """
        end = time.monotonic() + timeout
        while True:
            left = end - time.monotonic()
            ack = self._answer.wait(max(0.0, min(RESEND_S, left)))
            if ack is not None:
                return _to_result(ack)
            if left <= 0.0:
                raise TimedOut(
                    f"cut {self.seq} was not answered within {timeout:g} s",
                    hint="A paused simulation answers after the next step: session.step(). Calling result() again waits, "
                    "and a cut is never made twice",
                    code="timeout",
                )
            self._cutter.send(self._command)


class Cutter:
    """Numbers and sends the cuts of one tool, and sorts their answers."""

    def __init__(self, session: Host, tool: str) -> None:
        self._session, self._tool = session, tool
        self._lock = threading.Lock()
        self._waiting: Dict[int, PendingCut] = {}
        # A program that is started again with its old name must not repeat old numbers.
        self._seq = time.time_ns() // 1_000_000
        session.link.subscribe(session.link.keys.cut_ack(tool), cut_pb2.CutAck, self._on_ack, haptic=True)

    def begin(self, sweep: Array, body: str) -> PendingCut:
        """Sends a new cut."""
        command = cut_pb2.CutCommand(
            client_id=self._session.id, tool_id=self._tool, client_time_ns=time.time_ns(), body_id=body
        )
        for tip, heel in sweep:
            segment = command.sweep.add()
            put_vec3(segment.tip_m, tip)
            put_vec3(segment.heel_m, heel)
        with self._lock:
            self._seq += 1
            command.seq = self._seq
            pending = self._waiting[self._seq] = PendingCut(self, command)
        self.send(command)
        return pending

    def send(self, command: cut_pb2.CutCommand) -> None:
        """Sends a command, perhaps again."""
        self._session.link.put(self._session.link.keys.cut(self._session.id, self._tool), command)

    def _on_ack(self, ack: cut_pb2.CutAck) -> None:
        # A cut can overtake the token of its client, and is then sent again.
        if ack.client_id != self._session.id or ack.error.code == "no-token":
            return
        with self._lock:
            pending = self._waiting.pop(ack.seq, None)
        if pending is not None:
            pending._answer.put(ack)


def _to_result(ack: cut_pb2.CutAck) -> CutResult:
    if ack.outcome == cut_pb2.CutAck.OUTCOME_REFUSED:
        raise Refused(f"cut {ack.seq}: {ack.error.message}", hint=sentence(ack.error.hint), code=ack.error.code)
    return CutResult(ack.seq, ack.elements_cut, {epoch.body_id: epoch.epoch for epoch in ack.epochs})
