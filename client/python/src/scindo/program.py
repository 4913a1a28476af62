"""A server of one's own: the program ``scindo`` as a child of this program."""

from __future__ import annotations

import json
import pathlib
import random
import socket
import subprocess
import tempfile
import threading
from collections import deque
from typing import Any, Deque, List, Optional, Sequence, Union

from ._executable import find_program, last_lines
from .errors import RunFailed
from .scene import Path, Scene
from .session import Session, connect


def scene_file(scene: Union[Scene, Path], folder: pathlib.Path) -> pathlib.Path:
    """The file of a scene; a scene that was built here is written into ``folder``."""
    if isinstance(scene, Scene):
        return scene.save(folder / "scene.json")
    path = pathlib.Path(scene)
    if not path.is_file():
        raise FileNotFoundError(f"there is no scene file {path}")
    return path


def overrides(keys: Optional[dict[str, Any]]) -> List[str]:
    """``--set`` for each key of a scene that is given another value."""
    arguments: List[str] = []
    for key, value in (keys or {}).items():
        arguments += ["--set", f"{key}={value if isinstance(value, str) else json.dumps(value)}"]
    return arguments


class Server:
    """A server that this program started; made by :func:`serve`. It ends with its ``with`` block."""

    def __init__(self, process: subprocess.Popen[str], endpoint: str, folder: tempfile.TemporaryDirectory[str]) -> None:
        #: Where clients reach it.
        self.endpoint = endpoint
        self._said: Deque[str] = deque(maxlen=200)
        self._process, self._folder = process, folder
        # Read to their ends, so that the process never waits.
        self._readers = [_drain(stream, self._said) for stream in (process.stderr, process.stdout)]

    def __enter__(self) -> Server:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def connect(self, **options: Any) -> Session:
        """Joins it; the options are those of :func:`scindo.connect`."""
        return connect(self.endpoint, **options)

    @property
    def running(self) -> bool:
        """Whether the process is still there."""
        return self._process.poll() is None

    @property
    def output(self) -> str:
        """The last lines that it has written."""
        return "".join(self._said)

    def close(self) -> None:
        """Ends the server, and waits until it has."""
        if self.running:
            self._process.terminate()
        try:
            self._process.wait(timeout=10.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        for reader in self._readers:
            reader.join(timeout=10.0)
        self._folder.cleanup()


def serve(
    scene: Union[Scene, Path],
    *,
    fast: bool = False,
    threads: int = 1,
    set: Optional[dict[str, Any]] = None,
    arguments: Sequence[str] = (),
    timeout: float = 60.0,
) -> Server:
    """Starts a server for a scene on this machine, on free ports of the loopback interface.

    Args:
        scene: a :class:`Scene` or a scene file.
        fast: run as fast as possible instead of in real time.
        threads: threads per step; results do not depend on their number.
        set: keys of the scene with other values, such as ``{"body.liver.young_pa": 5e3}``.
        arguments: further arguments of ``scindo run``, such as ``["--viewer", "8080"]``.
        timeout: longest wait until it answers [s]; large meshes take their time.

    Raises:
        ProgramNotFound: the program is not on this machine.
        RunFailed: it refused the scene or did not begin in time.
    """
    program = find_program()
    folder = tempfile.TemporaryDirectory(prefix="scindo-")
    try:
        endpoint = f"tcp/127.0.0.1:{_free_port()}"
        command = [
            str(program),
            "run",
            str(scene_file(scene, pathlib.Path(folder.name))),
            "--json",
            "--listen",
            endpoint,
        ]
        command += ["--threads", str(threads), *(["--fast"] if fast else []), *overrides(set), *arguments]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        alarm = threading.Timer(timeout, process.kill)
        alarm.start()
        assert process.stdout is not None and process.stderr is not None
        for line in process.stdout:
            if '"started"' in line:
                alarm.cancel()
                return Server(process, endpoint, folder)
        alarm.cancel()
        output = process.stderr.read()
        process.stdout.close()
        process.stderr.close()
        raise RunFailed(
            f"the server did not begin: {last_lines(output) or f'nothing within {timeout:g} s'}",
            exit_code=process.wait(),
            output=output,
            hint="`scindo check` looks at a scene without running it",
        )
    except BaseException:
        folder.cleanup()
        raise


def _drain(stream: Any, lines: Deque[str]) -> threading.Thread:
    """Reads a stream to its end in the background, and keeps its last lines."""

    def read() -> None:
        with stream:
            lines.extend(stream)

    thread = threading.Thread(target=read, name="scindo-output", daemon=True)
    thread.start()
    return thread


def _free_port() -> int:
    """A port that is free together with the next one, below those that the system gives to outgoing connections."""
    for port in random.sample(range(10_000, 30_000, 2), 2_000):
        try:
            for number in (port, port + 1):
                with socket.socket() as one:
                    one.bind(("127.0.0.1", number))
        except OSError:
            continue
        return port
    raise OSError("no two neighbouring ports of 127.0.0.1 between 10000 and 30000 are free")
