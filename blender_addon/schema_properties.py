"""Property groups made from the format's schema: one group a kind, one property a key.

A key counts as given in the file when its property is set; *Unset* in a property's context menu takes
it back to the default. `held_keys` says which keys have a property.
"""

from __future__ import annotations

import json
import re
from functools import cache

import bpy

from .decimals import decimal, decimals
from .held_keys import has_property, keys_below
from .ligature.adf.schema import SCHEMA, Key, Type

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
        if not key.path.startswith(prefix) or "[]" in path or not has_property(kind, key):
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
    for key in keys_below(kind, prefix):
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
    for key in keys_below(kind, prefix):
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


def unset(group: bpy.types.PropertyGroup, name: str) -> None:
    """Take a key out of the file: its property shows the default again."""
    group.property_unset(name)


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
