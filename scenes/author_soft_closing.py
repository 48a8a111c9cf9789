"""Authors the scene `soft_closing`: a gaping wound in soft tissue, needle and thread, two arms to close it.

Run ``python scenes/author_soft_closing.py`` to write the scene again; its results are committed, a test compares.
Arms, table and endoscope are those of the other scenes, tissue and clip those of `soft_knot`, the needle is that of
`soft_suturing`. The tissue stands upright, its wound towards the arms. The needle lies on a board with the thread; the
thread's short end is in a clip. The needle lets go of its thread under a pull. Lengths in metres.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

import author_ligating as ligating  # noqa: E402
import author_soft_knot as knot  # noqa: E402
import author_suturing_small as small  # noqa: E402
import author_theatre as theatre  # noqa: E402
from ligature.model.frames import inverse, pose_matrix  # noqa: E402

HERE = Path(__file__).resolve().parent / "soft_closing"
BOARD_LOW, BOARD_HIGH = (-0.02, 0.016, 0.0), (0.14, 0.105, 0.004)
"""Corners of the board from `PLACE`: the needle and most of its thread lie on it."""

REST, REST_AT = (0.018, 0.008, 0.006), (-0.001, 0.0088)
"""Edges of the block that the needle lies on, and where it is in the needle's frame: jaws have room around the tail."""

REACH = 0.0133
"""How far apart the needle goes in and out at most, as it is held: it takes less of the lips of a wider wound."""

LENGTH, HEADING = 0.170, np.radians(220)
"""Length of the thread, and the direction in which it leaves the needle: one arm can take that and stitch with it."""

TURN, TURNED = 0.026, 0.025
"""Radius of the turn that the thread lies in, at which no bend stays, and how far its end is from the tissue."""

CAMERA = (0.0307, 0.316, 0.805)
"""Where the endoscope is, nearer than elsewhere: it sees the wound and both hands."""

RELEASE = 1.0
"""Pull in newtons at which the needle lets go of the thread: 0.3 to 7 N in patent CA 1042301 of 1978."""

SHARP = {"puncture force": 0.2, "cutting force": 0.08, "exit force": 0.06}
"""As in `soft_suturing`."""


def clipped(width: float) -> float:
    """How far beside the wound the clip is: before where the needle goes in."""
    return 0.5 * width + min(knot.BITE, 0.5 * (REACH - width))


def way(width: float, heading: float) -> np.ndarray:
    """The thread's way (n, 3) at first, from the needle on, from `PLACE`."""
    aside = clipped(width)
    low, high = BOARD_HIGH[2] + ligating.DIAMETER, knot.LEVEL
    angles = np.linspace(heading + 0.5 * np.pi, np.pi, 33)
    rise = low + (high - low) * np.linspace(0.0, 1.0, len(angles)) ** 2
    turn = np.column_stack([
        aside + TURN * (1.0 + np.cos(angles)), TURNED + TURN * np.sin(angles), rise,
    ])  # fmt: skip
    left = LENGTH - (knot.SHORT - TURNED) - np.linalg.norm(np.diff(turn, axis=0), axis=1).sum()
    start = turn[0] - left * np.array([np.cos(heading), np.sin(heading), -REST[2] / left])
    return np.vstack([start, turn, (aside, knot.SHORT + 0.01, high)])


def needle(start: np.ndarray, heading: float) -> tuple[dict[str, Any], np.ndarray, np.ndarray]:
    """The needle, its pose (4, 4), and in its frame that of the start of its thread, over ``start`` from `PLACE`."""
    T_needle_tail = small.needle_tail()
    T = pose_matrix((0, 0, 0), (0, 0, heading - np.pi / 2 - small.NEEDLE_START))
    start = np.array(knot.PLACE) + start
    start[2] = knot.PLACE[2] + BOARD_HIGH[2] + REST[2] + small.NEEDLE_THICKNESS + 0.0002
    T[:3, 3] = start - T[:3, :3] @ T_needle_tail[:3, 3]
    return small.needle(T), T, T_needle_tail


def board(T_needle: np.ndarray) -> dict[str, Any]:
    """The board below needle and thread, with the block that the needle lies on."""
    size, middle = np.subtract(BOARD_HIGH, BOARD_LOW), np.add(BOARD_HIGH, BOARD_LOW) / 2
    shapes = [
        small.shape("BOX", tuple(middle), x=small.number(size[0]), y=small.number(size[1]), z=small.number(size[2]))
    ]
    at = (T_needle @ [*REST_AT, 0.0, 1.0])[:3] - knot.PLACE
    yaw = float(np.arctan2(T_needle[1, 0], T_needle[0, 0]))
    x, y, z = REST
    block = small.shape("BOX", (at[0], at[1], BOARD_HIGH[2] + z / 2), (0, 0, yaw), x=x, y=y, z=z)
    shapes.append(block)
    return ligating.body("Board", shapes, 0.35, 0.45, 0.42)


def thread(points: np.ndarray, T_needle: np.ndarray, T_needle_tail: np.ndarray) -> dict[str, Any]:
    """The thread, from the needle to its short end, along ``points`` (n, 3) from `PLACE`."""
    T = inverse(T_needle @ T_needle_tail)
    points = (points + np.array(knot.PLACE)) @ T[:3, :3].T + T[:3, 3]
    return {
        "name": "Thread",
        "parent": "BODY Needle",
        "length": LENGTH,
        "diameter": ligating.DIAMETER,
        "elements": round(LENGTH / ligating.ELEMENT),
        **ligating.SUTURE,
        "location": small.pose(T_needle_tail),
        "release force": RELEASE,
        "way": [small.vector(tuple(point)) for point in points],
        "color rgba": {"r": 0.25, "g": 0.15, "b": 0.5, "a": 1.0},
    }


def task(width: float, youngs: float | None, heading: float) -> dict[str, Any]:
    """Tissue, its plate, clip, board, needle, thread and endoscope."""
    start, *points = way(width, heading)
    block, T_needle, T_needle_tail = needle(start, heading)
    found = theatre.document({"BODY CameraFrame": theatre.camera_frame(CAMERA), "BODY Needle": block})
    pad = knot.pad(width, youngs)
    pad["ligature tissue"] |= SHARP
    own = {
        "BODY Pad": pad,
        "BODY Plate": knot.plate(),
        "BODY Board": board(T_needle),
        "BODY Clip": ligating.clip(clipped(width)),
        "BODY Needle": found.pop("BODY Needle"),
    }
    return {
        **found, **own, "SUTURE Thread": thread(np.array(points), T_needle, T_needle_tail),
        "bodies": [*own, "BODY CameraFrame"], "sutures": ["SUTURE Thread"],
    }  # fmt: skip


def texts(width: float = knot.WOUND[0], youngs: float | None = None, heading: float = HEADING) -> dict[str, str]:
    """Text of every file of the scene by its path.

    With a wound of that width, tissue of that Young's modulus, and a needle that its thread leaves in that direction.
    """
    documents = {"task.yaml": task(width, youngs, heading), "launch.yaml": theatre.launch("task.yaml")}
    return theatre.in_text(documents, {}, Path(__file__).name)


if __name__ == "__main__":
    theatre.write(HERE, texts())
