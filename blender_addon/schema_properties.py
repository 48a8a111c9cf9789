"""Property groups made from the format's schema: one group a kind, one property a key.

A key counts as given in the file when its property is set; *Unset* in a property's context menu takes
it back to the default. Keys that a transform or a child object states (`PLACED`) have no property.
"""

from __future__ import annotations

import json
import re
from functools import cache

import bpy

from .decimals import decimal, decimals
from .ligature.adf.schema import SCHEMA, Key, Status, Type

_SHAPES = (
    "shape", "geometry", "compound shape", "collision shape", "collision geometry", "collision offset",
    "compound collision shape",
)  # fmt: skip
PLACED = {
    "body": (*_SHAPES, "location", "inertial offset", "parent"),
    "soft body": (*_SHAPES, "location", "parent"),
    "ghost object": (*_SHAPES, "location", "inertial offset", "parent"),
    "sensor": ("location", "parent"),
    "actuator": ("location", "parent"),
    "volume": ("location", "parent"),
    "suture": ("location", "parent"),
    "vehicle": ("parent",),
    "joint": (
        "parent", "child", "parent pivot", "child pivot", "parent axis", "child axis", "offset", "child offset",
        "joint offset",
    ),
    "camera": ("location", "look at", "up", "parent", "field view angle", "clipping plane"),
    "light": ("location", "direction", "parent", "cutoff angle"),
    "launch": ("world config", "input devices config", "color config", "multibody configs"),
}  # fmt: skip
"""Keys, with those below them, that Blender's own data states."""

_NUMBERS = (Type.NUMBER, Type.NUMBER_OR_MAP)
_WHOLE = (Type.INTEGER, Type.UNSIGNED)
_SUBTYPES = {"m": ("DISTANCE", "LENGTH"), "rad": ("ANGLE", "ROTATION"), "kg": ("NONE", "MASS")}
SHOWN_UNITS = tuple(_SUBTYPES)
"""Units that Blender shows beside a number by itself."""

_GROUPS: dict[str, type] = {}


@cache
def identifier(path: str) -> str:
    """The property's name for the key at a dotted path."""
    return re.sub(r"[^a-z0-9]+", "_", path.lower()).strip("_")


def keys_of(kind: str) -> list[Key]:
    """The keys of a kind that have properties."""
    return [key for key in SCHEMA[kind] if "[]" not in key.path and _has_property(kind, key)]


def _has_property(kind: str, key: Key) -> bool:
    placed = PLACED.get(kind, ())
    if key.status is Status.IGNORED or any(key.path == p or key.path.startswith(f"{p}.") for p in placed):
        return False
    return key.type not in (Type.MAP, Type.MATRIX, Type.ANY) and not (
        key.type is Type.TEXTS and kind in ("model", "world", "input devices")
    )


def group_class(kind: str) -> type:
    """The property group of a kind; made once."""
    if kind not in _GROUPS:
        _make(kind, "", "ADF_PG_" + identifier(kind))
    return _GROUPS[kind]


def classes() -> list[type]:
    """Every generated class, those of list items before the groups that hold them."""
    for kind in SCHEMA:
        group_class(kind)
    return list(_GROUPS.values())


def _make(kind: str, prefix: str, name: str) -> type:
    annotations: dict[str, object] = {}
    for key in SCHEMA[kind]:
        path = key.path[len(prefix) :]
        if not key.path.startswith(prefix) or "[]" in path or not _has_property(kind, key):
            continue
        if key.type is Type.MAPS:
            item = _make(kind, f"{key.path}[].", f"{name}_{identifier(path)}")
            annotations[identifier(path)] = bpy.props.CollectionProperty(type=item, **_words(key))
        else:
            annotations.update(_properties(key, path))
    made = type(name, (bpy.types.PropertyGroup,), {"__annotations__": annotations, "__doc__": f"Keys of a {kind}."})
    _GROUPS[f"{kind}:{prefix}" if prefix else kind] = made
    return made


def _words(key: Key) -> dict[str, str]:
    title = key.name.replace("_", " ")
    title = " ".join(word if word.isupper() else word[:1].upper() + word[1:] for word in title.split())
    text = key.doc[:1].upper() + key.doc[1:] if key.doc else key.path
    return {"name": title, "description": text.rstrip(".")}


