"""What bodies, tools and cuts ask of the session that they belong to."""

from __future__ import annotations

from typing import Any, Protocol

from ._link import Link
from .forces import Forces
from .info import SessionInfo


class Host(Protocol):
    """The part of a session that its bodies, tools and cuts use."""

    link: Link
    id: str
    person: str

    @property
    def timeout(self) -> float: ...

    @property
    def info(self) -> SessionInfo: ...

    def check(self) -> None: ...

    def forces(self) -> Forces: ...

    def _let_go(self, tool: Any) -> None: ...
