"""The mouse on a camera of the scene: it moves the camera itself, and the other one of a stereo pair with it.

World axes, metres and radians; camera frames look along -X, +Y is image right, +Z image up.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ligature.bus.codec import Message
from ligature.model.commands import PlaceCommand
from ligature.model.frames import inverse, matrix_pose7, pose7_matrix
from ligature.model.optics import stereo_partners
from ligature.model.scene import Scene
from ligature.render.viewpoint import Viewpoint

Array = NDArray[np.float64]
Motion = Callable[[Viewpoint, float, float], Viewpoint]
"""How a viewpoint goes right and up, as those of `Viewpoint`."""

HELD = 15
"""Pictures for which a camera is where the mouse has put it, wherever the state has it: commands take a while to come
back in the state."""


@dataclass
class _Drag:
    """A camera that the mouse has, and the transforms from the viewpoint to all cameras that go along."""

    camera: int
    viewpoint: Viewpoint
    offsets: dict[int, Array]
    idle: int = 0
    sim_time: float = 0.0


class Steering:
    """Moves cameras as a viewpoint moves; ``send`` takes the commands."""

    def __init__(self, scene: Scene, send: Callable[[Message], None]) -> None:
        self._send = send
        pairs = stereo_partners(scene)
        self._partners = pairs | {right: left for left, right in pairs.items()}
        self._drag: _Drag | None = None

    def move(
        self,
        state: NDArray[np.void],
        camera: int,
        distance: Callable[[], float],
        motion: Motion,
        right: float,
        up: float,
    ) -> None:
        """Move a camera that looks at something ``distance()`` metres away; ``right`` and ``up`` are in its picture."""
        drag = self._drag
        if drag is None or drag.camera != camera:
            drag = self._drag = self._take(state, camera, distance())
        axis = drag.offsets[camera][1:3, 1]  # image right in the viewpoint's picture: cameras may be rolled
        x, y = np.array([[axis[0], -axis[1]], [axis[1], axis[0]]]) @ (right, up)
        drag.viewpoint = motion(drag.viewpoint, float(x), float(y))
        drag.idle, drag.sim_time = 0, float(state["sim_time"][0])
        for index, pose in self._poses(drag).items():
            T_world_camera, T_parent_camera = (
                pose7_matrix(state[f][0, index]) for f in ("camera_world", "camera_pose")
            )
            T = T_parent_camera @ inverse(T_world_camera) @ pose
            self._send(PlaceCommand("camera", index, tuple(matrix_pose7(T).tolist())))

    def shown(self, state: NDArray[np.void]) -> Array:
        """Poses (n, 7) of all cameras: of the state, and of what the mouse has where it was put."""
        poses = state["camera_world"][0]
        drag = self._drag
        if drag is not None and drag.idle > HELD and state["sim_time"][0] != drag.sim_time:
            drag = self._drag = None  # while the run is paused, the state does not show what was commanded
        if drag is None:
            return poses  # type: ignore[no-any-return]
        drag.idle += 1
        poses = poses.copy()
        for index, T in self._poses(drag).items():
            poses[index] = matrix_pose7(T)
        return poses  # type: ignore[no-any-return]

    def let_go(self) -> None:
        """From now on cameras are where the state has them."""
        self._drag = None

    def _take(self, state: NDArray[np.void], camera: int, distance: float) -> _Drag:
        poses = state["camera_world"][0]
        viewpoint = Viewpoint.at(poses[camera], distance)
        T_view_world = inverse(pose7_matrix(viewpoint.pose))
        taken = [camera, *([self._partners[camera]] if camera in self._partners else [])]
        return _Drag(camera, viewpoint, {index: T_view_world @ pose7_matrix(poses[index]) for index in taken})

    @staticmethod
    def _poses(drag: _Drag) -> dict[int, Array]:
        T_world_view = pose7_matrix(drag.viewpoint.pose)
        return {index: T_world_view @ offset for index, offset in drag.offsets.items()}
