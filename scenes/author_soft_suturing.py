"""Authors the scene `soft_suturing`: a pad of soft tissue with a gaping wound, a needle with thread, and two arms.

Run ``python scenes/author_soft_suturing.py`` to write the scene again; its results are committed, a test compares.
Arms, needle, thread, table and endoscope are those of the other scenes, with their real masses. The wound runs along Y,
as in `suturing`, but nothing marks where stitches go: the needle punctures the pad anywhere. Lengths in metres.
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

HERE = Path(__file__).resolve().parent / "soft_suturing"
PAD = (0.06, 0.08, 0.015)
"""Edges of the pad."""

WOUND = (0.004, 0.04, 0.01)
"""Width, length and depth of the wound in the middle of the pad's upper side."""

CELL = 0.005
SHARP = {"puncture force": 0.2, "cutting force": 0.08, "exit force": 0.06}
"""Forces in newtons of a new cutting needle: it enters at the least of the 0.2 to 0.6 N that suture needles need."""

ASIDE = 0.015
"""How far along X the pad lies from the middle of the board, which leaves room for the needle."""

THREAD_ELEMENTS = 60
"""Of 2.5 mm: 150 mm of thread, enough for three stitches and both ends."""

BOARD_LOW, BOARD_HIGH = (-0.13, -0.15, 0.0), (0.055, 0.07, 0.004)
"""Corners of the board: needle and thread lie on it wherever they are put. A thread that hangs over its edge pulls the
needle off."""
NEEDLE = (-0.04, 0.03)
"""Where the needle lies on the board; its thread lies along -Y, beside the pad."""


def surface() -> dict[str, Solid]:
    """The pad's sides and lower side, which its walls in the wound look like, and its upper side."""
    points, faces = box(tuple(-0.5 * np.array(PAD)), tuple(0.5 * np.array(PAD)))
    upper = (points[faces][:, :, 2] > 0.0).all(axis=1)
    return {"flesh": (points, faces[~upper]), "skin": (points, faces[upper])}


def meshes() -> dict[str, dict[str, Solid]]:
    """The pad and the board that it is glued to, as solids by material."""
    return {"pad": surface(), "board": {"steel": box(BOARD_LOW, BOARD_HIGH, 0.001)}}


def pad() -> dict[str, Any]:
    """The pad of tissue, whose lower side is held."""
    x, y, z = theatre.PLACE
    place = pose_matrix((x + ASIDE, y, z + BOARD_HIGH[2] + PAD[2] / 2), (0, 0, 0))
    body = small.body("Pad", place, 0.0, [small.shape("BOX", (0, 0, 0), x=PAD[0], y=PAD[1], z=PAD[2])])
    small.looks(body, f"{HERE.name}/high_res/pad.obj")
    body["ligature tissue"] = {
        "material": "silicone pad",
        **SHARP,
        "cell size": CELL,
        "fixed": ["-z"],
        "slits": [small.slit(WOUND, PAD[2] / 2)],
    }
    return body


def board() -> dict[str, Any]:
    """The board below pad and needle, which stands still."""
    size = np.subtract(BOARD_HIGH, BOARD_LOW)
    middle = tuple(np.add(BOARD_HIGH, BOARD_LOW) / 2)
    shapes = [small.shape("BOX", middle, x=small.number(size[0]), y=small.number(size[1]), z=small.number(size[2]))]
    body = small.body("Board", pose_matrix(theatre.PLACE, (0, 0, 0)), 0.0, shapes)
    small.looks(body, f"{HERE.name}/high_res/board.obj")
    return body


def task() -> dict[str, Any]:
    """Pad, board, the needle with its thread, and the endoscope."""
    thread = small.phantom(THREAD_ELEMENTS)
    at = thread["BODY Needle"]["location"]["position"]
    x, y, z = theatre.PLACE
    height = z + BOARD_HIGH[2] + small.NEEDLE_THICKNESS + 0.0002
    moved = np.subtract((x + NEEDLE[0], y + NEEDLE[1], height), [at[axis] for axis in "xyz"])
    carried = [name for name in thread["bodies"] if name.startswith(("BODY Needle", "BODY Thread"))]
    for name in carried:
        at = thread[name]["location"]["position"]
        thread[name]["location"]["position"] = small.vector([at[axis] for axis in "xyz"] + moved)
    bodies = {"BODY Pad": pad(), "BODY Board": board(), "BODY CameraFrame": theatre.camera_frame()}
    bodies |= {name: thread[name] for name in carried}
    return document(bodies, {name: thread[name] for name in thread["joints"]})


def document(bodies: dict[str, Any], joints: dict[str, Any]) -> dict[str, Any]:
    """The file of all bodies and joints."""
    drawn = {name: block for name, block in bodies.items() if "mesh" in block}
    found = theatre.document(drawn)
    return {**found, **bodies, **joints, "bodies": list(bodies), "joints": list(joints)}


def texts() -> dict[str, str]:
    """Text of every file of the scene by its path."""
    documents = {"task.yaml": task(), "launch.yaml": theatre.launch("task.yaml")}
    return theatre.in_text(documents, meshes(), Path(__file__).name)


if __name__ == "__main__":
    theatre.write(HERE, texts())
