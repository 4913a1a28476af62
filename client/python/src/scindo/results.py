"""Results of a run as arrays, read from the files that ``scindo run --out`` writes."""

from __future__ import annotations

import base64
import csv
import json
import pathlib
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from typing import Any, Dict, List, Tuple, Union

import numpy as np
from numpy.typing import NDArray

from .errors import InvalidValue
from .values import Array

_TYPES = {
    "Float64": "<f8",
    "Float32": "<f4",
    "Int32": "<i4",
    "Int64": "<i8",
    "UInt32": "<u4",
    "UInt8": "u1",
    "UInt64": "<u8",
}


@dataclass(frozen=True)
class Grid:
    """Points and cells of one file, with their fields."""

    #: Current positions, n × 3 [m].
    points: Array
    #: Numbers of the points of each cell; four for tetrahedra, eight for hexahedra, three for triangles. Where kinds
    #: are mixed, unused places hold -1.
    cells: NDArray[np.int64]
    #: Fields of the points, such as ``displacement_m``.
    point_data: Dict[str, NDArray[Any]]
    #: Fields of the cells, such as ``von_mises_pa`` and ``cauchy_stress_pa`` (XX YY ZZ XY YZ XZ).
    cell_data: Dict[str, NDArray[Any]]


@dataclass(frozen=True)
class Probe:
    """Motion of one probe, from the start to the end."""

    #: Simulated times [s].
    time_s: Array
    #: Positions, n × 3 [m].
    position: Array
    #: Displacements from rest, n × 3 [m].
    displacement: Array


@dataclass(frozen=True)
class Contact:
    """What one thing did to another, in the steps in which they touched."""

    time_s: Array
    #: Number of vertices that were pushed.
    contacts: NDArray[np.int64]
    #: Largest depth [m].
    deepest: Array
    #: Force on what is pushed, n × 3 [N].
    force: Array
    #: Normal part [N].
    normal: Array


@dataclass(frozen=True)
class Reaction:
    """What holds one place of a body, in the steps in which displacements or loads change."""

    time_s: Array
    #: Share of the prescribed displacements that is reached.
    displacement_share: Array
    #: Force on the body, n × 3 [N].
    force: Array


@dataclass(frozen=True)
class Results:
    """What a run has written. ``solid.points`` and ``surface.points`` are the last positions."""

    folder: pathlib.Path
    #: ``summary.json``.
    summary: Dict[str, Any]
    #: By the names of the probes.
    probes: Dict[str, Probe]
    #: By what is pushed and what pushes it: ``contacts["block", "table"]``. What all tissue does to a tool is
    #: ``contacts["finger", ""]``.
    contacts: Dict[Tuple[str, str], Contact]
    #: By body and number of the ``fix``, if displacements or loads change over time: ``reactions["strip", 1]``.
    reactions: Dict[Tuple[str, int], Reaction]
    #: The material, where cut elements consist of the tetrahedra of their pieces.
    solid: Grid
    #: The surface; ``cell_data["cut_tag"]`` is 0 on the skin and the number of the cut on its faces.
    surface: Grid

    @property
    def status(self) -> str:
        """``done``, ``failed`` or ``interrupted``."""
        return str(self.summary["status"])

    @property
    def points(self) -> Array:
        """Last positions of the material, n × 3 [m]."""
        return self.solid.points

    @classmethod
    def read(cls, folder: Union[str, pathlib.Path]) -> Results:
        """Reads the folder that ``scindo run --out`` has written."""
        path = pathlib.Path(folder)
        if not (path / "summary.json").is_file():
            raise InvalidValue(
                f"{path} holds no summary.json", hint="Name a folder that `scindo run --out` has written"
            )
        return cls(
            path,
            json.loads((path / "summary.json").read_text(encoding="utf-8")),
            {key: _probe(rows) for key, rows in _table(path / "probes.csv", ("id",)).items()},
            {key: _contact(rows) for key, rows in _table(path / "contacts.csv", ("on", "by")).items()},
            {
                (body, int(fix)): _reaction(rows)
                for (body, fix), rows in _table(path / "reactions.csv", ("body", "fix")).items()
            },
            read_grid(path / "final.vtu"),
            read_grid(path / "final-surface.vtp"),
        )


