"""Client of scindo, a server that deforms, cuts and collides soft bodies in real time.

    >>> import scindo
    >>> with scindo.connect() as session:
    ...     print(session.body("liver").positions.mean(axis=0), session.forces())

* :func:`connect` joins a running server, :func:`serve` starts one on this machine.
* :class:`Scene` builds scenes and checks them, :func:`run` runs one without a network and returns arrays.
* :class:`Env` steps a server in lockstep with a program, in the manner of Gymnasium.

All lengths are metres, forces newtons, times seconds. Every error is a :class:`ScindoError`.
"""

from ._mirror import Surface
from .body import Body
from .cut import CutResult, PendingCut, sweep
from .env import Env
from .errors import (
    Closed,
    InvalidValue,
    ProgramNotFound,
    Refused,
    RunFailed,
    SceneError,
    ScindoError,
    TimedOut,
    UnknownName,
    Unreachable,
)
from .forces import Force, Forces
from .info import BodyInfo, Event, Measures, Param, SessionInfo, Stats, ToolInfo
from .program import Server, serve
from .results import Results
from .run import run
from .scene import Scene
from .session import Session, connect
from .tool import Tool, ToolState

__version__ = "0.1.0"

__all__ = [
    "Body",
    "BodyInfo",
    "Closed",
    "CutResult",
    "Env",
    "Event",
    "Force",
    "Forces",
    "InvalidValue",
    "Measures",
    "Param",
    "PendingCut",
    "ProgramNotFound",
    "Refused",
    "Results",
    "RunFailed",
    "Scene",
    "SceneError",
    "ScindoError",
    "Server",
    "Session",
    "SessionInfo",
    "Stats",
    "Surface",
    "TimedOut",
    "Tool",
    "ToolInfo",
    "ToolState",
    "UnknownName",
    "Unreachable",
    "connect",
    "run",
    "serve",
    "sweep",
]
