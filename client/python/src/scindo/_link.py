"""Two zenoh sessions: one for poses, cuts and orders, one for surfaces, so that a mesh never delays a hand."""

from __future__ import annotations

import atexit
import json
import os
import threading
import time
import weakref
from typing import Any, Callable, List, Optional, Type, TypeVar

import zenoh
from google.protobuf.message import DecodeError, Message

from .errors import Closed, InvalidValue, Refused, TimedOut, Unreachable
from .keys import DEFAULT_ENDPOINT, Keys, bulk_endpoint
from .v1 import common_pb2, server_pb2

M = TypeVar("M", bound=Message)

# Longest wait of one query [s]. The server answers within 1.7 s, if only "still running".
QUERY_S = 2.0
# Pause before a question that reached nobody is asked again [s].
PAUSE_S = 0.05

_open: "weakref.WeakSet[Link]" = weakref.WeakSet()
# Waits for the end of the main thread.
_watch: Optional[threading.Thread] = None


class Link:
    """Sends and receives messages of one session. Its methods may be called from any thread."""

    def __init__(self, endpoint: Optional[str], keys: Keys, timeout: float, config: Optional[str]) -> None:
        self.keys = keys
        self.endpoint = endpoint or (f"of {config}" if config else DEFAULT_ENDPOINT)
        self.timeout = timeout
        self.refused = 0
        self._process = os.getpid()
        self._subscribers: List[Any] = []
        self._declared: dict[str, zenoh.KeyExpr] = {}
        self._closed = False
        target = None if config and not endpoint else (endpoint or DEFAULT_ENDPOINT)
        self.haptic = self._connect(target, timeout, config)
        beside = bulk_endpoint(target) if target else ""
        try:
            self.bulk = self._connect(beside, min(1.0, timeout), config) if beside else self.haptic
        except Unreachable:
            # A router has one port only. It relays surfaces as well.
            self.bulk = self.haptic
        _open.add(self)
        _watch_main_thread()

    def _connect(self, endpoint: Optional[str], timeout: float, config: Optional[str]) -> zenoh.Session:
        try:
            settings = zenoh.Config.from_file(config) if config else zenoh.Config()
        except zenoh.ZError as error:
            raise InvalidValue(
                f"zenoh_config = {config!r} cannot be read ({error})", hint="Name a JSON5 file of zenoh's settings"
            ) from None
        settings.insert_json5("mode", '"client"')
        settings.insert_json5("connect/timeout_ms", str(int(timeout * 1000)))
        if not config:
            # The server has none, and a client would need a /dev/shm that it may write to.
            settings.insert_json5("transport/shared_memory/enabled", "false")
        settings.insert_json5("scouting/multicast/enabled", "false")
        settings.insert_json5("scouting/gossip/enabled", "false")
        if endpoint:
            settings.insert_json5("connect/endpoints", json.dumps([endpoint]))
        try:
            return zenoh.open(settings)
        except zenoh.ZError as error:
            raise Unreachable(
                f"no server answered at {endpoint or config} within {timeout:g} s ({error})",
                hint="Start one with `scindo run SCENE --listen ENDPOINT`, or name its endpoint: "
                "scindo.connect('tcp/HOST:7447')",
                code="unreachable",
            ) from None

    @property
    def closed(self) -> bool:
        """Whether the session was closed here."""
        return self._closed

    def check(self) -> None:
        """Fails if the session is closed or was inherited by ``fork``."""
        if self._process != os.getpid():
            raise Closed(
                f"this session belongs to process {self._process}; "
                f"its threads did not come along in the fork to {os.getpid()}",
                hint="Connect in each process, and start processes with multiprocessing.get_context('spawn')",
                code="forked",
            )
        if self._closed:
            raise Closed("the session is closed", hint="Open another one with scindo.connect()", code="closed")

    def close(self) -> None:
        """Ends both sessions. The server frees the tools of this client."""
        if self._closed or self._process != os.getpid():
            return
        self._closed = True
        _open.discard(self)
        for subscriber in self._subscribers:
            subscriber.undeclare()
        if self.bulk is not self.haptic:
            self.bulk.close()
        self.haptic.close()

    def subscribe(self, key: str, kind: Type[M], on_message: Callable[[M], None], haptic: bool = False) -> Any:
        """Calls ``on_message`` on a thread of zenoh for each message. Unreadable ones are counted in ``refused``."""
        self.check()

        def on_sample(sample: zenoh.Sample) -> None:
            try:
                message = read(sample.payload, sample.encoding, kind)
            except (DecodeError, ValueError):
                self.refused += 1
                return
            on_message(message)

        session = self.haptic if haptic else self.bulk
        subscriber = session.declare_subscriber(key, on_sample)
        self._subscribers.append(subscriber)
        return subscriber

    def unsubscribe(self, subscriber: Any) -> None:
        """Ends a subscription."""
        if not self._closed and self._process == os.getpid() and subscriber in self._subscribers:
            self._subscribers.remove(subscriber)
            subscriber.undeclare()

    def put(self, key: str, message: Message, priority: Any = zenoh.Priority.INTERACTIVE_HIGH) -> None:
        """Sends one message, reliably and at once."""
        self.check()
        # A declared key is sent as a number, and finds its way at the server without a search.
        declared = self._declared.get(key)
        if declared is None:
            declared = self._declared[key] = self.haptic.declare_keyexpr(key)
        self.haptic.put(
            declared,
            message.SerializeToString(),
            encoding=zenoh.Encoding(encoding(message)),
            congestion_control=zenoh.CongestionControl.BLOCK,
            priority=priority,
            express=True,
        )

    def ask(self, key: str, kind: Type[M], request: Optional[Message] = None, timeout: Optional[float] = None) -> M:
        """One query and its answer. A question (no ``request``) is asked again while nobody answers; an order is
        not, because one whose answer was lost may have been carried out."""
        self.check()
        patience = self.timeout if timeout is None else timeout
        end = time.monotonic() + patience
        while True:
            reply = self._query(key, request, patience if request is not None else min(QUERY_S, patience))
            if reply is not None and reply.ok is not None:
                return read(reply.ok.payload, reply.ok.encoding, kind)
            if reply is not None and reply.err is not None:
                raise_refusal(reply.err.payload.to_bytes(), key)
            if request is not None or time.monotonic() >= end:
                raise TimedOut(
                    f"{key} was not answered within {patience:g} s at {self.endpoint}",
                    hint="See whether the server runs and has this realm and session"
                    + ("; the order may have been carried out" if request is not None else ""),
                    code="timeout",
                )
            time.sleep(PAUSE_S)

    def _query(self, key: str, request: Optional[Message], wait: float) -> Optional[zenoh.Reply]:
        """The first answer; ``None`` if there is none, or if zenoh itself reports that time is over."""
        # Orders take the session of poses: a pose sent before an order is there before it.
        if request is None:
            replies = list(self.bulk.get(key, timeout=wait))
        else:
            payload = request.SerializeToString()
            replies = list(
                self.haptic.get(key, timeout=wait, payload=payload, encoding=zenoh.Encoding(encoding(request)))
            )
        for reply in replies:
            # A query without an answer in time ends with an error of zenoh's own, which names no message.
            if reply.ok is not None or (
                reply.err is not None and str(reply.err.encoding) == encoding(common_pb2.Error())
            ):
                return reply
        return None


