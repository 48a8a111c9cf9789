"""The scene in 3D: looks are sent once, then poses of what moved, threads as tubes and tissue. World axes, metres."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from viser import ViserServer

from ligature.cockpit.lighting import LightStage, distance_of_work
from ligature.cockpit.looks import body_looks, thread_colour
from ligature.cockpit.tissue import TissueStage
from ligature.model.frames import pose7_matrix
from ligature.model.poses import pose7_matrices
from ligature.model.scene import ArmKind, Scene
from ligature.model.state import new_state
from ligature.render.thread import Tube
from ligature.robots.fitting import base_pose, kinematics_of
from ligature.robots.psm_arm import HOME

Array = NDArray[np.float64]

STILL, UNTURNED = 2e-5, 2e-4
"""Metres, and differences of quaternions, below which a body counts as not moved: less than a pixel."""

TUBE_POINTS, TUBE_SIDES = 2, 6
"""Of the drawn thread: a tenth of what pictures have, since it is sent anew whenever it moves."""

AIM_COLOUR, AIM_THICKNESS = (255, 212, 59), 0.0004
"""Of the line from a tip to where it has to go, in metres."""

VIEW_ANGLE = 0.8
"""Vertical field of view of a page in radians."""


ROOM = 1.25
"""Factor by which the first viewpoint is farther away than the extent of the objects requires."""


class Stage:
    """What the page shows in 3D; `update` takes states."""

    def __init__(self, server: ViserServer, scene: Scene) -> None:
        self._server, self._scene = server, scene
        self._nodes = {
            owner: server.scene.add_glb(
                f"/scene/{owner}", data, cast_shadow=not _rests(scene, owner), receive_shadow=_rests(scene, owner)
            )
            for owner, data in body_looks(scene).items()
        }
        self._endoscope = [self._nodes[owner] for owner in endoscope(scene) if owner in self._nodes]
        self._owners = np.array(sorted(self._nodes), dtype=int)
        self._shown = np.full((len(self._owners), 7), np.inf)
        bodies = np.array([body.T_world_body for body in scene.bodies]).reshape(-1, 4, 4)
        self._tubes = [Tube(scene, rod, TUBE_POINTS, TUBE_SIDES) for rod in scene.rods]
        self._threads = []
        for rod, tube in zip(scene.rods, self._tubes, strict=True):
            surface = tube.triangles(bodies)
            self._threads.append(
                server.scene.add_mesh_simple(
                    f"/threads/{rod.name}", surface.positions.astype(np.float32), surface.faces.astype(np.uint32),
                    color=thread_colour(scene, rod.bodies[0]), side="double", receive_shadow=False,
                )
            )  # fmt: skip
        self._tissues = TissueStage(server, scene)
        begin = new_state(scene)
        self._lights = LightStage(server, scene, distance_of_work(scene, begin, work_place(scene, begin)))
        self._rod_poses = [np.full((len(rod.bodies), 7), np.inf) for rod in scene.rods]
        self._aim = server.scene.add_line_segments(
            "/aim", np.zeros((1, 2, 3), np.float32), AIM_COLOUR, thickness=AIM_THICKNESS, visible=False
        )
        self.sent = 0

    def update(self, state: NDArray[np.void]) -> None:
        """Show ``state`` (1,): sends what moved since the last time."""
        poses = np.concatenate([state["body_pose"][0], state["ghost_world"][0]])
        with self._server.atomic():
            self._move(poses[self._owners])
            self._bend(poses)
            self.sent += self._tissues.update(state) + self._lights.update(state)

    def show_aim(self, ends: tuple[Array, Array] | None) -> None:
        """Show a line between two places, (3,) each, or none."""
        if (ends is not None) != self._aim.visible:
            self._aim.visible = ends is not None
        if ends is not None and np.abs(self._aim.points[0] - ends).max() > STILL:
            self._aim.points = np.array([ends], np.float32)

    def show_endoscope(self, shown: bool) -> None:
        """Show the endoscope's tube, or hide it: it may stand before what is worked on."""
        for node in self._endoscope:
            node.visible = shown

    def _move(self, poses: Array) -> None:
        moved = (np.abs(poses[:, :3] - self._shown[:, :3]).max(axis=1) > STILL) | (
            np.abs(poses[:, 3:] - self._shown[:, 3:]).max(axis=1) > UNTURNED
        )
        for row in np.flatnonzero(moved):
            x, y, z, qx, qy, qz, qw = poses[row].tolist()
            node = self._nodes[int(self._owners[row])]
            node.position, node.wxyz = (x, y, z), (qw, qx, qy, qz)
            self._shown[row] = poses[row]
            self.sent += 1

    def _bend(self, poses: Array) -> None:
        for rod, tube, node, shown in zip(self._scene.rods, self._tubes, self._threads, self._rod_poses, strict=True):
            now = poses[list(rod.bodies)]
            if np.abs(now[:, :3] - shown[:, :3]).max() > STILL:
                shown[:] = now
                T = pose7_matrices(poses[: len(self._scene.bodies)])
                node.vertices = tube.triangles(T).positions.astype(np.float32)
                self.sent += 1


def _rests(scene: Scene, owner: int) -> bool:
    """Whether a body receives shadows; moving bodies cast them. None does both: a shadow map is too coarse."""
    return owner < len(scene.bodies) and scene.bodies[owner].static


def endoscope(scene: Scene) -> set[int]:
    """Indices of the bodies that carry cameras."""
    parents = [camera.attachment.parent for camera in scene.cameras]
    return {parent[1] for parent in parents if parent is not None and parent[0] == "body"}


def work_place(scene: Scene, state: NDArray[np.void]) -> Array:
    """Where the work is (3,): the middle of threads, else of needles, else of what can move."""
    loose = _worked_on(scene)
    places = state["body_pose"][0, loose, :3] if loose else np.zeros((1, 3))
    return 0.5 * (np.min(places, axis=0) + np.max(places, axis=0))  # type: ignore[no-any-return]


def _worked_on(scene: Scene) -> list[int]:
    """The bodies that the view is centred on: threads, else needles, else all that can move."""
    needles = [needle.body for needle in scene.needles]
    return [*scene.rod_bodies] or needles or [body.index for body in scene.bodies if not body.static]


def first_view(scene: Scene, state: NDArray[np.void]) -> tuple[Array, Array, Array]:
    """Where a browser looks from at first, at what, and what is up, each (3,).

    As the scene's first camera looks, but from so far that threads and the tips of arms that are at home are seen.
    """
    loose = _worked_on(scene)
    places = [*state["body_pose"][0, loose, :3]]
    if scene.tissues:
        nodes = state["tissue_node"][0]
        places += [nodes.min(axis=0), nodes.max(axis=0)]
    for arm in scene.arms:
        if arm.kind is ArmKind.PSM:
            places.append((base_pose(scene, arm) @ kinematics_of(scene, arm).forward(HOME))[:3, 3])
    places = places or [np.zeros(3)]
    low, high = np.min(places, axis=0), np.max(places, axis=0)
    target = 0.5 * (low + high)
    distance = ROOM * max(0.5 * float(np.linalg.norm(high - low)), 0.02) / np.sin(VIEW_ANGLE / 2)
    cameras = [camera.index for camera in scene.cameras if camera.visible]
    T = pose7_matrix(state["camera_world"][0, cameras[0]]) if cameras else np.eye(4)
    return target + distance * T[:3, 0], target, T[:3, 2]
