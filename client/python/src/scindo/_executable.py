"""The program ``scindo`` on this machine: where it is, and what it says of a scene."""

from __future__ import annotations

import os
import pathlib
import shutil
import subprocess

from .errors import ProgramNotFound, SceneError


def find_program() -> pathlib.Path:
    """The program ``scindo``: the one that ``SCINDO_BIN`` names, or the first on ``PATH``.

    Raises:
        ProgramNotFound: it is in neither place.
    """
    named = os.environ.get("SCINDO_BIN")
    if named:
        path = pathlib.Path(named)
        path = path / "scindo" if path.is_dir() else path
        if not os.access(path, os.X_OK):
            raise ProgramNotFound(
                f"SCINDO_BIN = {named} is no program and no folder with the program scindo",
                hint="Name the file `scindo` itself",
            )
        return path
    found = shutil.which("scindo")
    if found is None:
        raise ProgramNotFound(
            "the program scindo is not on PATH",
            hint="Build it with `cargo build --release`, and set SCINDO_BIN to target/release/scindo",
        )
    return pathlib.Path(found)


def last_lines(text: str, count: int = 6) -> str:
    """The last lines of what a program said, as one line."""
    return " ".join(line.strip() for line in text.strip().splitlines()[-count:])


def check_file(path: pathlib.Path) -> None:
    """Lets ``scindo check`` judge a scene file, without steps.

    Raises:
        SceneError: the program refuses the scene.
        ProgramNotFound: there is no program on this machine.
    """
    command = [str(find_program()), "check", str(path), "--no-solve"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SceneError("scene", last_lines(done.stderr or done.stdout))