def encoding(message: Message) -> str:
    """The name under which a message travels."""
    return f"application/protobuf;{message.DESCRIPTOR.full_name}"


def read(payload: Any, stated: Any, kind: Type[M]) -> M:
    """Decodes a message of the stated kind."""
    if str(stated) != f"application/protobuf;{kind.DESCRIPTOR.full_name}":
        raise ValueError(f"{stated} is not {kind.DESCRIPTOR.full_name}")
    return kind.FromString(payload.to_bytes())


def raise_refusal(payload: bytes, key: str) -> None:
    """Raises the error that a server answered with."""
    error = common_pb2.Error.FromString(payload)
    raise Refused(f"{key.rsplit('/', 1)[-1]}: {error.message}", hint=sentence(error.hint), code=error.code)


def raise_if_refused(reply: server_pb2.RpcReply, verb: str) -> None:
    """Raises the error of an order that was not carried out."""
    if not reply.ok:
        raise Refused(f"{verb}: {reply.error.message}", hint=sentence(reply.error.hint), code=reply.error.code)


def sentence(text: str) -> str:
    """``text`` with a capital."""
    return text[:1].upper() + text[1:]


@atexit.register
def _close_all() -> None:
    # zenoh's threads call into Python; none may be left when the interpreter ends.
    for link in list(_open):
        link.close()


def _watch_main_thread() -> None:
    # The interpreter waits for zenoh's threads before it runs what `atexit` knows, so a script that leaves its session
    # open would never end.
    def wait() -> None:
        threading.main_thread().join()
        _close_all()

    global _watch
    if _watch is None or not _watch.is_alive():
        # No daemon: it must not be stopped halfway.
        _watch = threading.Thread(target=wait, name="scindo-end")
        _watch.start()
