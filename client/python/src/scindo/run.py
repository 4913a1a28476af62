"""Runs the program on this machine, without a network, and reads what it writes."""

from __future__ import annotations

import json
import pathlib
import subprocess
import tempfile
from typing import Any, List, Optional, Union

from ._executable import find_program, last_lines
from .errors import InvalidValue, RunFailed
from .program import overrides, scene_file
from .results import Results
from .scene import Path, Scene


def run(
    scene: Union[Scene, Path],
    *,
    steps: Optional[int] = None,
    seconds: Optional[float] = None,
    out: Optional[Path] = None,
    threads: int = 1,
    set: Optional[dict[str, Any]] = None,
    timeout: Optional[float] = None,
    check: bool = True,
) -> Results:
    """Runs a scene as fast as possible, and returns its results as arrays.

    Args:
        scene: a :class:`Scene` or a scene file.
        steps: how many steps; or
        seconds: how much simulated time [s]. One of the two is needed.
        out: folder for the results. Without one they are read, and their files are deleted.
        threads: threads per step; results do not depend on their number.
        set: keys of the scene with other values, such as ``{"body.liver.young_pa": 5e3}``.
        timeout: longest time of the run [s]; by default it may take as long as it likes.
        check: whether a run that fails raises an error. Without it, ``results.status`` is ``failed``.

    Raises:
        ProgramNotFound: the program is not on this machine.
        RunFailed: it refused the scene, or the run failed.
    """
    if (steps is None) == (seconds is None):
        raise InvalidValue(f"steps = {steps} and seconds = {seconds}", hint="Give exactly one of the two")
    program = find_program()
    with tempfile.TemporaryDirectory(prefix="scindo-") as scratch:
        folder = pathlib.Path(out) if out is not None else pathlib.Path(scratch) / "results"
        file = scene_file(scene, pathlib.Path(scratch))
        length = ["--steps", str(steps)] if steps is not None else ["--seconds", str(seconds)]
        command = [str(program), "run", str(file), "--fast", "--out", str(folder), *length, "--threads", str(threads)]
        # A session of its own, so that no client of another server meets it.
        command += ["--session", f"run-{pathlib.Path(scratch).name[-8:].lower()}", *overrides(set)]
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=timeout, check=False)
        except subprocess.TimeoutExpired:
            raise RunFailed(
                f"the run took longer than {timeout:g} s",
                exit_code=-1,
                output="",
                hint="Give a longer timeout, or make fewer steps",
            ) from None
        said = done.stderr or done.stdout
        if done.returncode == 2 or not (folder / "final.vtu").is_file() or (check and done.returncode != 0):
            raise RunFailed(
                f"scindo ended with {done.returncode}: {last_lines(said)}",
                exit_code=done.returncode,
                output=said,
                hint="`scindo check` looks at the scene; check=False returns what a failed run has written",
            )
        return Results.read(folder)


def forecast(scene: Union[Scene, Path]) -> Any:
    """What ``scindo check --json`` says of a scene: warnings, convergence, motion, cost."""
    with tempfile.TemporaryDirectory(prefix="scindo-") as scratch:
        command: List[str] = [str(find_program()), "check", str(scene_file(scene, pathlib.Path(scratch))), "--json"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode == 2 or not done.stdout.strip():
        raise RunFailed(
            f"scindo check ended with {done.returncode}: {last_lines(done.stderr)}",
            exit_code=done.returncode,
            output=done.stderr,
        )
    return json.loads(done.stdout)
