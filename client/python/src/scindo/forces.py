"""Forces of contact: what touches each body, and where."""

from __future__ import annotations

from dataclasses import dataclass
from typing import List, Sequence, Union, overload

import numpy as np

from .v1 import force_pb2
from .values import Array, from_vec3

_KINDS = {
    force_pb2.ForcePair.KIND_TOOL: "tool",
    force_pb2.ForcePair.KIND_OBSTACLE: "obstacle",
    force_pb2.ForcePair.KIND_BODY: "body",
    force_pb2.ForcePair.KIND_SELF: "self",
}


@dataclass(frozen=True)
class Force:
    """Contact of a body with one other thing."""

    #: The body that is pushed.
    on: str
    #: The tool, obstacle or body that pushes it.
    by: str
    #: What ``by`` is: ``tool``, ``obstacle``, ``body`` or ``self``.
    kind: str
    #: Sum of the forces on the body [N]; ``by`` feels the opposite.
    force: Array
    #: Sum of the normal forces [N].
    normal: float
    #: Largest depth [m].
    deepest: float
    #: Number of points in contact. At most 32 of them are in the arrays below, those with the largest forces.
    contacts: int
    #: Points of contact, n × 3 [m].
    points: Array
    #: Force at each of them, normal and friction together, n × 3 [N].
    point_forces: Array

    @property
    def size(self) -> float:
        """Length of the force [N]."""
        return float(np.linalg.norm(self.force))


class Forces(Sequence[Force]):
    """All forces of contact after one step."""

    def __init__(self, message: force_pb2.Forces) -> None:
        #: Step and simulated time [s] that they belong to.
        self.step, self.time_s = message.sim_step, message.sim_time_s
        self._forces: List[Force] = [_to_force(pair) for pair in message.pairs]

    def __len__(self) -> int:
        return len(self._forces)

    @overload
    def __getitem__(self, index: int) -> Force: ...
    @overload
    def __getitem__(self, index: slice) -> List[Force]: ...
    def __getitem__(self, index: Union[int, slice]) -> Union[Force, List[Force]]:
        return self._forces[index]

    def __repr__(self) -> str:
        pairs = ", ".join(f"{f.by} on {f.on}: {f.size:.3g} N" for f in self)
        return f"<scindo.Forces at {self.time_s:.3f} s: {pairs or 'nothing touches'}>"

    def of(self, on: str, by: str) -> Array:
        """Force of ``by`` on the body ``on`` [N]; zero if they do not touch."""
        found = [force.force for force in self if (force.on, force.by) == (on, by)]
        return np.sum(found, axis=0) if found else np.zeros(3)


def _to_force(pair: force_pb2.ForcePair) -> Force:
    normals = np.array([from_vec3(p.normal) * p.normal_n for p in pair.points]).reshape(-1, 3)
    across = np.array([from_vec3(p.tangential_n) for p in pair.points]).reshape(-1, 3)
    return Force(
        on=pair.on,
        by=pair.by,
        kind=_KINDS.get(pair.kind, "unknown"),
        force=from_vec3(pair.force_n),
        normal=pair.normal_n,
        deepest=pair.deepest_m,
        contacts=pair.contacts,
        points=np.array([from_vec3(p.point_m) for p in pair.points]).reshape(-1, 3),
        point_forces=normals + across,
    )
