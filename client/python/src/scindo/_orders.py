"""Orders to the server: pause, step, reset, set, undo, snapshot, restore, record, load."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Dict, Union

import numpy as np
from google.protobuf.message import Message

from ._link import Link, raise_if_refused
from .errors import InvalidValue, TimedOut
from .info import Param, to_params
from .v1 import server_pb2
from .values import Vector

MAX_STEPS = 10_000
# Pause between two looks at steps that go on [s].
LOOK_S = 0.05


class Orders:
    """The orders and questions of a session. Orders need an operator: a client on the server's own machine, unless
    the server was started with ``--operators all``."""

    link: Link

    def pause(self) -> None:
        """Stops the simulation. It still answers, and makes steps when ``step`` asks for them."""
        self._order("pause", server_pb2.PauseRequest(paused=True))

    def resume(self) -> None:
        """Lets a paused simulation run."""
        self._order("pause", server_pb2.PauseRequest(paused=False))

    def step(self, count: int = 1, timeout: float = 30.0) -> None:
        """Makes ``count`` steps of a paused simulation, and waits until they are made.

        Raises:
            Refused: the simulation is not paused (``not-paused``).
            TimedOut: no step ended within ``timeout`` [s].
        """
        if count < 1:
            raise InvalidValue(f"count = {count} steps", hint="Make 1 or more")
        while count > 0:
            # After the first step the number of the present one is known.
            part = min(count, MAX_STEPS) if count == 1 else 1
            reached = self._steps(part, timeout)
            count -= part
            part = min(count, MAX_STEPS)
            if part > 0:
                self._steps(part, timeout, reached + part)
                count -= part

    def reset(self) -> None:
        """Goes back to the start of the scene. Cuts are gone, and epochs keep rising."""
        self._order("reset", server_pb2.ResetRequest())

    def undo(self) -> None:
        """Takes the last cut back. The server keeps the last eight."""
        self._order("undo", server_pb2.UndoRequest())

    def snapshot(self, name: str) -> None:
        """Keeps the present state as ``name`` (1 to 64 of a-z, 0-9, - and _) in the memory of the server, in place
        of an earlier state of this name. The server keeps 16 of them, and forgets them when it ends or loads another
        scene.

        Raises:
            Refused: the name is not valid, or there is no room.
        """
        self._order("snapshot", server_pb2.SnapshotRequest(name=name))

    def restore(self, name: str) -> None:
        """Goes back to a state that ``snapshot`` kept, with its cuts and its time. Epochs keep rising."""
        self._order("restore", server_pb2.RestoreRequest(name=name))

    def record(self, on: bool = True) -> str:
        """Begins or ends a recording, and returns the name of its file in the folder that the server was started with
        (``--recordings FOLDER``).

        Raises:
            Refused: there is no such folder, something is being recorded already, or nothing is (``cannot-record``).
        """
        return self._order("record", server_pb2.RecordRequest(on=on)).message

    def save_state(self, path: Union[str, "os.PathLike[str]"], timeout: float = 30.0) -> int:
        """Writes the present state, with its cuts, to a file ``.mcap`` of this machine, and returns its size [bytes].
        ``scindo run --resume FILE`` goes on from it. States of more than 64 MiB are refused."""
        file = self.link.ask(self.link.keys.rpc("state"), server_pb2.StateReply, timeout=timeout).file
        return Path(path).write_bytes(file)

    def set(self, key: str, value: Union[str, float, bool, Vector]) -> None:
        """Changes one of ``params``, such as ``session.set("body.liver.young_pa", 5e3)``."""
        self._order("set", server_pb2.SetRequest(key=key, value=_as_text(value)))

    def load(self, name: str, timeout: float = 60.0) -> None:
        """Changes to another of ``scenes``, and waits until it runs. Bodies and tools of the old scene are gone."""
        before = self._scene_seq()
        self._order("load", server_pb2.LoadRequest(name=name))
        end = time.monotonic() + timeout
        while self._scene_seq() == before:
            if time.monotonic() > end:
                raise TimedOut(
                    f"scene '{name}' was not built within {timeout:g} s",
                    hint="session.events says why, if it failed",
                    code="timeout",
                )
            time.sleep(LOOK_S)

    @property
    def scenes(self) -> Dict[str, str]:
        """Scenes that ``load`` accepts, with a line on each."""
        reply = self.link.ask(self.link.keys.rpc("scenes"), server_pb2.ScenesReply)
        return {scene.name: scene.description for scene in reply.scenes}

    @property
    def params(self) -> Dict[str, Param]:
        """What ``set`` may change at present, with values and ranges."""
        return to_params(self.link.ask(self.link.keys.rpc("params"), server_pb2.ParamsReply))

    def _scene_seq(self) -> int:
        # Between two scenes nobody answers for a moment; the question is asked again.
        return self.link.ask(self.link.keys.rpc("info"), server_pb2.SessionInfo).scene_seq

    def _order(self, verb: str, request: Message) -> server_pb2.RpcReply:
        key = self.link.keys.rpc(verb)
        reply = self.link.ask(key, server_pb2.RpcReply, request, timeout=max(3.0, self.link.timeout))
        raise_if_refused(reply, verb)
        return reply

    def _steps(self, count: int, timeout: float, target: int = 0) -> int:
        """Makes some steps, and returns the number of the last."""
        reply = self._order("step", server_pb2.StepRequest(count=count))
        if not reply.message.startswith("accepted"):
            return reply.sim_step
        target = target or reply.sim_step + count
        reached, since = reply.sim_step, time.monotonic()
        while reached < target:
            time.sleep(LOOK_S)
            now = self._order("pause", server_pb2.PauseRequest(paused=True)).sim_step
            if now > reached:
                reached, since = now, time.monotonic()
            elif time.monotonic() - since > timeout:
                raise TimedOut(
                    f"step {reached + 1} of {target} did not end within {timeout:g} s",
                    hint="Give a longer timeout, or a smaller scene",
                    code="timeout",
                )
        return reached


def _as_text(value: Union[str, float, bool, Vector]) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, bool):
        return "true" if value else "false"
    array = np.asarray(value, dtype=np.float64)
    if array.ndim == 0:
        return repr(float(array)) if not isinstance(value, int) else str(value)
    return "[" + ", ".join(repr(float(x)) for x in array) + "]"
