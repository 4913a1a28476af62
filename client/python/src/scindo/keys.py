"""The key space ``<realm>/@v1/<session>/…``: every key that this package uses.

The table in ``proto/src/key.rs`` is the model. What a client sends lies below its own id.
"""

from __future__ import annotations

import re

from .errors import InvalidValue

#: Version of the wire that this package speaks.
WIRE_VERSION = 1
DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"
MAX_ID_BYTES = 64
MEASURES, FORCES, STATS, EVENT, PLAN = "measures", "forces", "stats", "event", "plan"


def chunk(what: str, text: str) -> str:
    """``text``, if it may stand as one part of a key."""
    if not isinstance(text, str) or not re.fullmatch(r"[a-z0-9_-]{1,%d}" % MAX_ID_BYTES, text):
        shown = text[:MAX_ID_BYTES] if isinstance(text, str) else text
        raise InvalidValue(
            f"{what} {shown!r} cannot be part of a key",
            hint=f"Use 1 to {MAX_ID_BYTES} characters of a-z, 0-9, _ and -",
            code="bad-key",
        )
    return text


class Keys:
    """Keys of one session of one realm."""

    def __init__(self, realm: str, session: str) -> None:
        self._prefix = f"{chunk('realm', realm)}/@v{WIRE_VERSION}/{chunk('session', session)}/"

    def topic(self, name: str) -> str:
        """One of ``measures``, ``forces``, ``stats``, ``event``, ``plan``."""
        return self._prefix + name

    def rpc(self, verb: str) -> str:
        return f"{self._prefix}rpc/{verb}"

    def servers(self) -> str:
        """Liveliness tokens of servers."""
        return f"{self._prefix}server/*/live"

    def live(self, client: str, role: str = "client") -> str:
        """The liveliness token of a client. While it lives, the client owns its tools."""
        return f"{self._prefix}client/{client}/live/{role}"

    def frame(self, body: str) -> str:
        return f"{self._prefix}body/{body}/surface/frame"

    def topology(self, body: str) -> str:
        return f"{self._prefix}body/{body}/surface/topology"

    def keyframe(self, body: str) -> str:
        return f"{self._prefix}body/{body}/surface/keyframe"

    def field(self, body: str, name: str) -> str:
        return f"{self._prefix}body/{body}/surface/field/{name}"

    def pose(self, client: str, tool: str) -> str:
        return f"{self._prefix}client/{client}/tool/{tool}/pose"

    def cut(self, client: str, tool: str) -> str:
        return f"{self._prefix}client/{client}/tool/{tool}/cut"

    def cut_ack(self, tool: str) -> str:
        return f"{self._prefix}tool/{tool}/cut_ack"

    def tool_state(self, tool: str) -> str:
        return f"{self._prefix}tool/{tool}/state"


def bulk_endpoint(endpoint: str) -> str:
    """The endpoint of surfaces beside that of poses: the next port. Empty if the endpoint has no such port."""
    address, mark, options = re.match(r"([^?#]*)([?#]?)(.*)", endpoint).groups()  # type: ignore[union-attr]
    host, colon, port = address.rpartition(":")
    if not colon or not port.isdigit() or not 0 < int(port) < 65535:
        return ""
    return f"{host}:{int(port) + 1}{mark}{options}"
