"""Builds scenes in Python, and checks each part by the schema of scenes as it is added."""

from __future__ import annotations

import copy
import json
import pathlib
import tempfile
from typing import Any, Dict, List, Optional, Union

import numpy as np

from . import _schema
from ._executable import check_file
from .errors import SceneError, unknown
from .values import Vector

Path = Union[str, "pathlib.Path"]
#: Keys that name a file relative to the scene.
_FILES = ("file", "surface")


class Scene:
    """A scene, as ``server/world/scenes/KEYS.md`` describes it, in SI units.

        scene = scindo.Scene("press", gravity=(0, 0, -9.81))
        scene.add_body("block", mesh={"box": {"min_m": [0, 0, 0], "max_m": [0.1, 0.1, 0.05], "cells": [8, 8, 4]}},
                       young_pa=1e4, poisson=0.4, density_kg_m3=1000)
        scene.fix("block", where={"slab": {"axis": "z", "from": 0, "to": 0}})

    Keyword arguments are the keys of a scene file. An unknown key, a wrong type and a value out of range raise a
    :class:`SceneError` at once; ``check`` looks at the whole.
    """

    def __init__(
        self,
        name: str = "unnamed",
        *,
        description: Optional[str] = None,
        gravity: Optional[Vector] = None,
        step_s: Optional[float] = None,
    ) -> None:
        self._data: Dict[str, Any] = {"schema": 1, "name": name}
        if description is not None:
            self._data["description"] = description
        world: Dict[str, Any] = {}
        if gravity is not None:
            world["gravity_m_s2"] = _plain(gravity)
        if step_s is not None:
            world["step_s"] = _plain(step_s)
        if world:
            self._data["world"] = world
        #: Folder that relative paths of meshes refer to.
        self.folder = pathlib.Path.cwd()
        self.check(whole=False)

    def __repr__(self) -> str:
        return f"<scindo.Scene {self._data['name']!r} with {', '.join(b['id'] for b in self.bodies) or 'no bodies'}>"

    @classmethod
    def from_dict(cls, data: Dict[str, Any], folder: Optional[Path] = None) -> Scene:
        """A scene of the keys of a scene file."""
        scene = cls()
        scene._data = _plain(data)
        scene.folder = pathlib.Path(folder or ".").resolve()
        scene.check(whole=False)
        return scene

    @classmethod
    def load(cls, path: Path) -> Scene:
        """Reads a scene file, ``.toml`` or ``.json``."""
        file = pathlib.Path(path)
        text = file.read_text(encoding="utf-8")
        try:
            data = json.loads(text) if file.suffix.lower() == ".json" else _toml(text)
        except ValueError as error:
            raise SceneError(
                str(file), f"cannot be read: {error}", hint="Write TOML, or JSON into a file that ends with .json"
            ) from None
        return cls.from_dict(data, file.resolve().parent)

    @property
    def bodies(self) -> List[Dict[str, Any]]:
        """The bodies, as they are written into the file. Changes count."""
        found: List[Dict[str, Any]] = self._data.get("body", [])
        return found

    def add_body(self, id: str, **keys: Any) -> Scene:
        """Adds a soft body. ``mesh``, ``young_pa``, ``poisson`` and ``density_kg_m3`` say what it is."""
        return self._add("body", id=id, **keys)

    def add_obstacle(self, id: str, **keys: Any) -> Scene:
        """Adds a rigid thing that stands still: ``half_space``, ``box``, ``sphere``, ``capsule`` or ``surface``."""
        return self._add("obstacle", id=id, **keys)

    def add_tool(self, id: str, **keys: Any) -> Scene:
        """Adds a tool with a ``shape``, moved along a ``path`` or by a client."""
        return self._add("tool", id=id, **keys)

    def add_cut(self, body: str, **keys: Any) -> Scene:
        """Adds a cut at the time ``at_s``, by ``sweep_m``, by ``path_m`` and ``depth_m``, or along a ``plane``."""
        return self._add("cut", body=body, **keys)

    def add_probe(self, id: str, body: str, point_m: Vector) -> Scene:
        """Adds a material point whose motion is recorded."""
        return self._add("probe", id=id, body=body, point_m=point_m)

    def fix(self, body: str, **keys: Any) -> Scene:
        """Holds the nodes of a body that lie in ``where``."""
        owner = next((b for b in self.bodies if b["id"] == body), None)
        if owner is None:
            raise unknown("body", body, [b["id"] for b in self.bodies], "the scene")
        fixes = [*owner.get("fix", []), _plain(keys)]
        number = self.bodies.index(owner)
        _schema.check({**owner, "fix": fixes}, _schema.definition("body"), f"body[{number}]")
        owner["fix"] = fixes
        return self

    def set(self, key: str, value: Any) -> Scene:
        """Sets one key, such as ``scene.set("body.block.young_pa", 5e3)``: entries of a list go by their names."""
        before = copy.deepcopy(self._data)
        parts, at, here = key.split("."), self._data, ""
        for part in parts[:-1]:
            here = f"{here}.{part}" if here else part
            inner: Any = at.setdefault(part, {}) if isinstance(at, dict) else None
            if isinstance(at, list):
                inner = next((entry for entry in at if entry.get("id") == part), None)
                if inner is None:
                    self._data = before
                    raise unknown(here.rsplit(".", 1)[0], part, [str(entry.get("id")) for entry in at], "the scene")
            at = inner
        if not isinstance(at, dict):
            self._data = before
            raise SceneError(key, "names no single value", hint="Name one key, such as body.block.young_pa")
        at[parts[-1]] = _plain(value)
        try:
            self.check(whole=False)
        except SceneError:
            self._data = before
            raise
        return self

    def check(self, whole: bool = True) -> None:
        """Checks all keys by the schema. ``whole`` lets the program ``scindo`` judge the scene as well: meshes, and
        what does not go together.

        Raises:
            SceneError: something is wrong; ``path`` names the key.
            ProgramNotFound: there is no program on this machine.
        """
        _schema.check(self._data)
        if whole:
            with tempfile.TemporaryDirectory(prefix="scindo-") as scratch:
                check_file(self.save(pathlib.Path(scratch) / "scene.json"))

    def to_dict(self) -> Dict[str, Any]:
        """A copy of the keys of the scene file."""
        return copy.deepcopy(self._data)

    def save(self, path: Path) -> pathlib.Path:
        """Writes the scene as JSON, which the program reads as it reads TOML. Paths of meshes become absolute."""
        file = pathlib.Path(path)
        if file.suffix.lower() != ".json":
            raise SceneError(str(file), "is no name of a JSON file", hint="Let it end with .json")
        file.write_text(json.dumps(_absolute(self._data, self.folder), indent=1) + "\n", encoding="utf-8")
        return file

    def _add(self, kind: str, **keys: Any) -> Scene:
        entries: List[Dict[str, Any]] = self._data.get(kind, [])
        entry = _plain(keys)
        path = f"{kind}[{len(entries)}]"
        _schema.check(entry, _schema.definition(kind), path)
        if "id" in entry and any(other.get("id") == entry["id"] for other in entries):
            raise SceneError(
                f"{path}.id", f"there is a {kind} '{entry['id']}' already", hint="Give each a name of its own"
            )
        self._data[kind] = [*entries, entry]
        return self


def _plain(value: Any) -> Any:
    """``value`` as JSON knows it: arrays and tuples become lists, keys without a value are left out."""
    if isinstance(value, dict):
        return {str(key): _plain(inner) for key, inner in value.items() if inner is not None}
    if isinstance(value, (list, tuple)):
        return [_plain(inner) for inner in value]
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, pathlib.PurePath):
        return str(value)
    return value


def _absolute(value: Any, folder: pathlib.Path) -> Any:
    if isinstance(value, dict):
        return {
            key: str((folder / inner).resolve())
            if key in _FILES and isinstance(inner, str)
            else _absolute(inner, folder)
            for key, inner in value.items()
        }
    return [_absolute(inner, folder) for inner in value] if isinstance(value, list) else value


def _toml(text: str) -> Dict[str, Any]:
    try:
        import tomllib
    except ModuleNotFoundError:
        try:
            import tomli as tomllib  # type: ignore[import-not-found, no-redef]
        except ModuleNotFoundError:
            raise SceneError("", "TOML needs Python 3.11 or the package tomli", hint="pip install tomli") from None
    return dict(tomllib.loads(text))
