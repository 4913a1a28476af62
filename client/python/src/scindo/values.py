"""Vectors of the wire and numpy arrays, in metres and newtons, checked before they are sent."""

from __future__ import annotations

from typing import Any, Sequence, Union

import numpy as np
from numpy.typing import NDArray

from .errors import InvalidValue
from .v1 import common_pb2

Array = NDArray[np.float64]
Vector = Union[Sequence[float], NDArray[Any]]
MAX_COORDINATE_M = 1.0e4


def vector(what: str, value: Vector, limit: float = MAX_COORDINATE_M, unit: str = "m", size: int = 3) -> Array:
    """``value`` as ``size`` finite numbers of at most ``limit``."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise InvalidValue(f"{what} = {value!r} is not a vector", hint=f"Give {size} numbers [{unit}]") from None
    if array.shape != (size,):
        raise InvalidValue(f"{what} has the shape {array.shape}", hint=f"Give {size} numbers [{unit}]")
    if not np.isfinite(array).all() or np.abs(array).max() > limit:
        raise InvalidValue(
            f"{what} = {array.tolist()} [{unit}]",
            hint=f"Every component is finite and lies in ±{limit:g}",
            code="out-of-range",
        )
    return array


def quaternion(what: str, value: Vector) -> Array:
    """A unit quaternion (x, y, z, w), normalised."""
    array = vector(what, value, 1e6, "1", 4)
    length = float(np.linalg.norm(array))
    if length < 1e-6:
        raise InvalidValue(
            f"{what} = {array.tolist()} has no length",
            hint="Give a quaternion (x, y, z, w); (0, 0, 0, 1) does not turn",
        )
    return array / length


def from_vec3(message: Any) -> Array:
    """A ``Vec3`` or ``Vec3f`` as an array."""
    return np.array([message.x, message.y, message.z], dtype=np.float64)


def put_vec3(message: common_pb2.Vec3, value: Array) -> None:
    """Writes an array into a ``Vec3``."""
    message.x, message.y, message.z = (float(x) for x in value)
