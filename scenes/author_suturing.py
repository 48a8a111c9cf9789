"""Authors the scene `suturing`: a pad of tissue with a wound and four pairs of holes, sutured by two PSMs.

Run ``python scenes/author_suturing.py`` to write the ADF files again; the results are committed and a test compares.
Arms, needle and thread are those of `suturing_small`, the room is that of `author_theatre`. Names are those that
clients of the suturing challenge look for. Lengths in metres; the pad's frame is at its middle.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

import author_looks as looks  # noqa: E402
import author_suturing_small as small  # noqa: E402
import author_theatre as theatre  # noqa: E402
from ligature.model.frames import pose_matrix  # noqa: E402

HERE = Path(__file__).resolve().parent / "suturing"
ROWS = sorted({y for _, y in looks.MARKS}, reverse=True)
"""Where along the wound the pairs of holes are, the one next to the camera first."""

ASIDE = 0.006
"""Distance of entries (to the left) and exits (to the right) from the wound."""

CAVITY, DEPTH, WINDOW = 0.0085, 0.006, 0.0026
"""Below a pair of holes the pad is hollow: half its width across the wound, its depth, half its width along it."""

BRIDGE, BRIDGE_THICKNESS = 0.003, 0.0008
"""Half width and thickness of the tissue between the two holes, under which the needle passes."""

OPENING, RING = 0.0015, 0.0004
"""Half width of a hole, and the radius of the four rods around it."""

NEARER = 0.05
"""How far along Y the pad lies from its place in `suturing_small`: there both arms reach all four pairs."""

TISSUE = {"friction": 0.15, "drag": 5.0}
"""How the tissue holds what passes through a hole, N and N s/m: a thread runs through all eight holes in the end."""

CAMERA = ((0.0307, 0.362, 0.852), (0.69813, 0.0, -3.14158))
"""Where the endoscope is: all four pairs of holes and both instruments are in the picture."""

HOLE_MASS = 0.005
HOLE_STIFFNESS, HOLE_TURN = 400.0, 0.02
"""How the tissue around a hole gives: N/m and N·m/rad."""


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> dict[str, Any]:
    """A box between two corners of the pad's frame."""
    centre, size = (np.add(low, high) / 2).tolist(), np.subtract(high, low)
    return small.shape("BOX", tuple(centre), x=small.number(size[0]), y=small.number(size[1]), z=small.number(size[2]))


def flesh() -> list[dict[str, Any]]:
    """The pad as boxes: solid but for a cavity below each pair of holes."""
    x, y, z = (s / 2 for s in looks.SIZE)
    floor = z - DEPTH
    parts = [
        box((-x, -y, -z), (x, y, floor)),
        box((-x, -y, floor), (-CAVITY, y, z)),
        box((CAVITY, -y, floor), (x, y, z)),
    ]
    edges = [y, *(edge for row in ROWS for edge in (row + WINDOW, row - WINDOW)), -y]
    for high, low in zip(edges[::2], edges[1::2], strict=True):
        parts.append(box((-CAVITY, low, floor), (CAVITY, high, z)))
    for row in ROWS:
        parts.append(box((-BRIDGE, row - WINDOW, z - BRIDGE_THICKNESS), (BRIDGE, row + WINDOW, z)))
    return parts


def ring() -> list[dict[str, Any]]:
    """Four rods around the opening of a hole, flush with the skin."""
    away, length, below = OPENING + RING, 2 * (OPENING + RING), -RING
    rods = [((away, 0, below), "Y"), ((-away, 0, below), "Y"), ((0, away, below), "X"), ((0, -away, below), "X")]
    return [small.shape("CAPSULE", at, axis=axis, radius=RING, height=small.number(length)) for at, axis in rods]


def hole(T_world: np.ndarray, name: str) -> dict[str, Any]:
    """The ring of a hole: nothing to see, it lies in the skin."""
    block = small.body(name, T_world, HOLE_MASS, ring(), passive=False)
    del block["compound shape"]
    return {
        **block,
        "mesh": "",
        "inertia": {"ix": 2e-8, "iy": 2e-8, "iz": 3e-8},
        "damping": {"linear": 0.5, "angular": 0.5},
    }


