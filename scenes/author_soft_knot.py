"""Authors the scene `soft_knot`: a wound in soft tissue, a thread stitched through both lips, two arms for the knot.

Run ``python scenes/author_soft_knot.py`` to write the scene again; its results are committed, a test compares.
Arms, table and endoscope are those of the other scenes, the thread is that of `ligating`. The tissue stands upright on
its plate, its wound upright too and towards the arms. The short end of the thread comes out of one lip, towards a clip
that is open at its top; the long end comes out of the other lip, towards a rest. Lengths in metres.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

import author_ligating as ligating  # noqa: E402
import author_suturing_small as small  # noqa: E402
import author_theatre as theatre  # noqa: E402
from ligature.model.frames import pose_matrix  # noqa: E402

HERE = Path(__file__).resolve().parent / "soft_knot"
PLACE = ligating.PLACE
"""Below the stitch, on the tissue's upper side, which is upright here."""

PAD = (0.028, 0.06, 0.015)
"""Edges of the pad: across the wound, along it, and how thick it is."""

WOUND = (0.004, 0.03, 0.01)
"""Width, length and depth of the wound."""

CELL = 0.005
LEVEL = ligating.LEVEL
"""Height of the stitch: the middle of the wound."""

BITE, DEEP = 0.0045, 0.0045
"""What the stitch takes of each lip, and how deep it passes the walls."""

SHORT, LONG = 0.054, 0.085
"""Lengths of both ends."""

ASIDE, TURN = 0.7, 0.012
"""Angle by which the long end leads aside, and radius with which it turns there."""

RESTED, REST = 0.05, (0.02, 0.004)
"""How far along the long end its rest is, and its width and thickness."""


def way(width: float) -> list[tuple[float, float]]:
    """The thread's way at first, from its short end on: across the wound, and out of the tissue."""
    half = 0.5 * width + BITE
    inside = np.linspace(0.0, np.pi, 41)
    points = [(half, SHORT)]
    points += [(half * np.cos(a), -DEEP * np.sin(a) ** 0.8) for a in inside.tolist()]
    start = np.array([-half, 0.005])
    points += [(-half - TURN * (1.0 - np.cos(a)), start[1] + TURN * np.sin(a)) for a in np.linspace(0.0, ASIDE, 12)]
    end = np.array(points[-1]) + LONG * np.array([-np.sin(ASIDE), np.cos(ASIDE)])
    return [(float(x), float(y)) for x, y in [*points, end]]


def pad(width: float, youngs: float | None) -> dict[str, Any]:
    """The tissue, whose back is held."""
    x, y, z = PLACE
    place = pose_matrix((x, y - PAD[2] / 2, z + LEVEL), (-np.pi / 2, 0, 0))
    keys = {"color components": small.colour(0.85, 0.55, 0.5)}
    shapes = [small.shape("BOX", (0, 0, 0), x=PAD[0], y=PAD[1], z=PAD[2])]
    body = small.body("Pad", place, 0.0, shapes, **keys)
    body["ligature tissue"] = {
        "material": "silicone pad",
        **({} if youngs is None else {"youngs modulus": youngs}),
        "cell size": CELL,
        "fixed": ["-z"],
        "slits": [small.slit((width, *WOUND[1:]), PAD[2] / 2)],
    }
    return body


def plate() -> dict[str, Any]:
    """What the tissue is glued to."""
    height = LEVEL + PAD[1] / 2
    shapes = [small.shape("BOX", (0, -PAD[2] - 0.0025, height / 2), x=PAD[0], y=0.004, z=height)]
    return ligating.body("Plate", shapes, 0.6, 0.6, 0.6)


def rest(width: float) -> dict[str, Any]:
    """What the long end lies on."""
    points = np.array(way(width))
    at = points[-2] + RESTED * (points[-1] - points[-2]) / np.linalg.norm(points[-1] - points[-2])
    top = LEVEL - 0.5 * ligating.DIAMETER
    shapes = [small.shape("BOX", (at[0], at[1], top / 2), (0, 0, ASIDE), x=REST[0], y=REST[1], z=top)]
    return ligating.body("Rest", shapes, 0.6, 0.6, 0.6)


def thread(width: float) -> dict[str, Any]:
    """The thread, from its short end on."""
    x, y, z = PLACE
    points = np.array(way(width))
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    elements = int(length / ligating.ELEMENT)
    return {
        "name": "Thread",
        "length": small.number(elements * ligating.ELEMENT),
        "diameter": ligating.DIAMETER,
        "elements": elements,
        **ligating.SUTURE,
        # Its frame has x of the world along x, and the world's -y along z.
        "location": small.pose(pose_matrix((x + points[0, 0], y + points[0, 1], z + LEVEL), (np.pi / 2, 0, 0))),
        "way": [small.vector((a - points[0, 0], 0.0, points[0, 1] - b)) for a, b in points[1:]],
        "color rgba": {"r": 0.25, "g": 0.15, "b": 0.5, "a": 1.0},
    }


def task(width: float, youngs: float | None) -> dict[str, Any]:
    """Tissue, its plate, clip, rest, thread and endoscope."""
    found = theatre.document({"BODY CameraFrame": theatre.camera_frame()})
    own = {
        "BODY Pad": pad(width, youngs),
        "BODY Plate": plate(),
        "BODY Rest": rest(width),
        "BODY Clip": ligating.clip(0.5 * width + BITE),
    }
    return {
        **found, **own, "SUTURE Thread": thread(width),
        "bodies": [*own, "BODY CameraFrame"], "sutures": ["SUTURE Thread"],
    }  # fmt: skip


def texts(width: float = WOUND[0], youngs: float | None = None) -> dict[str, str]:
    """Text of every file of the scene by its path, with a wound of that width and tissue of that Young's modulus."""
    documents = {"task.yaml": task(width, youngs), "launch.yaml": theatre.launch("task.yaml")}
    return theatre.in_text(documents, {}, Path(__file__).name)


if __name__ == "__main__":
    theatre.write(HERE, texts())
