"""A session with a server: bodies, tools, cuts, forces and orders."""

from __future__ import annotations

import os
import socket
import threading
from collections import deque
from typing import Any, Callable, Deque, Dict, Optional, Type, TypeVar

import zenoh
from google.protobuf.message import Message

from ._link import Link
from ._newest import Newest
from ._orders import Orders
from .body import Body
from .cut import CutResult, Cutter, PendingCut, Sweep, check_sweep
from .errors import InvalidValue, Refused, TimedOut, unknown
from .forces import Forces
from .info import Event, Measures, SessionInfo, Stats, to_event, to_info, to_measures, to_stats
from .keys import EVENT, FORCES, MEASURES, STATS, WIRE_VERSION, Keys, chunk
from .tool import Tool, to_shape
from .v1 import force_pb2, server_pb2

T = TypeVar("T")
M = TypeVar("M", bound=Message)

#: Longest name of a person.
MAX_PERSON = 32
#: Most events that a session keeps.
MAX_EVENTS = 1000
# The next message may tell of a step that is over, and the one after it of a step that has begun.
LATER = 3


def connect(
    endpoint: Optional[str] = None,
    realm: str = "scindo",
    session: str = "main",
    *,
    client: Optional[str] = None,
    person: str = "",
    timeout: float = 5.0,
    zenoh_config: Optional[str] = None,
) -> Session:
    """Joins a running server.

    Args:
        endpoint: address of the server or of a router; by default that of the environment variable ``SCINDO_CONNECT``,
            or else ``tcp/127.0.0.1:7447``.
        realm: first part of every key, one per laboratory.
        session: the session within the realm.
        client: name of this program, unique in the session; by default made of the names of machine and process.
        person: your name, at most 32 characters, which others see beside the tools that you hold.
        timeout: longest wait for an answer [s].
        zenoh_config: a zenoh configuration file (JSON5) to start from, for certificates, users and routers.

    Raises:
        Unreachable: nobody listens at the endpoint.
        TimedOut: a router listens there, but no server of this session is behind it.
    """
    name = client or _client_name()
    chunk("client", name)
    if len(person) > MAX_PERSON or not person.isprintable():
        raise InvalidValue(f"person = {person!r}", hint=f"Give at most {MAX_PERSON} characters in one line")
    default = None if zenoh_config else os.environ.get("SCINDO_CONNECT")
    link = Link(endpoint or default, Keys(realm, session), timeout, zenoh_config)
    try:
        return Session(link, name, person)
    except BaseException:
        link.close()
        raise


