"""Lines and words over a picture: frames, joint axes, contacts, tension, figures.

Points are in world axes and metres; what lies behind the eye is left out, nothing hides behind surfaces.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from ligature.model.frames import pose7_matrix
from ligature.model.scene import Scene, Sensor, SensorType
from ligature.render.camera import CameraView

Array = NDArray[np.float64]
Colour = tuple[int, int, int]
Segment = tuple[Array, Array, Colour]

RED, GREEN, BLUE, YELLOW, MAGENTA = (230, 60, 60), (70, 200, 70), (80, 120, 255), (255, 210, 60), (240, 90, 240)
AXES = (RED, GREEN, BLUE)
FONT_SIZE = 14
LOOSE, TIGHT = np.array([60, 120, 255]), np.array([255, 60, 40])


def project(points: Array, view: CameraView) -> tuple[Array, NDArray[np.bool_]]:
    """Pixels (n, 2) of world ``points`` (n, 3), and which of them lie before the eye."""
    homogeneous = np.hstack([points, np.ones((len(points), 1))])
    clip = homogeneous @ (view.projection @ view.view).T
    before = clip[:, 3] > 1e-9
    w = np.where(before, clip[:, 3], 1.0)[:, None]
    ndc = clip[:, :2] / w
    return (ndc * (0.5, -0.5) + 0.5) * (view.width, view.height), before


def draw_segments(rgb: NDArray[np.uint8], segments: Sequence[Segment], view: CameraView) -> NDArray[np.uint8]:
    """``rgb`` with lines between pairs of world points."""
    if not segments:
        return rgb
    ends = np.array([[a, b] for a, b, _ in segments]).reshape(-1, 3)
    pixels, before = project(ends, view)
    pixels = np.clip(pixels, -1e4, 1e4)
    image = Image.fromarray(rgb)
    pen = ImageDraw.Draw(image)
    for i, (_, _, colour) in enumerate(segments):
        if before[2 * i] and before[2 * i + 1]:
            pen.line([*pixels[2 * i], *pixels[2 * i + 1]], fill=colour, width=2)
    return np.asarray(image)


def draw_words(rgb: NDArray[np.uint8], lines: Iterable[str]) -> NDArray[np.uint8]:
    """``rgb`` with ``lines`` of text in its upper left corner."""
    image = Image.fromarray(rgb)
    pen = ImageDraw.Draw(image)
    font = ImageFont.load_default(FONT_SIZE)
    for i, line in enumerate(lines):
        at = (8, 6 + i * (FONT_SIZE + 4))
        pen.text(at, line, fill=(255, 255, 255), font=font, stroke_width=2, stroke_fill=(0, 0, 0))
    return np.asarray(image)


def frames(scene: Scene, state: NDArray[np.void], size: float) -> list[Segment]:
    """The three axes of every body frame, ``size`` metres long."""
    found = []
    for body in scene.bodies:
        if body.index not in scene.rod_bodies:
            T = pose7_matrix(state["body_pose"][0, body.index])
            found += [(T[:3, 3], T[:3, 3] + size * T[:3, i], AXES[i]) for i in range(3)]
    return found


def joint_axes(scene: Scene, state: NDArray[np.void], size: float) -> list[Segment]:
    """The axis of every joint outside rods, ``size`` metres to either side of its pivot."""
    found = []
    in_rods = {joint for rod in scene.rods for joint in rod.joints}
    for joint in scene.joints:
        if joint.index not in in_rods:
            parent = scene.bodies[joint.parent]
            T = pose7_matrix(state["body_pose"][0, joint.parent]) @ parent.T_body_inertial
            pivot, axis = (T @ joint.T_parent_a)[:3, 3], T[:3, :3] @ joint.axis
            found.append((pivot - size * axis, pivot + size * axis, YELLOW))
    return found


def senses(scene: Scene, state: NDArray[np.void], pixel: float) -> list[Segment]:
    """What visible sensors and actuators look like: rays, green until they hit, contact points, actuators.

    ``pixel`` is the length in metres of one pixel of a contact sensor's marks.
    """
    found: list[Segment] = []
    start = 0
    for sensor in scene.sensors:
        if sensor.type is not SensorType.CONTACT:
            count = len(sensor.rays)
            if sensor.visible:
                found += _rays(sensor, state, slice(start, start + count))
            start += count
        elif sensor.visible and sensor.contact_details:
            rows = np.flatnonzero(state["contact_sensor"][0, : int(state["contact_count"][0])] == sensor.index)
            for point in state["contact_point"][0, rows]:
                found += _cross(point, pixel * sensor.visible_size, RED)
    for actuator in scene.actuators:
        if actuator.visible:
            T = pose7_matrix(state["body_pose"][0, actuator.parent]) @ actuator.T_body_actuator
            colour = GREEN if state["actuator_active"][0, actuator.index] else YELLOW
            found += _cross(T[:3, 3], actuator.visible_size, colour)
    return found


def plugin_lines(state: NDArray[np.void]) -> list[Segment]:
    """What plug-ins draw."""
    rows = range(int(state["plugin_line_count"][0]))
    lines, colours = state["plugin_line"][0], state["plugin_line_colour"][0].tolist()
    return [(lines[row, 0], lines[row, 1], tuple(colours[row])) for row in rows]


def _rays(sensor: Sensor, state: NDArray[np.void], rows: slice) -> list[Segment]:
    T = pose7_matrix(state["body_pose"][0, sensor.parent]) @ sensor.T_body_sensor
    ends = sensor.rays @ T[:3, :3].T + T[:3, 3]
    found: list[Segment] = []
    for (a, b), hit, body in zip(ends, state["ray_point"][0, rows], state["ray_body"][0, rows], strict=True):
        sensed = int(body) >= 0
        found.append((a, hit if sensed else b, RED if sensed else GREEN))
        found += _cross(a, sensor.visible_size, RED if sensed else GREEN)
    return found


def _cross(point: Array, size: float, colour: Colour) -> list[Segment]:
    """Three strokes through a point, ``size`` metres to either side."""
    return [(point - size * axis, point + size * axis, colour) for axis in np.eye(3)]


def contacts(state: NDArray[np.void], size: float) -> tuple[list[Segment], float]:
    """The force at every point where bodies touch, the largest ``size`` metres long; that force in N."""
    count = int(state["touch_count"][0])
    points, forces = state["touch_point"][0, :count], state["touch_force"][0, :count]
    most = float(np.linalg.norm(forces, axis=1).max(initial=0.0))
    scale = size / max(most, 1e-9)
    return [(p, p + scale * f, MAGENTA) for p, f in zip(points, forces, strict=True)], most


def tension(scene: Scene, state: NDArray[np.void]) -> tuple[list[Segment], float]:
    """Every thread from element to element, blue where it is loose and red where it is tightest; that tension in N."""
    most = float(np.abs(state["rod_tension"][0]).max(initial=0.0))
    found = []
    for rod in scene.rods:
        places = state["body_pose"][0, list(rod.bodies), :3]
        share = np.abs(state["rod_tension"][0, list(rod.bodies)]) / max(most, 1e-9)
        for i in range(len(places) - 1):
            r, g, b = (LOOSE + (TIGHT - LOOSE) * share[i]).astype(int).tolist()
            found.append((places[i], places[i + 1], (r, g, b)))
    return found, most
