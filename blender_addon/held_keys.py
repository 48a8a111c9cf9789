"""Which keys of the format are properties, which Blender's own data states, and which stay as the file has them.

Nothing of Blender.
"""

from __future__ import annotations

from functools import cache

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


def keys_of(kind: str) -> list[Key]:
    """The keys of a kind that have properties."""
    return [key for key in SCHEMA[kind] if "[]" not in key.path and has_property(kind, key)]


def has_property(kind: str, key: Key) -> bool:
    """Whether a key has a property: it is of a type that Blender edits, and has an effect."""
    placed = PLACED.get(kind, ())
    if key.status is Status.IGNORED or any(key.path == p or key.path.startswith(f"{p}.") for p in placed):
        return False
    return key.type not in (Type.MAP, Type.MATRIX, Type.ANY) and not (
        key.type is Type.TEXTS and kind in ("model", "world", "input devices")
    )


@cache
def keys_below(kind: str, prefix: str) -> list[Key]:
    """The keys that have properties in the group of a kind, or of the items of its list at ``prefix``."""
    return [
        key
        for key in SCHEMA[kind]
        if key.path.startswith(prefix) and "[]" not in key.path[len(prefix) :] and has_property(kind, key)
    ]


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
        if "[]" in key.path and not any(key.path.startswith(f"{p}[]") for p in placed) and not has_property(kind, key)
    )
