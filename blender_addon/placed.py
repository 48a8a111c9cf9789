"""Where an object stands, as plain data, and what of it has changed since the import; nothing of Blender.

Poses are (4, 4); metres and radians.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .ligature.authoring.shapes import Shape

State = dict[str, list]
"""Numbers and texts by the group of keys that they decide."""

ZERO = (0.0, 0.0, 0.0)
MOVED, NOISE = 2e-6, 5e-7
"""Differences of rotation entries, and of places as a share of their size, that single precision leaves."""

SHAPE_LENGTH, POSE_LENGTH = 11, 12
"""Entries of a shape and of its pose in a state."""


@dataclass(frozen=True, eq=False)
class JointFrames:
    """A joint between two bodies: its pose and the child's in the parent, both inertial frames, and both scales.

    ``reach`` is the greatest coordinate behind these poses.
    """

    T_parent_joint: np.ndarray
    T_parent_child: np.ndarray
    inertial: tuple[np.ndarray, np.ndarray]
    scales: tuple[float, float]
    kind: str
    reach: float = 0.0


@dataclass(frozen=True, eq=False)
class PlacedShape:
    """A primitive in its owner; ``order`` is its place in the list that it was read from."""

    shape: Shape
    T_owner: np.ndarray
    order: int


@dataclass(frozen=True, eq=False)
class Placed:
    """What the transform, children and data of an object of this ``kind`` state.

    Attributes
    ----------
    parent, ends
        How the file names the owner of the object, or both bodies of a joint.
    T
        The object's pose in its owner, or in the world without one; a body's always in the world.
    reach
        The greatest coordinate that ``T`` was computed from; 0 where Blender stores ``T`` itself.
    far
        The greatest coordinate of the object and its owner in the world, from which a user put one onto the other.
    frames
        Of a joint between two bodies.
    lens, cone
        Of a camera: opening, near and far; of a lamp: opening.
    inertial, shapes
        Of what has a shape: the inertial frame if it has one, primitives for "COLLISION" and "VISUAL".
    """

    kind: str
    parent: str = ""
    ends: tuple[str, str] | None = None
    T: np.ndarray | None = None
    reach: float = 0.0
    far: float = 0.0
    frames: JointFrames | None = None
    lens: tuple[float, float, float] | None = None
    cone: float | None = None
    inertial: np.ndarray | None = None
    shapes: dict[str, list[PlacedShape]] = field(default_factory=dict)

    def state(self) -> State:
        """What the keys of the object follow from.

        Compared with the state just after the import it shows what has changed since.
        """
        if self.ends is not None:
            state: State = {"ends": [*self.ends]}
            if self.frames is not None:
                state["frames"] = [*entries_of(self.frames.T_parent_joint), *entries_of(self.frames.T_parent_child)]
            elif self.T is not None:
                state["pose"] = entries_of(self.T)
            return state
        state = {"pose": entries_of(self.T), "parent": [self.parent]}
        if self.lens is not None:
            state["lens"] = [*self.lens]
        if self.cone is not None:
            state["cone"] = [self.cone]
        if self.shapes:
            state["inertial"] = [] if self.inertial is None else entries_of(self.inertial)
            for use, shapes in self.shapes.items():
                state[use] = [part for s in shapes for part in (*shape_state(s.shape), *entries_of(s.T_owner))]
        return state


def shape_state(shape: Shape) -> list:
    """The entries of a shape in a state."""
    return [shape.kind, *shape.size, shape.radius, shape.height, shape.axis, *shape.normal, shape.offset]


def entries_of(matrix: np.ndarray) -> list[float]:
    """The entries of a pose in a state."""
    return [round(float(v), 9) for v in matrix[:3].ravel()]


def pose_of(entries: list[float]) -> np.ndarray:
    """The pose of `entries_of`."""
    return np.vstack([np.reshape(entries, (3, 4)), [0.0, 0.0, 0.0, 1.0]])


def unchanged_groups(imported: dict[str, list] | None, state: dict[str, list]) -> set[str]:
    """The groups of keys that have not changed since the object was imported; none for an object made in Blender."""
    if imported is None:
        return set()
    return {group for group in (*_GROUPS, *state) if equal_entries(imported.get(group), state.get(group), group)}


_GROUPS = ("ends", "frames", "pose", "parent", "lens", "cone", "inertial", "COLLISION", "VISUAL")


def equal_entries(before: list | None, now: list | None, group: str = "") -> bool:
    """Whether the entries of a group state the same, but for what single precision leaves of poses."""
    if before is None or now is None or len(before) != len(now):
        return before is None and now is None
    allowed = _allowances(before, now, group)
    for a, b, most in zip(before, now, allowed, strict=True):
        if isinstance(a, str) or isinstance(b, str):
            if a != b:
                return False
        elif abs(a - b) > most:
            return False
    return True


def _allowances(before: list, now: list, group: str) -> list[float]:
    """How much each entry may differ: numbers by their own size, poses by the size of their place."""
    if group == "frames":  # of two objects that may both be far away
        return [MOVED * max(1.0, abs(a)) for a in before]
    if group in ("pose", "inertial"):
        return _pose_allowances(before, now)
    if group not in ("COLLISION", "VISUAL"):
        return [0.0 if isinstance(a, str) else MOVED * max(1e-6, abs(a)) for a in before]
    allowed: list[float] = []
    for start in range(0, len(before), SHAPE_LENGTH + POSE_LENGTH):
        middle, end = start + SHAPE_LENGTH, start + SHAPE_LENGTH + POSE_LENGTH
        allowed += _allowances(before[start:middle], now[start:middle], "")
        allowed += _pose_allowances(before[middle:end], now[middle:end])
    return allowed


def _pose_allowances(before: list, now: list) -> list[float]:
    far = max((abs(v) for pose in (before, now) for v in pose[3::4]), default=0.0)
    return [NOISE * max(far, 1e-2) if i % 4 == 3 else MOVED for i in range(len(before))]
