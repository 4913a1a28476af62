"""The newest of a stream of values, handed from the threads of zenoh to those of the caller."""

from __future__ import annotations

import threading
import time
from typing import Callable, Generic, Optional, TypeVar

T = TypeVar("T")


class Newest(Generic[T]):
    """Keeps one value; a reader never gets an old one while a newer is there."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._value: Optional[T] = None
        self._count = 0

    def put(self, value: T) -> None:
        """Replaces the value and wakes those who wait."""
        with self._changed:
            self._value = value
            self._count += 1
            self._changed.notify_all()

    @property
    def value(self) -> Optional[T]:
        """The value; ``None`` before the first."""
        return self._value

    @property
    def count(self) -> int:
        """How many values have come so far."""
        return self._count

    def wait(self, timeout: float, accepts: Optional[Callable[[T], bool]] = None, after: int = -1) -> Optional[T]:
        """The value, as soon as there is one that ``accepts`` takes and more than ``after`` have come; ``None`` if
        that takes longer than ``timeout`` [s]."""
        end = time.monotonic() + timeout
        with self._changed:
            while True:
                value = self._value
                if value is not None and self._count > after and (accepts is None or accepts(value)):
                    return value
                left = end - time.monotonic()
                if left <= 0.0:
                    return None
                self._changed.wait(left)
