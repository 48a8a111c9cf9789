"""Authors the scene `peg_transfer`: twelve posts on a board, and six rubber triangles to be carried across.

Run ``python scenes/author_peg_transfer.py`` to write the scene again; the results are committed and a test compares.
Arms, table and endoscope are those of the other scenes. Lengths in metres; the board's frame is in the middle of its
lower side, a triangle's in its middle, z up.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

import author_suturing_small as small  # noqa: E402
import author_theatre as theatre  # noqa: E402
from author_meshes import Solid, box, joined, loft, moved, turned  # noqa: E402
from ligature.model.frames import pose_matrix  # noqa: E402

HERE = Path(__file__).resolve().parent / "peg_transfer"
BOARD = (0.118, 0.10, 0.02)
POST_RADIUS, POST_HEIGHT = 0.0017, 0.016
SIDE = [(x, y) for x in (0.018, 0.043) for y in (0.030, 0.0, -0.030)]
"""Where the posts of one half stand; those of the other mirror them."""

INNER, OUTER, HEIGHT = 0.0036, 0.0062, 0.008
"""Distances from the middle of a triangle to its inner and outer sides, and how high it is."""

RUBBER = 1100.0
CAMERA = ((0.03, 0.335, 0.830), (0.69813, 0.0, -3.14158))

Array = np.ndarray


def posts() -> list[tuple[float, float]]:
    """Where posts stand, those with a triangle in the beginning first."""
    return [(-x, y) for x, y in SIDE] + SIDE


def triangle(distance: float) -> Array:
    """Corners (3, 2) of an even triangle whose sides are ``distance`` from its middle."""
    turn = np.radians([90.0, 210.0, 330.0])
    return 2.0 * distance * np.column_stack([np.cos(turn), np.sin(turn)])


def ring() -> Solid:
    """A triangle: a frame with bevelled edges around a hole."""
    half, bevel = HEIGHT / 2, 0.0006
    middle = (INNER + OUTER) / 2
    section = [
        (INNER, -half + bevel), (middle - bevel, -half), (OUTER - bevel, -half), (OUTER, -half + bevel),
        (OUTER, half - bevel), (OUTER - bevel, half), (middle - bevel, half), (INNER, half - bevel),
    ]  # fmt: skip
    corners = [triangle(distance) for distance, _ in section]
    rows = [np.array([(*corners[i][k], z) for i, (_, z) in enumerate(section)]) for k in (0, 1, 2, 0)]
    points, faces = loft(rows, closed=False)
    volume = np.einsum("ij,ij", points[faces[:, 0]], np.cross(points[faces[:, 1]], points[faces[:, 2]]))
    return points, faces if volume > 0 else faces[:, ::-1]


def meshes() -> dict[str, dict[str, Solid]]:
    """Board and triangle, as solids by material."""
    x, y, top = BOARD[0] / 2, BOARD[1] / 2, BOARD[2]
    post = turned([
        (POST_RADIUS * 1.7, top - 0.0005), (POST_RADIUS * 1.5, top + 0.0008), (POST_RADIUS, top + 0.0014),
        (POST_RADIUS, top + POST_HEIGHT - 0.0008), (0.4 * POST_RADIUS, top + POST_HEIGHT),
    ], 14)  # fmt: skip
    line = box((-0.0006, -y + 0.004, top - 0.0004), (0.0006, y - 0.004, top + 0.0001))
    return {
        "pegboard": {
            "board": box((-x, -y, 0.0), (x, y, top), 0.003),
            "post": joined([line, *(moved(post, pose_matrix((*at, 0.0), (0, 0, 0))) for at in posts())]),
        },
        "triangle": {"block": ring()},
    }


def board() -> dict[str, Any]:
    """The board with its posts, which stands still."""
    shapes = [small.shape("BOX", (0, 0, BOARD[2] / 2), x=BOARD[0], y=BOARD[1], z=BOARD[2])]
    for x, y in posts():
        at = (x, y, BOARD[2] + POST_HEIGHT / 2)
        shapes.append(small.shape("CYLINDER", at, axis="Z", radius=POST_RADIUS, height=POST_HEIGHT))
    block = small.body("Board", pose_matrix(theatre.PLACE, (0, 0, 0)), 0.0, shapes)
    small.looks(block, f"{HERE.name}/high_res/pegboard.obj")
    return block


def block(number: int, post: tuple[float, float]) -> dict[str, Any]:
    """A triangle around a post, half a millimetre above the board."""
    thickness, middle = OUTER - INNER, (OUTER + INNER) / 2
    length = 2.0 * np.sqrt(3.0) * middle
    shapes, area = [], 3.0 * np.sqrt(3.0) * (OUTER**2 - INNER**2)
    for turn in np.radians([30.0, 150.0, 270.0]):
        at = (small.number(middle * np.cos(turn)), small.number(middle * np.sin(turn)), 0.0)
        rpy = (0.0, 0.0, float(turn))
        shapes.append(small.shape("BOX", at, rpy, x=small.number(thickness), y=small.number(length), z=HEIGHT))
    mass = small.number(RUBBER * area * HEIGHT)
    around = mass * (INNER**2 + OUTER**2) / 2
    x, y, z = theatre.PLACE
    at = (x + post[0], y + post[1], z + BOARD[2] + HEIGHT / 2 + 0.0005)
    body = small.body(
        f"Block{number}", pose_matrix(at, (0, 0, 0)), mass, shapes,
        inertia={
                "ix": float(f"{around / 2 + mass * HEIGHT**2 / 12:.6g}"),
                "iy": float(f"{around / 2 + mass * HEIGHT**2 / 12:.6g}"),
                "iz": float(f"{around:.6g}"),
            }, friction={"static": 0.8, "rolling": 0.0},
    )  # fmt: skip
    small.looks(body, f"{HERE.name}/high_res/triangle.obj")
    return body


def task() -> dict[str, Any]:
    """Board, triangles and endoscope."""
    bodies = {"BODY Board": board()}
    for number, post in enumerate(posts()[:6], 1):
        bodies[f"BODY Block{number}"] = block(number, post)
    bodies["BODY CameraFrame"] = theatre.camera_frame(*CAMERA)
    return theatre.document(bodies)


def texts() -> dict[str, str]:
    """Text of every file of the scene by its path."""
    documents = {"task.yaml": task(), "launch.yaml": theatre.launch("task.yaml")}
    return theatre.in_text(documents, meshes(), Path(__file__).name)


if __name__ == "__main__":
    theatre.write(HERE, texts())
