"""Authors the scene `knot_tying`: a vessel on a block, a thread that lies under it, and two arms to close it off.

Run ``python scenes/author_knot_tying.py`` to write the scene again; its results are committed, a test compares.
Arms, table and endoscope are those of the other scenes. The vessel runs along X; the thread passes between it and the
block, which hold it, and both of its ends stick out. Lengths in metres; the block's frame is in the middle of its lower
side.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

import author_suturing_small as small  # noqa: E402
import author_theatre as theatre  # noqa: E402
from ligature.model.frames import pose_matrix  # noqa: E402

HERE = Path(__file__).resolve().parent / "knot_tying"
BLOCK = (0.05, 0.014, 0.03)
"""Edges of the block."""

VESSEL, NIP = 0.003, 0.00048
"""Radius of the vessel, which is as long as the block, and how far it lies above it: less than the thread is thick."""

DIAMETER, ELEMENT, TAIL, LONG = 0.0005, 0.001, 0.05, 0.09
"""Thickness of the thread, length of its elements, and of its two ends."""

REST, REST_SIZE = 0.06, (0.02, 0.004)
"""How far from the vessel the long end lies on a rest, and width and thickness of that."""

SUTURE = {
    "density": 1100.0, "youngs modulus": 1.0e8, "damping time": 0.004, "yield strain": 0.01, "friction": 0.55,
}  # fmt: skip
"""As supple as a solid filament of 2 GPa and 0.24 mm. A knot of two throws needs a friction of 0.25 to 0.3 between two
strands, the product of both. A bend above 40 per metre stays: the short end, bent once, stands by itself where the jaws
are to find it."""


def block() -> dict[str, Any]:
    """Block, vessel and rest, which stand still."""
    x, y, z = BLOCK
    shapes = [
        small.shape("BOX", (0, 0, z / 2), x=x, y=y, z=z),
        small.shape("CYLINDER", (0, 0, z + NIP + VESSEL), axis="X", radius=VESSEL, height=x),
        small.shape("BOX", (0, REST, z / 2), x=REST_SIZE[0], y=REST_SIZE[1], z=z),
    ]
    keys = {"color components": small.colour(0.8, 0.5, 0.45)}
    return small.body("Block", pose_matrix(theatre.PLACE, (0, 0, 0)), 0.0, shapes, **keys)


def thread() -> dict[str, Any]:
    """The thread, straight, between vessel and block."""
    x, y, z = theatre.PLACE
    start = (x, y - TAIL, z + BLOCK[2] + NIP / 2)
    return {
        "name": "Thread",
        "length": TAIL + LONG,
        "diameter": DIAMETER,
        "elements": round((TAIL + LONG) / ELEMENT),
        **SUTURE,
        "location": small.pose(pose_matrix(start, (-np.pi / 2, 0, 0))),
        "color rgba": {"r": 0.25, "g": 0.15, "b": 0.5, "a": 1.0},
    }


def task() -> dict[str, Any]:
    """Block, thread and endoscope."""
    found = theatre.document({"BODY CameraFrame": theatre.camera_frame()})
    own = {"BODY Block": block(), "SUTURE Thread": thread()}
    return {**found, **own, "bodies": ["BODY Block", "BODY CameraFrame"], "sutures": ["SUTURE Thread"]}


def texts() -> dict[str, str]:
    """Text of every file of the scene by its path."""
    documents = {"task.yaml": task(), "launch.yaml": theatre.launch("task.yaml")}
    return theatre.in_text(documents, {}, Path(__file__).name)


if __name__ == "__main__":
    theatre.write(HERE, texts())
