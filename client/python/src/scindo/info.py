"""What the server tells of itself: scene, parameters, statistics, measures, events."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, Tuple

import numpy as np

from .v1 import server_pb2
from .values import Array, from_vec3


@dataclass(frozen=True)
class BodyInfo:
    """A body as it was when the server was asked."""

    id: str
    #: Number of its topology, which rises with every cut.
    epoch: int
    elements: int
    nodes: int
    #: Corners of the box around it at the start [m].
    low: Array
    high: Array
    #: Whether its skin has an image: ``Body.texture``.
    textured: bool


@dataclass(frozen=True)
class ToolInfo:
    """A tool of the scene or of a client."""

    id: str
    #: Id of the client that holds it, ``script``, or empty.
    owner: str
    #: Whether it is a blade.
    cuts: bool


@dataclass(frozen=True)
class SessionInfo:
    """Scene, bodies and tools."""

    server_version: str
    scene: str
    #: Simulated time per step [s].
    step_s: float
    #: Rises with every scene that is loaded.
    scene_seq: int
    bodies: Tuple[BodyInfo, ...]
    tools: Tuple[ToolInfo, ...]
    #: Names of the rigid things that stand still.
    obstacles: Tuple[str, ...]
    #: Unit vector against gravity.
    up: Array
    #: What the scene shows, in one sentence; empty if it does not say.
    description: str


@dataclass(frozen=True)
class Param:
    """A parameter that ``session.set`` may change while the scene runs."""

    key: str
    meaning: str
    unit: str
    #: As ``session.set`` takes it.
    value: str
    #: Allowed values, both ends included.
    min: float
    max: float


@dataclass(frozen=True)
class Measures:
    """Probes and energies after a step."""

    step: int
    time_s: float
    #: Position of each probe [m].
    probes: Dict[str, Array]
    #: Its place at rest [m].
    rest: Dict[str, Array]
    #: Kinetic and elastic energy of each body [J].
    kinetic: Dict[str, float]
    elastic: Dict[str, float]


@dataclass(frozen=True)
class Event:
    """Something that happened on the server."""

    #: ``info``, ``warning`` or ``error``.
    level: str
    #: Stable name such as ``tool-released``.
    name: str
    message: str
    step: int


@dataclass(frozen=True)
class Stats:
    """Rates and health of the server."""

    #: Steps since the server started; a reset does not put it back.
    step: int
    time_s: float
    #: Steps per second, and simulated time over real time.
    step_rate_hz: float
    real_time_factor: float
    paused: bool
    cuts_applied: int
    #: Messages that the server refused, by reason.
    refused: Dict[str, int]
    #: Mean time of each stage of a step [ms].
    stages_ms: Dict[str, float]
    #: Clients that are present, and what they are: ``viewer``, ``haptic`` or ``client``; at most 64 of them.
    clients: Dict[str, str]
    #: Names of the people who hold tools, by tool.
    holders: Dict[str, str]


def to_info(m: server_pb2.SessionInfo) -> SessionInfo:
    bodies = tuple(
        BodyInfo(b.id, b.epoch, b.elements, b.nodes, from_vec3(b.min_m), from_vec3(b.max_m), b.look.textured)
        for b in m.bodies
    )
    tools = tuple(ToolInfo(t.id, t.owner, t.cuts) for t in m.tools)
    obstacles = tuple(o.id for o in m.obstacles)
    up = from_vec3(m.up) if m.HasField("up") else np.array([0.0, 0.0, 1.0])
    of_the_scene = (m.scene_name, m.step_s, m.scene_seq, bodies, tools, obstacles, up, m.scene_description)
    return SessionInfo(m.server_version, *of_the_scene)


def to_params(m: server_pb2.ParamsReply) -> Dict[str, Param]:
    return {p.key: Param(p.key, p.meaning, p.unit, p.value, p.min, p.max) for p in m.params}


def to_measures(m: server_pb2.Measures) -> Measures:
    return Measures(
        m.sim_step,
        m.sim_time_s,
        {p.id: from_vec3(p.position_m) for p in m.probes},
        {p.id: from_vec3(p.rest_m) for p in m.probes},
        {e.body_id: e.kinetic_j for e in m.energies},
        {e.body_id: e.elastic_j for e in m.energies},
    )


def to_event(m: server_pb2.Event) -> Event:
    levels = {server_pb2.Event.LEVEL_WARNING: "warning", server_pb2.Event.LEVEL_ERROR: "error"}
    return Event(levels.get(m.level, "info"), m.name, m.message, m.sim_step)


def to_stats(m: server_pb2.Stats) -> Stats:
    return Stats(
        m.sim_step,
        m.sim_time_s,
        m.step_rate_hz,
        m.real_time_factor,
        m.paused,
        m.cuts_applied,
        {c.name: c.count for c in m.refused},
        {s.name: s.milliseconds for s in m.stages},
        {c.client_id: c.role for c in m.clients},
        {t.tool_id: t.name for t in m.tools if t.name},
    )