def spring(name: str, T_pad_hole: np.ndarray) -> dict[str, Any]:
    """What holds the ring in the pad."""
    even = small.vector((1e-3, 1e-3, 1e-3))
    turns = small.vector((0.35, 0.35, 0.35))
    return small.joint(
        f"Phantom-{name}", "six dof spring", "BODY Phantom", f"BODY {name}", T_pad_hole, np.eye(4),
        **{
            "joint limits": {
                "linear": {"low": small.vector((-1e-3, -1e-3, -1e-3)), "high": even},
                "angular": {"low": small.vector((-0.35, -0.35, -0.35)), "high": turns},
            },
            "stiffness": {
                "linear": small.vector((HOLE_STIFFNESS,) * 3), "angular": small.vector((HOLE_TURN,) * 3),
            },
            "damping": {"linear": small.vector((2.0,) * 3), "angular": small.vector((1e-4,) * 3)},
            "equilibrium point": {"linear": small.vector((0, 0, 0)), "angular": small.vector((0, 0, 0))},
        },
    )  # fmt: skip


def holes() -> dict[str, np.ndarray]:
    """Pose (4, 4) of each hole in the pad's frame: z up, which is the way of the suture through both."""
    top = looks.SIZE[2] / 2
    found = {}
    for number, row in enumerate(ROWS, 1):
        found[f"Entry{number}"] = pose_matrix((-ASIDE, row, top), (0, 0, 0))
        found[f"Exit{number}"] = pose_matrix((ASIDE, row, top), (0, 0, 0))
    return found


def phantom() -> dict[str, Any]:
    """The pad, its holes, the needle with its thread, and the frame that carries the cameras."""
    document = small.phantom()
    for name in document["bodies"]:
        at = document[name]["location"]["position"]
        at["y"] = small.number(at["y"] + NEARER)
    pad = document.pop("BODY Block")
    T_world_pad = pose_matrix([pad["location"]["position"][axis] for axis in "xyz"], (0, 0, 0))
    pad.update({"name": "Phantom", "mesh": "block.obj", "compound collision shape": flesh()})
    document["BODY CameraFrame"] = theatre.camera_frame(*CAMERA)
    blocks = {"BODY Phantom": pad}
    joints = {}
    for name, T_pad_hole in holes().items():
        blocks[f"BODY {name}"] = hole(T_world_pad @ T_pad_hole, name)
        joints[f"JOINT Phantom-{name}"] = spring(name, T_pad_hole)
    document["bodies"] = [*blocks, *(name for name in document["bodies"] if name != "BODY Block")]
    document["joints"] = [*joints, *document["joints"]]
    document["high resolution path"] = "../suturing_small/high_res/"
    return {**document, **blocks, **joints}


def ghosts() -> dict[str, Any]:
    """A flat volume in the opening of each hole, which senses what is in it."""
    size = {"x": 2 * OPENING, "y": 2 * OPENING, "z": 0.0004}
    names = [f"ghost{name}" for name in holes()]
    document: dict[str, Any] = {"ghost objects": [f"GHOST {name}" for name in names], "namespace": "/ambf/env/phantom/"}
    for name in names:
        document[f"GHOST {name}"] = {
            "name": name,
            "parent": f"BODY {name.removeprefix('ghost')}",
            "location": small.pose(np.eye(4)),
            "collision shape": "BOX",
            "collision geometry": size,
            "collision margin": 0.0001,
            "collision groups": [],
            "visible": False,
            "passive": False,
            "ligature tissue": TISSUE,
        }
    return document


def documents() -> dict[str, dict[str, Any]]:
    """Every file of the scene by name."""
    return {
        "phantom.yaml": phantom(),
        "ghosts.yaml": ghosts(),
        "launch.yaml": theatre.launch("phantom.yaml", "ghosts.yaml"),
        "launch_400006.yaml": theatre.launch("phantom.yaml", "ghosts.yaml", tool="_400006"),
    }


def texts() -> dict[str, str]:
    """Text of every file of the scene by name."""
    return {name: small.text(document, Path(__file__).name) for name, document in documents().items()}


def main() -> None:
    """Write every file of the scene."""
    HERE.mkdir(exist_ok=True)
    for name, written in texts().items():
        (HERE / name).write_text(written, encoding="utf-8")


if __name__ == "__main__":
    main()
