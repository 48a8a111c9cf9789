"""Reads a compiled MuJoCo model: names, poses in the reference configuration, which bodies stand for which."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from ligature.adf.frames import Array, frame, quaternion_matrix


def name_of(model: Any, kind: str, index: int) -> str:
    """The name of a thing of a kind, such as body or geom; its kind and number when it has none."""
    return str(getattr(model, kind)(index).name).replace("/", " ") or f"{kind}_{index}"


def names_of(model: Any, kind: str, indices: Iterable[int]) -> str:
    """Names in quotes, for messages."""
    return ", ".join(f"'{name_of(model, kind, index)}'" for index in indices)


def rest_poses(model: Any) -> list[Array]:
    """World pose (4, 4) of every body, by its MuJoCo index, in the reference configuration."""
    poses = [np.eye(4)]
    for body in range(1, model.nbody):
        T = frame(rotation(model.body_quat[body]), model.body_pos[body])
        poses.append(poses[int(model.body_parentid[body])] @ T)
    return poses


def rotation(quaternion: Array) -> Array:
    """Rotation of a quaternion w x y z."""
    w, x, y, z = (float(v) for v in quaternion)
    return quaternion_matrix(np.array([x, y, z, w]))


def is_static(model: Any, body: int) -> bool:
    """Whether a body is fixed to the world."""
    return int(model.body_weldid[body]) == 0


def owner_of(model: Any, body: int) -> int:
    """The body that stands for ``body``: itself, or the one that it is fixed to when it has no mass of its own."""
    while body and not model.body_jntnum[body] and not model.body_mass[body] and not is_static(model, body):
        body = int(model.body_parentid[body])
    return body


def inertial_frame(model: Any, body: int) -> Array:
    """The inertial frame that the converted body gets: none for one that stands still."""
    if is_static(model, body):
        return np.eye(4)
    return frame(rotation(model.body_iquat[body]), model.body_ipos[body])
