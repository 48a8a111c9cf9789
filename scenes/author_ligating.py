"""Authors the scene `ligating`: an upright stump of a vessel, a thread beside it, and two arms to close it off.

Run ``python scenes/author_ligating.py`` to write the scene again; its results are committed, a test compares.
Arms, table and endoscope are those of the other scenes. The thread is straight and level, along Y. A pin presses it
against the vessel; its short end goes towards the arms, to a clip that is open at its top; its long end goes the other
way, to a rest. Lengths in metres.
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

HERE = Path(__file__).resolve().parent / "ligating"
PLACE = (theatre.PLACE[0], theatre.PLACE[1] + 0.012, theatre.PLACE[2])
"""The foot of the vessel: both arms reach the whole thread."""

RADIUS, HEIGHT = 0.005, 0.052
"""Of the vessel."""

LEVEL = 0.034
"""Height of the thread."""

NIP, PIN, TOP = 0.00048, 0.001, 0.0012
"""Gap between the vessel and the pin, less than the thread is thick; radius of pins, and how far they rise above it."""

DIAMETER, ELEMENT, SHORT, LONG = 0.0005, 0.001, 0.058, 0.104
"""Thickness of the thread, length of its elements, and of its two ends."""

CLIPPED, GAP, PINS = (0.0425, 0.0455), 0.00044, 0.005
"""How far from the vessel both pairs of pins of the clip are, the gap of a pair, and the pins' length."""

RESTED, REST = 0.1, (0.02, 0.004)
"""How far from the vessel the long end's rest is, and its width and thickness."""

BESIDE = RADIUS + 0.5 * NIP
"""How far the middle of the thread is from the vessel's axis."""

SUTURE = {
    "density": 1100.0, "youngs modulus": 1.0e8, "damping time": 0.004, "yield strain": 0.01, "friction": 0.55,
}  # fmt: skip
"""As supple as a solid filament of 2 GPa and 0.24 mm. A knot of two throws needs a friction of 0.25 to 0.3 between two
strands, the product of both. A bend above 40 per metre stays."""


def body(name: str, shapes: list[dict[str, Any]], *colour: float) -> dict[str, Any]:
    """A body that stands still, its frame at `PLACE`: the foot of the vessel."""
    keys = {"color components": small.colour(*colour)}
    return small.body(name, pose_matrix(PLACE, (0, 0, 0)), 0.0, shapes, **keys)


def column(x: float, y: float, radius: float, low: float, high: float) -> dict[str, Any]:
    """An upright cylinder."""
    return small.shape("CYLINDER", (x, y, 0.5 * (low + high)), axis="Z", radius=radius, height=high - low)


def vessel() -> dict[str, Any]:
    """What is to be closed off."""
    return body("Vessel", [column(0.0, 0.0, RADIUS, 0.0, HEIGHT)], 0.8, 0.5, 0.45)


def posts() -> dict[str, Any]:
    """The pin at the vessel, and the long end's rest."""
    top = LEVEL - 0.5 * DIAMETER
    shapes = [
        column(RADIUS + NIP + PIN, 0.0, PIN, 0.0, LEVEL + TOP),
        small.shape("BOX", (BESIDE, -RESTED, top / 2), x=REST[0], y=REST[1], z=top),
    ]
    return body("Posts", shapes, 0.6, 0.6, 0.6)


def clip(x: float = BESIDE) -> dict[str, Any]:
    """Two pairs of pins with the short end between them, at ``x``, and their column."""
    low, aside = LEVEL + TOP - PINS, 0.5 * GAP + PIN
    shapes = [column(x + side * aside, y, PIN, low, LEVEL + TOP) for y in CLIPPED for side in (-1, 1)]
    width, depth = GAP + 4.0 * PIN, CLIPPED[1] - CLIPPED[0] + 2.0 * PIN
    shapes.append(small.shape("BOX", (x, sum(CLIPPED) / 2, low / 2), x=width, y=depth, z=low))
    return body("Clip", shapes, 0.7, 0.7, 0.75)


def thread() -> dict[str, Any]:
    """The thread, from its short end on."""
    x, y, z = PLACE
    return {
        "name": "Thread",
        "length": SHORT + LONG,
        "diameter": DIAMETER,
        "elements": round((SHORT + LONG) / ELEMENT),
        **SUTURE,
        "location": small.pose(pose_matrix((x + BESIDE, y + SHORT, z + LEVEL), (np.pi / 2, 0, 0))),
        "color rgba": {"r": 0.25, "g": 0.15, "b": 0.5, "a": 1.0},
    }


def task() -> dict[str, Any]:
    """Vessel, posts, clip, thread and endoscope."""
    found = theatre.document({"BODY CameraFrame": theatre.camera_frame()})
    own = {"BODY Vessel": vessel(), "BODY Posts": posts(), "BODY Clip": clip()}
    return {
        **found, **own, "SUTURE Thread": thread(), "bodies": [*own, "BODY CameraFrame"], "sutures": ["SUTURE Thread"],
    }  # fmt: skip


def texts() -> dict[str, str]:
    """Text of every file of the scene by its path."""
    documents = {"task.yaml": task(), "launch.yaml": theatre.launch("task.yaml")}
    return theatre.in_text(documents, {}, Path(__file__).name)


if __name__ == "__main__":
    theatre.write(HERE, texts())
