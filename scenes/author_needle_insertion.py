"""Authors the scene `needle_insertion`: one arm, a needle without thread, and a block of tissue to drive it into.

Run ``python scenes/author_needle_insertion.py`` to write the scene again; its results are committed, a test compares.
Arm, needle, table and endoscope are those of the other scenes. Lengths in metres.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

import author_suturing_small as small  # noqa: E402
import author_theatre as theatre  # noqa: E402
from author_meshes import Solid, box  # noqa: E402
from ligature.model.frames import pose_matrix  # noqa: E402

HERE = Path(__file__).resolve().parent / "needle_insertion"
BLOCK = (0.06, 0.05, 0.02)
"""Edges of the block of tissue."""

CAMERA = ((0.03, 0.34, 0.835), (0.69813, 0.0, -3.14158))


def surface(spacing: float = 0.002) -> Solid:
    """The block's surface, fine enough to show where it bends."""
    low, high = -np.array(BLOCK) / 2, np.array(BLOCK) / 2
    vertices: list[np.ndarray] = []
    faces: list[np.ndarray] = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        lines = [np.linspace(low[a], high[a], round(BLOCK[a] / spacing) + 1) for a in (u, v)]
        for side, end in ((1, high), (-1, low)):
            first = sum(len(part) for part in vertices)
            points = np.zeros((len(lines[0]), len(lines[1]), 3))
            points[..., u], points[..., v], points[..., axis] = lines[0][:, None], lines[1], end[axis]
            n = first + np.arange(points[..., 0].size).reshape(points.shape[:2])
            a, b, c, d = n[:-1, :-1].ravel(), n[1:, :-1].ravel(), n[1:, 1:].ravel(), n[:-1, 1:].ravel()
            corners = [(a, b, c), (a, c, d)] if side > 0 else [(a, c, b), (a, d, c)]
            vertices.append(points.reshape(-1, 3))
            faces += [np.column_stack(corner) for corner in corners]
    return np.vstack(vertices), np.vstack(faces)


def meshes() -> dict[str, dict[str, Solid]]:
    """The block and the board that it lies on, as solids by material."""
    x, y = BLOCK[0] / 2 + 0.005, BLOCK[1] / 2 + 0.005
    return {"block": {"skin": surface()}, "board": {"steel": box((-x, -y, 0.0), (x, y, 0.004), 0.001)}}


def block() -> dict[str, Any]:
    """The block of tissue, which its lower side holds."""
    x, y, z = theatre.PLACE
    place = pose_matrix((x, y, z + 0.004 + BLOCK[2] / 2), (0, 0, 0))
    shapes = [small.shape("BOX", (0, 0, 0), x=BLOCK[0], y=BLOCK[1], z=BLOCK[2])]
    body = small.body("Block", place, 0.0, shapes)
    small.looks(body, f"{HERE.name}/high_res/block.obj")
    body["ligature tissue"] = {"material": "silicone pad", "cell size": 0.005, "fixed": ["-z"]}
    return body


def board() -> dict[str, Any]:
    """The board below the block, which stands still."""
    x, y = BLOCK[0] + 0.01, BLOCK[1] + 0.01
    shapes = [small.shape("BOX", (0, 0, 0.002), x=x, y=y, z=0.004)]
    body = small.body("Board", pose_matrix(theatre.PLACE, (0, 0, 0)), 0.0, shapes)
    small.looks(body, f"{HERE.name}/high_res/board.obj")
    return body


def needle() -> dict[str, Any]:
    """The needle of `suturing_small`, on the block."""
    body = small.phantom()["BODY Needle"]
    x, y, z = theatre.PLACE
    at = (x - 0.015, y + 0.01, z + 0.004 + BLOCK[2] + small.NEEDLE_THICKNESS + 0.0005)
    body["location"] = small.pose(pose_matrix(at, (0, 0, 0.4)))
    return body


def task() -> dict[str, Any]:
    """Block, board, needle and endoscope."""
    bodies = {
        "BODY Block": block(), "BODY Board": board(), "BODY Needle": needle(),
        "BODY CameraFrame": theatre.camera_frame(*CAMERA),
    }  # fmt: skip
    return theatre.document(bodies)


def launch() -> dict[str, Any]:
    """The launch file: one arm."""
    document = theatre.launch("task.yaml")
    document["multibody configs"] = [part for part in document["multibody configs"] if "psm1" not in part]
    return document


def texts() -> dict[str, str]:
    """Text of every file of the scene by its path."""
    documents = {"task.yaml": task(), "launch.yaml": launch()}
    return theatre.in_text(documents, meshes(), Path(__file__).name)


if __name__ == "__main__":
    theatre.write(HERE, texts())
