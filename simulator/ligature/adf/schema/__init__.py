"""The one table of the format: every key of every kind of object, its type, unit, default and meaning.

Reader, checker, writer and the support table in ``docs/adf.md`` are generated from it.
"""

from ligature.adf.schema.attached import ACTUATOR, CAMERA, CLIPPING, LIGHT, MOST_RAYS, SENSOR, VOLUME
from ligature.adf.schema.blocks import SHAPE_KEYS
from ligature.adf.schema.bodies import BODY, GHOST, JOINT, SOFT_BODY, SUTURE, VEHICLE
from ligature.adf.schema.files import DEVICES, INPUT_DEVICE, LAUNCH, LISTS, MODEL, PLURALS, WORLD
from ligature.adf.schema.keys import Fault, Key, Status, Type

SCHEMA: dict[str, tuple[Key, ...]] = {
    "launch": LAUNCH,
    "world": WORLD,
    "model": MODEL,
    "input devices": DEVICES,
    "body": BODY,
    "joint": JOINT,
    "ghost object": GHOST,
    "sensor": SENSOR,
    "actuator": ACTUATOR,
    "camera": CAMERA,
    "light": LIGHT,
    "soft body": SOFT_BODY,
    "vehicle": VEHICLE,
    "volume": VOLUME,
    "suture": SUTURE,
    "input device": INPUT_DEVICE,
}
NOT_SIMULATED = {"vehicle"}
"""Kinds that are read and validated, and reported as not simulated."""

BY_PATH: dict[str, dict[str, Key]] = {kind: {key.path: key for key in keys} for kind, keys in SCHEMA.items()}
"""The rows of `SCHEMA` by kind and path."""

__all__ = [
    "BY_PATH",
    "CLIPPING",
    "LISTS",
    "MOST_RAYS",
    "NOT_SIMULATED",
    "PLURALS",
    "SCHEMA",
    "SHAPE_KEYS",
    "Fault",
    "Key",
    "Status",
    "Type",
]
