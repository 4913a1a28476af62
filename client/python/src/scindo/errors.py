"""What can go wrong. Every error says what, where, the value, what is allowed and what to do next."""

from __future__ import annotations

import difflib
from typing import Iterable, Optional


class ScindoError(Exception):
    """Base of all errors of this package.

    ``code`` is a stable word such as ``"not-owner"``; ``hint`` is the next step, which the message repeats.
    """

    def __init__(self, message: str, *, hint: str = "", code: str = "") -> None:
        super().__init__(f"{message}. {hint}" if hint else message)
        self.code = code
        self.hint = hint


class Unreachable(ScindoError, ConnectionError):
    """No server answers at the endpoint."""


class TimedOut(ScindoError, TimeoutError):
    """A server did not answer in time."""


class Refused(ScindoError):
    """The server understood and refused. ``code`` is the server's word for the reason."""


class InvalidValue(ScindoError, ValueError):
    """A value that would be refused: of the wrong shape, not finite or out of range."""


class UnknownName(ScindoError, LookupError):
    """The scene or the server has nothing of this name."""


class SceneError(ScindoError, ValueError):
    """A scene breaks the rules of its schema. ``path`` is the key, such as ``body[0].young_pa``."""

    def __init__(self, path: str, message: str, *, hint: str = "") -> None:
        super().__init__(f"{path or 'scene'}: {message}", hint=hint, code="bad-scene")
        self.path = path


class ProgramNotFound(ScindoError, FileNotFoundError):
    """The program ``scindo`` is not on this machine, or not where it was looked for."""


class RunFailed(ScindoError):
    """The program ended with an error. ``output`` holds its last lines, ``exit_code`` its exit code."""

    def __init__(self, message: str, *, exit_code: int, output: str, hint: str = "") -> None:
        super().__init__(message, hint=hint, code="run-failed")
        self.exit_code = exit_code
        self.output = output


class Closed(ScindoError):
    """The session was closed, or belongs to the process that this one was forked from."""


def nearest(name: str, known: Iterable[str]) -> Optional[str]:
    """The known name that looks most like ``name``."""
    found = difflib.get_close_matches(name, list(known), n=1, cutoff=0.6)
    return found[0] if found else None


def unknown(what: str, name: str, known: Iterable[str], where: str) -> UnknownName:
    """The error for a name that does not exist, with the names that do."""
    names = sorted(known)
    close = nearest(name, names)
    hint = f"Did you mean '{close}'?" if close else f"There are: {', '.join(names) or 'none'}"
    return UnknownName(f"{where} has no {what} '{name}'", hint=hint, code=f"unknown-{what.replace(' ', '-')}")