def _properties(key: Key, path: str) -> dict[str, object]:
    name, words = identifier(path), _words(key)
    if key.type in _NUMBERS:
        subtype, unit = _SUBTYPES.get(key.unit, ("NONE", "NONE"))
        limits = {} if key.least is None else {"min": key.least}
        return {
            name: bpy.props.FloatProperty(
                default=float(key.default or 0.0), subtype=subtype, unit=unit, precision=5, **limits, **words
            )
        }
    if key.type in _WHOLE:
        least = {"min": 0} if key.type is Type.UNSIGNED else {}
        return {name: bpy.props.IntProperty(default=int(key.default or 0), **least, **words)}
    if key.type is Type.FLAG:
        return {name: bpy.props.BoolProperty(default=bool(key.default), **words)}
    if key.type is Type.CHOICE:
        choices = sorted(set(key.choices.values()))
        items = [(choice, choice.replace("_", " ").title(), key.doc or choice) for choice in choices]
        default = {"default": key.default} if key.default in choices else {}
        return {name: bpy.props.EnumProperty(items=items, **default, **words)}
    if key.type in (Type.VECTOR, Type.RPY):
        subtype = "XYZ" if key.type is Type.VECTOR else "EULER"
        return {
            name: bpy.props.FloatVectorProperty(
                size=3, default=key.default or (0.0, 0.0, 0.0), subtype=subtype, **words
            )
        }
    if key.type is Type.POSE:
        return {
            f"{name}_position": bpy.props.FloatVectorProperty(size=3, subtype="TRANSLATION", **words),
            f"{name}_orientation": bpy.props.FloatVectorProperty(size=3, subtype="EULER", **words),
        }
    if key.type in (Type.TEXTS, Type.INTEGERS):
        words["description"] += " (separated by commas)"
        return {name: bpy.props.StringProperty(**words)}
    return {name: bpy.props.StringProperty(default=str(key.default or ""), **words)}


def store(group: bpy.types.PropertyGroup, kind: str, values: dict, prefix: str = "") -> None:
    """Set the properties of a group from typed values by path; other keys are left unset."""
    for key in _keys_below(kind, prefix):
        path = key.path[len(prefix) :]
        if path not in values or values[path] is None:
            continue
        name, value = identifier(path), values[path]
        if key.type is Type.MAPS:
            items = getattr(group, name)
            items.clear()
            for item in value:
                store(items.add(), kind, item, f"{key.path}[].")
        elif key.type is Type.POSE:
            setattr(group, f"{name}_position", value[0])
            setattr(group, f"{name}_orientation", value[1])
        elif key.type in (Type.TEXTS, Type.INTEGERS):
            setattr(group, name, ", ".join(map(str, value)))
        else:
            setattr(group, name, value)


def fetch(group: bpy.types.PropertyGroup, kind: str, prefix: str = "") -> dict:
    """The typed value of every property that is set, by path."""
    values: dict = {}
    for key in _keys_below(kind, prefix):
        path = key.path[len(prefix) :]
        name = identifier(path)
        if key.type is Type.POSE:
            if group.is_property_set(f"{name}_position") or group.is_property_set(f"{name}_orientation"):
                values[path] = (
                    decimals(getattr(group, f"{name}_position")),
                    decimals(getattr(group, f"{name}_orientation")),
                )
        elif key.type is Type.MAPS:
            if len(getattr(group, name)):
                values[path] = tuple(fetch(item, kind, f"{key.path}[].") for item in getattr(group, name))
        elif group.is_property_set(name):
            values[path] = _typed(key, getattr(group, name))
    return values


@cache
def unheld_paths(kind: str) -> list[str]:
    """Keys that neither properties nor placing hold: they stay as the file has them."""
    held = {key.path for key in keys_of(kind)}
    placed = PLACED.get(kind, ())
    return [
        key.path
        for key in SCHEMA[kind]
        if key.path not in held and not any(key.path == p or key.path.startswith(f"{p}.") for p in placed)
    ]


def unheld(kind: str, values: dict) -> dict:
    """The values of `unheld_paths` among all ``values`` of an object in the file."""
    return {path: values[path] for path in unheld_paths(kind) if path in values}


@cache
def unheld_in_lists(kind: str) -> frozenset[str]:
    """Keys of items of lists that neither properties nor placing hold: they stay as the file has them."""
    placed = PLACED.get(kind, ())
    return frozenset(
        key.path
        for key in SCHEMA[kind]
        if "[]" in key.path and not any(key.path.startswith(f"{p}[]") for p in placed) and not _has_property(kind, key)
    )


def unset(group: bpy.types.PropertyGroup, name: str) -> None:
    """Take a key out of the file: its property shows the default again."""
    group.property_unset(name)


@cache
def _keys_below(kind: str, prefix: str) -> list[Key]:
    return [
        key
        for key in SCHEMA[kind]
        if key.path.startswith(prefix) and "[]" not in key.path[len(prefix) :] and _has_property(kind, key)
    ]


def _typed(key: Key, value: object) -> object:
    if key.type in _NUMBERS:
        return decimal(value)
    if key.type in (Type.VECTOR, Type.RPY):
        return decimals(value)
    if key.type is Type.TEXTS:
        return tuple(part.strip() for part in value.split(",") if part.strip())
    if key.type is Type.INTEGERS:
        return tuple(int(part) for part in value.split(",") if part.strip().lstrip("-").isdigit())
    return value


def state_text(state: dict) -> str:
    """A state of plain values as text, for a hidden property."""
    return json.dumps(state, separators=(",", ":"))
