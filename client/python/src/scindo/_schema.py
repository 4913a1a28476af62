"""Checks a scene by the JSON Schema that the program publishes (``scindo check --schema``).

It knows the words of JSON Schema that this schema uses, and says what an author needs: the key, the value, the range,
the nearest word. A word that it does not know is an error in :func:`words`, which the tests call.
"""

from __future__ import annotations

import json
import math
import re
from functools import lru_cache
from importlib import resources
from typing import Any, Dict, List, Optional

from .errors import SceneError, nearest

Schema = Dict[str, Any]

_TYPES = {
    "object": dict,
    "array": list,
    "string": str,
    "boolean": bool,
    "null": type(None),
    "integer": int,
    "number": (int, float),
}
# They say something to people, or to code generators.
_SILENT = {"description", "title", "default", "format", "x-next", "$schema", "$defs"}
_CHECKED = {
    "type", "const", "properties", "additionalProperties", "required", "items", "minItems", "maxItems", "minLength",
    "maxLength", "pattern", "minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum", "anyOf", "oneOf", "$ref",
}  # fmt: skip


@lru_cache(maxsize=1)
def schema() -> Schema:
    """The schema of scenes, as it was when this package was made."""
    text = resources.files(__package__).joinpath("schema.json").read_text(encoding="utf-8")
    loaded: Schema = json.loads(text)
    return loaded


def words(part: Schema) -> None:
    """Fails if the schema uses a word that :func:`check` does not know."""
    for word, value in part.items():
        if word not in _SILENT | _CHECKED:
            raise NotImplementedError(f"the schema uses '{word}', which scindo/_schema.py does not check")
        if word in ("properties", "$defs"):
            for inner in value.values():
                words(inner)
        elif word in ("anyOf", "oneOf"):
            for inner in value:
                words(inner)
        elif word in ("items",):
            words(value)
    for inner in part.get("$defs", {}).values():
        words(inner)


def definition(name: str) -> Schema:
    """The part of the schema for one entry of the list ``name``, such as ``body``."""
    items: Schema = schema()["properties"][name]["items"]
    return items


def check(value: Any, part: Optional[Schema] = None, path: str = "") -> None:
    """Fails with a :class:`SceneError` that names the first key that breaks the schema."""
    part = schema() if part is None else part
    if "$ref" in part:
        return check(value, schema()["$defs"][part["$ref"].rsplit("/", 1)[-1]], path)
    _check_type(value, part, path)
    if isinstance(value, dict):
        _check_object(value, part, path)
    elif isinstance(value, list):
        _check_array(value, part, path)
    elif isinstance(value, str):
        _check_text(value, part, path)
    elif isinstance(value, (int, float)) and not isinstance(value, bool):
        _check_number(value, part, path)
    if "const" in part and value != part["const"]:
        raise SceneError(path, f"{value!r} is not {part['const']!r}")
    for word in ("anyOf", "oneOf"):
        if word in part:
            _check_choice(value, part[word], path)


def _check_type(value: Any, part: Schema, path: str) -> None:
    stated = part.get("type")
    if stated is None:
        return
    names: List[str] = stated if isinstance(stated, list) else [stated]
    for name in names:
        right = isinstance(value, _TYPES[name])  # type: ignore[arg-type]
        if right and (name == "boolean" or not isinstance(value, bool)):
            return
    wanted = " or ".join(name for name in names if name != "null")
    raise SceneError(path, f"{_shown(value)} is no {wanted}", hint=_hint(part))


def _check_object(value: Dict[str, Any], part: Schema, path: str) -> None:
    properties = part.get("properties", {})
    strange = [key for key in value if key not in properties] if part.get("additionalProperties") is False else []
    if strange:
        close = nearest(strange[0], properties)
        hint = f"Did you mean '{close}'?" if close else f"There are: {', '.join(sorted(properties))}"
        raise SceneError(path, f"unknown key '{strange[0]}'", hint=hint)
    for key, inner in value.items():
        if key in properties:
            check(inner, properties[key], f"{path}.{key}" if path else key)
    missing = [key for key in part.get("required", []) if key not in value]
    if missing:
        known = properties.get(missing[0], {})
        raise SceneError(path, f"the key '{missing[0]}' is missing", hint=_hint(known))


def _check_array(value: List[Any], part: Schema, path: str) -> None:
    least, most = part.get("minItems", 0), part.get("maxItems", math.inf)
    if not least <= len(value) <= most:
        allowed = str(least) if least == most else f"{least} or more" if most == math.inf else f"{least} to {most}"
        raise SceneError(path, f"{len(value)} entries", hint=f"Give {allowed}")
    if "items" in part:
        for number, inner in enumerate(value):
            check(inner, part["items"], f"{path}[{number}]")


def _check_text(value: str, part: Schema, path: str) -> None:
    if not part.get("minLength", 0) <= len(value) <= part.get("maxLength", math.inf):
        most = part.get("maxLength")
        raise SceneError(
            path,
            f"{value!r} has {len(value)} characters",
            hint=f"Use {part.get('minLength', 0)} to {most}" if most else "Write a text",
        )
    # All patterns stand between ^ and $, which alone would let a line end pass.
    if "pattern" in part and not re.fullmatch(part["pattern"], value):
        hint = _hint(part) if "x-next" in part else "Names consist of a-z, 0-9, _ and -"
        raise SceneError(path, f"{value!r} does not match {part['pattern']}", hint=hint)


def _check_number(value: float, part: Schema, path: str) -> None:
    low, above = part.get("minimum", -math.inf), part.get("exclusiveMinimum", -math.inf)
    high, below = part.get("maximum", math.inf), part.get("exclusiveMaximum", math.inf)
    if math.isfinite(value) and low <= value <= high and above < value < below:
        return
    ends = [f"at least {low:g}" if low > -math.inf else "", f"more than {above:g}" if above > -math.inf else ""]
    ends += [f"at most {high:g}" if high < math.inf else "", f"less than {below:g}" if below < math.inf else ""]
    allowed = " and ".join(end for end in ends if end) or "finite"
    raise SceneError(path, f"{value:g} must be {allowed}", hint=_hint(part))


def _check_choice(value: Any, choices: List[Schema], path: str) -> None:
    """Words of a list, keys of which exactly one is given, or a value that may be missing."""
    if all("const" in choice for choice in choices):
        known = [str(choice["const"]) for choice in choices]
        if value not in known:
            close = nearest(str(value), known)
            raise SceneError(
                path,
                f"unknown word {_shown(value)}",
                hint=f"{f'Did you mean {close!r}? ' if close else ''}There are: {', '.join(known)}",
            )
        return
    if isinstance(value, dict) and all("required" in choice and len(choice) == 1 for choice in choices):
        keys = sorted({key for choice in choices for key in choice["required"]})
        fitting = [choice for choice in choices if all(value.get(key) is not None for key in choice["required"])]
        if len(fitting) != 1:
            given = [key for key in keys if value.get(key) is not None]
            raise SceneError(
                path, f"{' and '.join(given) or 'none'} of {', '.join(keys)} given", hint="Give exactly one"
            )
        return
    real = [choice for choice in choices if choice.get("type") != "null"]
    if value is None and len(real) < len(choices):
        return
    errors: List[SceneError] = []
    for choice in real:
        try:
            return check(value, choice, path)
        except SceneError as error:
            errors.append(error)
    # The one that came furthest is the one that was meant.
    raise max(errors, key=lambda error: len(error.path))


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _hint(part: Schema) -> str:
    text = str(part.get("x-next") or part.get("description", "")).replace("\n", " ")
    return text[:1].upper() + text[1:].rstrip(".")