class Session(Orders):
    """A connection to a server; made by :func:`connect`. Use it in a ``with`` block, or ``close`` it.

    Its methods may be called from any thread. It does not survive ``os.fork``: connect in each process.
    """

    def __init__(self, link: Link, client: str, person: str = "") -> None:
        self.link = link
        #: Name of this program in the session.
        self.id = client
        #: Name of the person, which others see beside the tools that this program holds.
        self.person = person
        self._lock = threading.RLock()
        self._bodies: Dict[str, Body] = {}
        self._tools: Dict[str, Tool] = {}
        self._cutters: Dict[str, Cutter] = {}
        self._streams: Dict[str, Newest[Any]] = {}
        self._events: Deque[Event] = deque(maxlen=MAX_EVENTS)
        self._token = link.haptic.liveliness().declare_token(link.keys.live(client))
        self._servers = link.haptic.liveliness().declare_subscriber(link.keys.servers(), self._on_server, history=True)
        link.subscribe(link.keys.topic(EVENT), server_pb2.Event, lambda m: self._events.append(to_event(m)))
        self._check_version()

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<scindo.Session {self.id!r} at {self.link.endpoint}>"

    def close(self) -> None:
        """Leaves the session. The server frees the tools of this program."""
        for body in self._bodies.values():
            body._close()
        self.link.close()

    def check(self) -> None:
        """Fails if the session is closed or was forked."""
        self.link.check()

    @property
    def timeout(self) -> float:
        """Longest wait for an answer [s]."""
        return self.link.timeout

    @property
    def info(self) -> SessionInfo:
        """Scene, bodies and tools, as the server tells them now."""
        return to_info(self.link.ask(self.link.keys.rpc("info"), server_pb2.SessionInfo))

    @property
    def bodies(self) -> Dict[str, Body]:
        """All bodies of the scene, by their names."""
        return {body.id: self._body(body.id) for body in self.info.bodies}

    @property
    def tools(self) -> Dict[str, str]:
        """All tools, and who holds them: a client, ``script``, or nobody (empty)."""
        return {tool.id: tool.owner for tool in self.info.tools}

    def body(self, id: str) -> Body:
        """A body of the scene.

        Raises:
            UnknownName: the scene has no such body.
        """
        known = [body.id for body in self.info.bodies]
        if id not in known:
            raise unknown("body", id, known, "the scene")
        return self._body(id)

    def tool(self, id: str, shape: Optional[Dict[str, Dict[str, float]]] = None) -> Tool:
        """A tool of the scene; with a ``shape``, such as ``{"sphere": {"radius_m": 0.005}}``, one that this program
        brings. The first ``move`` takes it.

        Raises:
            UnknownName: the scene has no such tool, and no shape is given.
        """
        with self._lock:
            held = self._tools.get(id)
        if held is not None and shape is None:
            return held
        known = self.tools
        if shape is None and id not in known:
            raise unknown("tool", id, known, "the scene")
        tool = Tool(self, chunk("tool", id), None if shape is None else to_shape(shape))
        with self._lock:
            self._tools[id] = tool
        return tool

    def cut(self, sweep: Sweep, body: str = "", tool: Optional[str] = None, timeout: float = 5.0) -> CutResult:
        """Cuts, and waits for the answer.

        Args:
            sweep: positions [tip, heel] of the blade, n × 2 × 3 [m]; :func:`scindo.sweep` makes them from a path.
            body: the body to cut; by default every body that may be cut.
            tool: the tool that cuts, if one is shown; by default one of the name of this program.
            timeout: longest wait for the answer [s].

        Raises:
            Refused: the server did not make the cut; ``code`` says why.
            TimedOut: no answer came. In a paused simulation use ``begin_cut``, ``step`` and ``result``.
        """
        return self.begin_cut(sweep, body, tool).result(timeout)

    def begin_cut(self, sweep: Sweep, body: str = "", tool: Optional[str] = None) -> PendingCut:
        """Sends a cut without waiting. The next step makes it, and ``result()`` gives the answer."""
        array = check_sweep(sweep)
        if body:
            chunk("body", body)
        name = chunk("tool", tool or self.id)
        with self._lock:
            if name not in self._cutters:
                self._cutters[name] = Cutter(self, name)
            return self._cutters[name].begin(array, body)

    def forces(self, wait: bool = False, step: Optional[int] = None) -> Forces:
        """Forces of contact after the newest step: ``for force in session.forces(): …``. The server gathers them from
        the first call on.

        Args:
            wait: wait for those of a step that begins after this call, so that it has seen every pose sent before.
                A paused simulation makes none.
            step: wait for those of this step, as ``body.surface.step`` counts.
        """
        return self._newest(FORCES, force_pb2.Forces, Forces, LATER if wait else 0, lambda f: step in (None, f.step))

    def measures(self, wait: bool = False) -> Measures:
        """Probes and energies after the newest step, or after one that begins after this call."""
        return self._newest(MEASURES, server_pb2.Measures, to_measures, LATER if wait else 0)

    def stats(self, wait: bool = False) -> Stats:
        """Rates and health of the server, a few times per second: the newest, or the next."""
        return self._newest(STATS, server_pb2.Stats, to_stats, 1 if wait else 0)

    @property
    def events(self) -> Deque[Event]:
        """What has happened since this session began, newest last; at most the last thousand."""
        return self._events.copy()

    def _check_version(self) -> None:
        """Asks the server who it is, and fails if it speaks another version of the wire."""
        info = self.link.ask(self.link.keys.rpc("info"), server_pb2.SessionInfo)
        if info.wire_version != WIRE_VERSION:
            raise Refused(
                f"the server at {self.link.endpoint} (scindo {info.server_version}) speaks version "
                f"{info.wire_version} of the wire, and this package version {WIRE_VERSION}",
                hint="Install the wheel that came with the server",
                code="wire-version",
            )

    def _body(self, id: str) -> Body:
        with self._lock:
            return self._bodies.setdefault(id, Body(self, id))

    def _newest(
        self,
        topic: str,
        kind: Type[M],
        convert: Callable[[M], T],
        later: int,
        accepts: Optional[Callable[[T], bool]] = None,
    ) -> T:
        """The newest message of a topic, or the one that comes as the ``later``-th from now."""
        self.check()
        with self._lock:
            stream: Optional[Newest[T]] = self._streams.get(topic)
            if stream is None:
                fresh: Newest[T] = Newest()
                self.link.subscribe(self.link.keys.topic(topic), kind, lambda m: fresh.put(convert(m)))
                stream = self._streams[topic] = fresh
        value = stream.wait(self.timeout, accepts, stream.count + later - 1 if later else -1)
        if value is None:
            raise TimedOut(
                f"no {topic} came within {self.timeout:g} s",
                hint="They are sent after a step; a paused simulation makes one with session.step()",
                code="timeout",
            )
        return value

    def _on_server(self, sample: zenoh.Sample) -> None:
        # Another server begins at step 0 and epoch 0, which would pass for old frames of the one before.
        if sample.kind == zenoh.SampleKind.PUT:
            for body in list(self._bodies.values()):
                body._renew()

    def _let_go(self, tool: Tool) -> None:
        """Frees one tool. The wire knows one way: the token of the client goes. The other tools are taken again."""
        with self._lock:
            others = [other for other in self._tools.values() if other is not tool]
            self._token.undeclare()
            self._token = self.link.haptic.liveliness().declare_token(self.link.keys.live(self.id))
            for other in others:
                other._again()


def _client_name() -> str:
    host = "".join(c if c.isalnum() and c.isascii() else "-" for c in socket.gethostname().lower())[:40] or "python"
    return f"{host}_{os.getpid()}_{os.urandom(3).hex()}"
