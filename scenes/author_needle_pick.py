"""Authors the scene `needle_pick`: a needle without thread on a foam pad in a tray, to be picked up.

Run ``python scenes/author_needle_pick.py`` to write the scene again; the results are committed and a test compares.
Arms, needle, table and endoscope are those of the other scenes. Lengths in metres; the tray's frame is in the middle
of its lower side.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

import author_suturing_small as small  # noqa: E402
import author_theatre as theatre  # noqa: E402
from author_meshes import Solid, box, joined  # noqa: E402
from ligature.model.frames import pose_matrix  # noqa: E402

HERE = Path(__file__).resolve().parent / "needle_pick"
FOAM = (0.10, 0.12, 0.024)
WALL, RIM = 0.003, 0.028
"""Thickness and height of the tray's wall, which stands a little higher than the foam."""

CAMERA = ((0.03, 0.34, 0.835), (0.69813, 0.0, -3.14158))


def walls() -> list[tuple[tuple[float, float, float], tuple[float, float, float]]]:
    """Opposite corners of the four walls."""
    x, y = FOAM[0] / 2, FOAM[1] / 2
    return [
        ((-x - WALL, -y - WALL, 0.0), (-x, y + WALL, RIM)),
        ((x, -y - WALL, 0.0), (x + WALL, y + WALL, RIM)),
        ((-x, -y - WALL, 0.0), (x, -y, RIM)),
        ((-x, y, 0.0), (x, y + WALL, RIM)),
    ]


def meshes() -> dict[str, dict[str, Solid]]:
    """The tray, as solids by material."""
    x, y, z = FOAM[0] / 2, FOAM[1] / 2, FOAM[2]
    ruler = []
    for n in range(21):
        side, length = -0.05 + 0.005 * n, 0.006 if n % 2 else 0.010
        ruler.append(box((-0.045, side, z - 0.0002), (-0.045 + length, side + 0.0004, z + 5e-5)))
    return {
        "tray": {
            "foam": box((-x, -y, 0.001), (x, y, z)),
            "steel": joined([box(low, high, 0.0008) for low, high in walls()]),
            "composite": joined(ruler),
        }
    }


def tray() -> dict[str, Any]:
    """The tray and its foam, which stand still."""
    shapes = [small.shape("BOX", (0, 0, FOAM[2] / 2), x=FOAM[0], y=FOAM[1], z=FOAM[2])]
    for low, high in walls():
        size, centre = np.subtract(high, low), np.add(low, high) / 2
        x, y, z = (small.number(s) for s in size)
        shapes.append(small.shape("BOX", tuple(centre), x=x, y=y, z=z))
    block = small.body("Tray", pose_matrix(theatre.PLACE, (0, 0, 0)), 0.0, shapes)
    small.looks(block, f"{HERE.name}/high_res/tray.obj")
    return block


def needle() -> dict[str, Any]:
    """The needle of `suturing_small`, on the foam."""
    block = small.phantom()["BODY Needle"]
    x, y, z = theatre.PLACE
    at = (x - 0.015, y + 0.01, z + FOAM[2] + small.NEEDLE_THICKNESS + 0.0002)
    block["location"] = small.pose(pose_matrix(at, (0, 0, 0.4)))
    return block


def task() -> dict[str, Any]:
    """Tray, needle and endoscope."""
    bodies = {"BODY Tray": tray(), "BODY Needle": needle(), "BODY CameraFrame": theatre.camera_frame(*CAMERA)}
    return theatre.document(bodies)


def texts() -> dict[str, str]:
    """Text of every file of the scene by its path."""
    documents = {"task.yaml": task(), "launch.yaml": theatre.launch("task.yaml")}
    return theatre.in_text(documents, meshes(), Path(__file__).name)


if __name__ == "__main__":
    theatre.write(HERE, texts())