def read_grid(path: pathlib.Path) -> Grid:
    """Reads a ``.vtu`` or ``.vtp`` of the program: one piece, arrays in base64 with a header of eight bytes."""
    piece = ElementTree.parse(path).getroot().find(".//Piece")
    if piece is None:
        raise InvalidValue(f"{path} has no <Piece>", hint="It is no file of VTK that scindo wrote")
    points = piece.find("Points")
    cells = piece.find("Cells") if piece.find("Cells") is not None else piece.find("Polys")
    arrays = {array.get("Name", ""): _values(array) for array in (cells if cells is not None else [])}
    place = [_values(array) for array in (points if points is not None else [])]
    return Grid(
        place[0].astype(np.float64) if place else np.zeros((0, 3)),
        _cells(arrays["connectivity"], arrays["offsets"]),
        {array.get("Name", ""): _values(array) for array in piece.iterfind("PointData/DataArray")},
        {array.get("Name", ""): _values(array) for array in piece.iterfind("CellData/DataArray")},
    )


def _values(array: ElementTree.Element) -> NDArray[Any]:
    kind = np.dtype(_TYPES[array.get("type", "Float64")])
    text = (array.text or "").strip()
    # The header is encoded by itself and takes twelve characters.
    flat = (
        np.frombuffer(base64.b64decode(text[12:]), kind)
        if array.get("format") == "binary"
        else np.array(text.split(), kind)
    )
    width = int(array.get("NumberOfComponents") or 1)
    return flat.reshape(-1, width) if width > 1 else flat


def _cells(connectivity: NDArray[Any], offsets: NDArray[Any]) -> NDArray[np.int64]:
    ends = offsets.astype(np.int64)
    sizes = np.diff(ends, prepend=0)
    width = int(sizes.max()) if len(sizes) else 0
    if len(sizes) and (sizes == width).all():
        return connectivity.astype(np.int64).reshape(-1, width)
    cells = np.full((len(sizes), width), -1, dtype=np.int64)
    for row, (end, size) in enumerate(zip(ends, sizes)):
        cells[row, :size] = connectivity[end - size : end]
    return cells


def _table(path: pathlib.Path, by: Any) -> Dict[Any, List[Dict[str, str]]]:
    """Rows of a CSV file by one or two of their columns; empty if there is no such file."""
    rows: Dict[Any, List[Dict[str, str]]] = {}
    if path.is_file():
        with path.open(newline="", encoding="utf-8") as file:
            for row in csv.DictReader(file):
                key = tuple(row[name] for name in by)
                rows.setdefault(key if len(key) > 1 else key[0], []).append(row)
    return rows


def _columns(rows: List[Dict[str, str]], *names: str) -> Array:
    return np.array([[float(row[name]) for name in names] for row in rows], dtype=np.float64)


def _probe(rows: List[Dict[str, str]]) -> Probe:
    return Probe(
        _columns(rows, "time_s")[:, 0], _columns(rows, "x_m", "y_m", "z_m"), _columns(rows, "ux_m", "uy_m", "uz_m")
    )


def _reaction(rows: List[Dict[str, str]]) -> Reaction:
    return Reaction(
        _columns(rows, "time_s")[:, 0],
        _columns(rows, "displacement_share")[:, 0],
        _columns(rows, "fx_n", "fy_n", "fz_n"),
    )


def _contact(rows: List[Dict[str, str]]) -> Contact:
    return Contact(
        _columns(rows, "time_s")[:, 0],
        _columns(rows, "contacts")[:, 0].astype(np.int64),
        _columns(rows, "deepest_m")[:, 0],
        _columns(rows, "fx_n", "fy_n", "fz_n"),
        _columns(rows, "normal_n")[:, 0],
    )
