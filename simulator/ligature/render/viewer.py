"""What one window shows and does, without a window: views, picking and dragging, cameras that the mouse moves.

World axes, metres; mouse positions in pixels from the top left corner of the picture. Commands go out through the
`Controls`, which all windows share.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ligature.model.commands import BodyCommand, CommandType, PlaceCommand, Release
from ligature.model.frames import inverse, matrix_pose7, pose7_matrix
from ligature.model.optics import stereo_partners
from ligature.model.scene import Scene
from ligature.render import overlay
from ligature.render.camera import CameraView, perspective, view_matrix, view_of
from ligature.render.controls import TOGGLES, Controls
from ligature.render.steering import Motion, Steering
from ligature.render.viewpoint import Viewpoint

Array = NDArray[np.float64]

FREE_ANGLE = 0.8
"""Vertical field of view of the free viewpoint in radians."""

EYE_SHARE = 0.03
"""Distance of the eyes of the free viewpoint, as a part of its distance."""

MARK_SHARE = 0.06
"""Length of drawn axes, as a part of the distance to what is looked at."""

ORBIT_RATE, PAN_RATE, LOOK_RATE = 0.008, 0.0015, 0.004
"""Radians, parts of the distance, and radians, per pixel of the mouse."""

USUAL_DISTANCE = 0.2
"""Metres from a camera to what it looks at where its picture shows nothing in the middle."""

PULL_RATE = 2 * np.pi * 1.5
"""Natural frequency in rad/s of the spring between a dragged body and the mouse."""

MOST_PULL = 50.0
"""Largest force on a dragged body, in units of its mass: m/s²."""

HELP = (
    "drag: turn   right drag: move   middle drag: look around   wheel: nearer   Ctrl+drag: pull a body",
    "A: drive the next arm, then none   G: its jaw   Shift+drag: move   Shift+right drag: turn   Shift+wheel: away",
    "Space: pause   .: one update   Ctrl+R: reset bodies   Ctrl+V: reset cameras   V: next camera   F11: full screen",
    "M: the mouse moves the scene's camera, or leaves it for a free view   S: stereo side by side",
    "   ".join(f"{key}: {meaning}" for key, (_, meaning) in TOGGLES.items()),
)


@dataclass(frozen=True)
class Figures:
    """What is reported on the screen: frames a second, and simulated over wall time."""

    frame_rate: float = 0.0
    real_time_factor: float = 0.0


@dataclass(frozen=True, eq=False)
class _Hold:
    """A body that is pulled: the point held in its frame (3,), and the point of the mouse in world axes (3,)."""

    body: int
    point: Array
    target: Array
    depth: float


class Viewer:
    """Draws a scene for people, of ``camera`` at first; None is the free view."""

    def __init__(self, controls: Controls, camera: int | None) -> None:
        self._controls = controls
        self.scene = controls.scene
        self.camera = self._first = camera
        self.stereo = camera is not None and self.scene.cameras[camera].stereo is not None
        self._partners = stereo_partners(self.scene)
        self._cameras = visible_cameras(self.scene)
        self._steering = Steering(self.scene, controls.send)
        self._viewpoint, self._angle = Viewpoint(_middle(self.scene), 1.0), FREE_ANGLE
        self._mouse: Mapping[str, float] = {}
        self._hold: _Hold | None = None
        self._view: CameraView | None = None
        self._state: NDArray[np.void] | None = None

    # --- pictures ---------------------------------------------------------------------------

    def picture(self, state: NDArray[np.void], size: tuple[int, int], figures: Figures) -> NDArray[np.uint8]:
        """What the window shows of ``state`` (1,): (height, width, 3) for ``size`` (width, height)."""
        self._state = state
        self._places = self._steering.shown(state)
        if self.stereo:
            half = (size[0] // 2, size[1])
            left, right = self._eyes(half)
            self._view = left  # bodies are taken in the left half
            rgb = np.concatenate(
                [self._draw(state, left), self._draw(state, right), np.zeros((size[1], size[0] % 2, 3), np.uint8)],
                axis=1,
            )
        else:
            self._view = self._mono(size)
            rgb = self._draw(state, self._view)
        return overlay.draw_words(rgb, self._words(state, figures))

    def _draw(self, state: NDArray[np.void], view: CameraView) -> NDArray[np.uint8]:
        return overlay.draw_segments(self._controls.colours(state, view), self._segments(state), view)

    def _segments(self, state: NDArray[np.void]) -> list[overlay.Segment]:
        shown = self._controls.shown
        size = MARK_SHARE * self._reach(state)
        found = overlay.senses(self.scene, state, PAN_RATE * self._reach(state)) + overlay.plugin_lines(state)
        if "frames" in shown:
            found += overlay.frames(self.scene, state, size)
        if "joints" in shown:
            found += overlay.joint_axes(self.scene, state, size)
        if "contacts" in shown:
            found += overlay.contacts(state, 2.0 * size)[0]
        if "tension" in shown:
            found += overlay.tension(self.scene, state)[0]
        if self._hold is not None:
            T = pose7_matrix(state["body_pose"][0, self._hold.body])
            found.append((T[:3, :3] @ self._hold.point + T[:3, 3], self._hold.target, overlay.GREEN))
        return found

    def _words(self, state: NDArray[np.void], figures: Figures) -> list[str]:
        shown, arm = self._controls.shown, self._controls.arm.name
        view = "free view" if self.camera is None else self.scene.cameras[self.camera].identity.name
        view += ", moved by the mouse" if self._moves_camera else ""
        pace = "paused" if self._controls.paused else f"real-time factor {figures.real_time_factor:.2f}"
        view += f"   {arm}" if arm else ""
        words = [f"{view}   {figures.frame_rate:.0f} frames/s   {pace}   {float(state['sim_time'][0]):.2f} s"]
        if "tension" in shown:
            words.append(f"largest thread tension {overlay.tension(self.scene, state)[1]:.3g} N")
        if "contacts" in shown:
            words.append(f"largest contact force {overlay.contacts(state, 1.0)[1]:.3g} N")
        return words + (list(HELP) if "help" in shown else ["H: help"])

    # --- views ------------------------------------------------------------------------------

    def _mono(self, size: tuple[int, int]) -> CameraView:
        if self.camera is None:
            return self._free(self._viewpoint.pose, size)
        return view_of(self.scene.cameras[self.camera], self._places[self.camera], size)

    def _eyes(self, size: tuple[int, int]) -> tuple[CameraView, CameraView]:
        """Left and right: a pair of cameras, the eyes of a stereo camera, or two eyes at the free viewpoint."""
        cameras, index, poses = self.scene.cameras, self.camera, self._places
        if index is not None:
            for left, right in self._partners.items():
                if index in (left, right):
                    return view_of(cameras[left], poses[left], size), view_of(cameras[right], poses[right], size)
            if cameras[index].stereo is not None:
                left_eye, right_eye = (view_of(cameras[index], poses[index], size, eye) for eye in ("left", "right"))
                return left_eye, right_eye
        T = pose7_matrix(self._viewpoint.pose if index is None else poses[index])
        assert self._state is not None
        aside = 0.5 * EYE_SHARE * self._reach(self._state) * T[:3, 1]
        views = []
        for sign in (-1.0, 1.0):
            stand = T.copy()
            stand[:3, 3] += sign * aside
            views.append(self._free(matrix_pose7(stand), size))
        return views[0], views[1]

    def _free(self, pose: Array, size: tuple[int, int]) -> CameraView:
        near, far = 0.01 * self._viewpoint.distance, 100.0 * self._viewpoint.distance + 10.0
        projection = perspective(self._angle, size[0] / size[1], near, far)
        return CameraView(view_matrix(pose7_matrix(pose)), projection, near, far, *size)

    def _reach(self, state: NDArray[np.void]) -> float:
        """Metres from the eye to what is looked at."""
        if self.camera is None:
            return self._viewpoint.distance
        return float(np.clip(np.linalg.norm(self._places[self.camera, :3] - _middle(self.scene, state)), 0.05, 5.0))

    def next_camera(self) -> None:
        """Show the next visible camera of the scene, and after the last one the free view."""
        turn = [*self._cameras, None]
        self.camera = turn[(turn.index(self.camera) + 1) % len(turn)]

    def _leave_camera(self) -> None:
        """Take the free viewpoint to where the shown camera stands, turning about what it looks at."""
        if self.camera is not None and self._state is not None:
            self._viewpoint = Viewpoint.at(self._places[self.camera], self._ahead())
            self._angle = self.scene.cameras[self.camera].field_of_view
            self._mouse = self.scene.cameras[self.camera].mouse_multipliers
        self.camera = None

    def _ahead(self) -> float:
        """Metres to what is shown in the middle of the picture."""
        found = None if self._view is None else self._at(self._view.width // 2, self._view.height // 2)
        return USUAL_DISTANCE if found is None else found[2]

    # --- mouse ------------------------------------------------------------------------------

    @property
    def _moves_camera(self) -> bool:
        """Whether the mouse moves the shown camera of the scene, and not the free view."""
        return self._controls.moves_cameras and self.camera is not None

    def orbit(self, right: float, down: float) -> None:
        """Turn the view about what it shows by a mouse movement in pixels."""
        rate = ORBIT_RATE * self._multiplier("arcball")
        self._move(Viewpoint.orbit, rate * right, -rate * down)

    def pan(self, right: float, down: float) -> None:
        """Move the view by a mouse movement in pixels."""
        rate = PAN_RATE * self._multiplier("pan")
        self._move(Viewpoint.pan, rate * right, -rate * down)

    def look(self, right: float, down: float) -> None:
        """Turn the view where it stands by a mouse movement in pixels."""
        rate = LOOK_RATE * self._multiplier("rotate")
        self._move(Viewpoint.look, rate * right, -rate * down)

    def zoom(self, steps: float) -> None:
        """Go nearer by steps of the wheel."""
        nearer = steps * self._multiplier("scroll")
        self._move(lambda viewpoint, _right, _up: viewpoint.zoom(nearer), 0.0, 0.0)

    def _multiplier(self, name: str) -> float:
        """Factor of a motion of the mouse, of the camera that is shown or was left last."""
        found = self._mouse if self.camera is None else self.scene.cameras[self.camera].mouse_multipliers
        return found.get(name, 1.0)

    def _move(self, motion: Motion, right: float, up: float) -> None:
        """Move the camera of the scene, or leave it for the free view and move that."""
        if not self._moves_camera:
            self._leave_camera()
            self._viewpoint = motion(self._viewpoint, right, up)
        elif self._state is not None and self.camera is not None:
            self._steering.move(self._state, self.camera, self._ahead, motion, right, up)

    @property
    def holds(self) -> bool:
        """Whether a body is held."""
        return self._hold is not None

    def grab(self, x: float, y: float) -> str | None:
        """Take hold of the body at a pixel; its identifier, or None when nothing there can move."""
        found = self._at(int(x), int(y))
        if found is None or self._state is None:
            return None
        number, point, depth = found
        if number > len(self.scene.bodies) or self.scene.bodies[number - 1].static:
            return None
        body = self.scene.bodies[number - 1]
        T = pose7_matrix(self._state["body_pose"][0, body.index])
        self._hold = _Hold(body.index, T[:3, :3].T @ (point - T[:3, 3]), point, depth)
        return body.identity.identifier

    def drag(self, x: float, y: float) -> None:
        """Move what is held to a pixel, at the depth where it was taken."""
        if self._hold is not None and self._view is not None:
            self._hold = replace(self._hold, target=_point(self._view, x, y, self._hold.depth))

    def pull(self) -> None:
        """Command the force of the hold for the state shown last: a damped spring, and the body's weight."""
        if self._hold is None or self._state is None:
            return
        body = self.scene.bodies[self._hold.body]
        T = pose7_matrix(self._state["body_pose"][0, body.index])
        centre = (T @ body.T_body_inertial)[:3, 3]
        arm = T[:3, :3] @ self._hold.point + T[:3, 3] - centre
        twist = self._state["body_twist"][0, body.index]
        velocity = twist[:3] + np.cross(twist[3:], arm)
        acceleration = PULL_RATE**2 * (self._hold.target - centre - arm) - 2.0 * PULL_RATE * velocity
        acceleration *= min(1.0, MOST_PULL / max(float(np.linalg.norm(acceleration)), 1e-12))
        force = body.mass * acceleration
        wrench = (*(force - body.mass * body.gravity).tolist(), *np.cross(arm, force).tolist())
        self._controls.send(BodyCommand(body.index, CommandType.FORCE, wrench))

    def let_go(self) -> None:
        """Release what is held."""
        if self._hold is not None:
            self._controls.send(Release("body", self._hold.body))
        self._hold = None

    def _at(self, x: int, y: int) -> tuple[int, Array, float] | None:
        """Number, world point (3,) and depth of what is shown at a pixel; None for the background."""
        view, state = self._view, self._state
        if view is None or state is None or not (0 <= x < view.width and 0 <= y < view.height):
            return None
        frame = self._controls.distances(state, view)
        if frame.ids[y, x] == 0:
            return None
        depth = float(frame.depth[y, x])
        return int(frame.ids[y, x]), _point(view, x, y, depth), depth

    # --- an arm -----------------------------------------------------------------------------

    @property
    def arm(self) -> str:
        """Name of the arm that the mouse drives; empty for none."""
        return self._controls.arm.name

    def move_arm(self, right: float, down: float) -> None:
        """Move the arm's tip by a mouse movement in pixels."""
        if self._state is not None and self._view is not None:
            self._controls.arm.move(self._state, self._view, right, down)

    def turn_arm(self, right: float, down: float) -> None:
        """Turn the arm's tip by a mouse movement in pixels."""
        if self._state is not None and self._view is not None:
            self._controls.arm.turn(self._state, self._view, right, down)

    def advance_arm(self, notches: float) -> None:
        """Move the arm's tip away by notches of the wheel."""
        if self._state is not None and self._view is not None:
            self._controls.arm.advance(self._state, self._view, notches)

    # --- keys -------------------------------------------------------------------------------

    def key(self, key: str, control: bool = False) -> None:
        """A key: a letter, ``" "`` or ``"."``."""
        if control and key == "V":
            self._reset_cameras()
        elif key == "V":
            self.next_camera()
        elif key == "S" and not control:
            self.stereo = not self.stereo
        else:
            self._controls.key(key, control, self._state)

    def _reset_cameras(self) -> None:
        """Put the cameras, and the free view, back to where they were at the start."""
        for camera in self.scene.cameras:
            pose = matrix_pose7(camera.attachment.T_parent_object)
            self._controls.send(PlaceCommand("camera", camera.index, tuple(pose.tolist())))
        self._steering.let_go()
        self.camera = self._first
        self._viewpoint, self._angle = Viewpoint(_middle(self.scene), 1.0), FREE_ANGLE


def visible_cameras(scene: Scene) -> list[int]:
    """Indices of the cameras that windows show."""
    return [camera.index for camera in scene.cameras if camera.visible]


def _middle(scene: Scene, state: NDArray[np.void] | None = None) -> tuple[float, float, float]:
    """Median position of the moving bodies, or of all bodies when none moves."""
    moving = [body.index for body in scene.bodies if not body.static] or [body.index for body in scene.bodies]
    if not moving:
        return (0.0, 0.0, 0.0)
    places = (
        np.array([scene.bodies[i].T_world_body[:3, 3] for i in moving])
        if state is None
        else state["body_pose"][0, moving, :3]
    )
    x, y, z = np.median(places, axis=0).tolist()
    return x, y, z


def _point(view: CameraView, x: float, y: float, depth: float) -> Array:
    """World point (3,) at a pixel and a depth."""
    K = view.intrinsics
    reach = 1.0 if view.orthographic else depth
    v = (y - K[1, 2]) / K[1, 1]
    u = (x - K[0, 2] - K[0, 1] * v) / K[0, 0]
    eye = np.array([u * reach, -v * reach, -depth, 1.0])
    return inverse(view.view)[:3] @ eye
