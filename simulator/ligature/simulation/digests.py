"""Digests of scenes and states, by which those that are equal are recognised."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from ligature.model.scene import Scene
from ligature.model.state import StateRecord


def scene_digest(scene: Scene, state: StateRecord, dt: float) -> str:
    """SHA-256 of what a snapshot stands for: the objects of a scene in their order, how many, and seconds a tick."""
    objects = (scene.bodies, scene.joints, scene.ghosts, scene.sensors, scene.actuators, scene.cameras, scene.lights)
    names = [[item.identity.identifier for item in items] for items in objects]
    arms = [arm.name for arm in scene.arms]
    return hashlib.sha256(repr((names, arms, state.dtype.descr, dt)).encode("utf-8", "surrogatepass")).hexdigest()


def state_digest(state: StateRecord, left_out: Iterable[str], snapshots: Iterable[Any]) -> str:
    """SHA-256 of a state record but for the fields ``left_out``, and of the ``snapshots`` of subsystems."""
    digest = hashlib.sha256()
    for name in sorted({*(state.dtype.names or ())} - {*left_out}):
        digest.update(np.ascontiguousarray(state[name]).tobytes())
    for snapshot in snapshots:
        _digest(snapshot, digest.update)
    return digest.hexdigest()


def _digest(value: Any, update: Callable[[bytes], object]) -> None:
    """Feed nested dicts, sequences and arrays of a snapshot to a hash."""
    if isinstance(value, Mapping):
        for name in sorted(value):
            _digest(value[name], update)
    elif isinstance(value, list | tuple):
        for item in value:
            _digest(item, update)
    elif is_dataclass(value):
        _digest([getattr(value, field.name) for field in fields(value)], update)
    else:
        array = np.ascontiguousarray(value)
        if array.dtype.hasobject:
            raise TypeError(f"a snapshot contains a {type(value).__name__}, which has no bytes to compare")
        update(array.tobytes())
