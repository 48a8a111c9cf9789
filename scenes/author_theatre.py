"""Authors the room that scenes share: a draped table with a stand on it, a stereo endoscope and its light.

Run ``python scenes/author_theatre.py`` to write `theatre/` again. What is operated on stands at `PLACE`, within reach
of both arms of `suturing_small`. Metres, world axes.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

import author_suturing_small as small  # noqa: E402
from author_meshes import Solid, box, files  # noqa: E402
from ligature.model.frames import pose_matrix  # noqa: E402

HERE = Path(__file__).resolve().parent / "theatre"
PLACE = (0.03, 0.23, 0.685)
"""The middle of the stand's upper side, on which pads and boards lie."""

CAMERA = ((0.0307, 0.342, 0.835), (0.69813, 0.0, -3.14158))
"""Where the endoscope is: it sees the whole of a pad."""

VIEW = 0.98
"""Vertical field of view of both cameras."""

TABLE, TABLE_SIZE = (0.0, 0.2, 0.6), (1.2, 1.0, 0.05)
STAND_SIZE = (0.12, 0.22)
CLOTH, FALL, FOLD = (64, 56), 0.22, 0.0035
"""Points of the drape each way, how far it hangs down, and how high its folds are on the table."""

Array = np.ndarray


def drape() -> Solid:
    """The cloth over the table, in the table's frame."""
    half_x, half_y, top = TABLE_SIZE[0] / 2, TABLE_SIZE[1] / 2, TABLE_SIZE[2] / 2 + 0.001
    u = np.linspace(-half_x - FALL, half_x + FALL, CLOTH[0])
    v = np.linspace(-half_y - FALL, half_y + FALL, CLOTH[1])
    u, v = np.meshgrid(u, v)
    over = np.maximum(np.maximum(np.abs(u) - half_x, np.abs(v) - half_y), 0.0)
    x = np.clip(u, -half_x, half_x) + np.sign(u) * np.minimum(np.maximum(np.abs(u) - half_x, 0.0), 0.02)
    y = np.clip(v, -half_y, half_y) + np.sign(v) * np.minimum(np.maximum(np.abs(v) - half_y, 0.0), 0.02)
    creases = [(9.0, 3.0, 0.4), (-4.0, 11.0, 1.7), (15.0, -8.0, 2.9), (6.0, 19.0, 0.1), (-21.0, 5.0, 4.2)]
    waves = sum(np.maximum(np.sin(a * u + b * v + c + 1.2 * np.sin(3.0 * v + c)), 0.0) ** 3 for a, b, c in creases)
    x0, y0 = PLACE[0] - TABLE[0], PLACE[1] - TABLE[1]
    beside = np.maximum(np.abs(u - x0) - STAND_SIZE[0] / 2, np.abs(v - y0) - STAND_SIZE[1] / 2)
    flat = np.clip(beside / 0.06, 0.0, 1.0)  # the stand presses the cloth down
    hang = np.clip(over / FALL, 0.0, 1.0)
    sway = 0.025 * hang * np.sin(22.0 * (u + v))
    x, y = x + sway * (np.abs(u) > half_x), y + sway * (np.abs(v) > half_y)
    z = top + FOLD * waves * flat * (1.0 - hang) - np.maximum(over - 0.01, 0.0)
    columns, rows = CLOTH
    n = np.arange(columns * rows).reshape(rows, columns)
    a, b, c, d = n[:-1, :-1].ravel(), n[:-1, 1:].ravel(), n[1:, 1:].ravel(), n[1:, :-1].ravel()
    faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return np.column_stack([x.ravel(), y.ravel(), z.ravel()]), faces


def stand_corners() -> tuple[Array, Array]:
    """Two corners of the stand in the table's frame."""
    place, table = np.array(PLACE), np.array(TABLE)
    half = np.array([STAND_SIZE[0] / 2, STAND_SIZE[1] / 2, 0.0])
    low = place - half - table
    low[2] = TABLE_SIZE[2] / 2
    return low, place + half - table


def meshes() -> dict[str, dict[str, Solid]]:
    """The one mesh of the table, in the table's frame."""
    low, high = stand_corners()
    rim = box((low[0] - 0.004, low[1] - 0.004, low[2]), (high[0] + 0.004, high[1] + 0.004, low[2] + 0.008), 0.003)
    return {"table": {"drape": drape(), "rubber": box(tuple(low), tuple(high), 0.003), "steel": rim}}


def environment() -> dict[str, Any]:
    """The table under its drape, and the stand."""
    low, high = stand_corners()
    size = high - low
    shapes = [
        small.shape("BOX", (0, 0, 0), x=TABLE_SIZE[0], y=TABLE_SIZE[1], z=TABLE_SIZE[2]),
        small.shape(
            "BOX", tuple((low + high) / 2), x=small.number(size[0]), y=small.number(size[1]), z=small.number(size[2])
        ),
    ]
    table = small.body("Table", pose_matrix(TABLE, (0, 0, 0)), 0.0, shapes)
    small.looks(table, "table.obj")
    return {
        "bodies": ["BODY Table"],
        "joints": [],
        "high resolution path": "high_res/",
        "namespace": "/ambf/env/",
        "BODY Table": table,
    }


def world() -> dict[str, Any]:
    """The world of `suturing_small`, its light at the end of the endoscope, which sees less at the sides."""
    document = small.world()
    for camera in document["cameras"]:
        document[camera]["field view angle"] = VIEW
    document["light2"]["location"] = small.vector((0.0, 0.0, -0.0505))
    return document


def camera_frame(
    position: tuple[float, float, float] = CAMERA[0], rpy: tuple[float, float, float] = CAMERA[1]
) -> dict[str, Any]:
    """The body that carries cameras and light: the endoscope."""
    block = small.body("CameraFrame", pose_matrix(position, rpy), 0.0, [])
    small.looks(block, "endoscope.obj")
    return block


def document(bodies: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """A file of bodies without joints, whose meshes are named by folder and file as seen from `scenes/`."""
    shared = HERE.parent / "suturing_small" / "high_res"
    for block in bodies.values():
        if (shared / block["mesh"]).is_file():
            block["mesh"] = f"suturing_small/high_res/{block['mesh']}"
    return {
        "bodies": list(bodies),
        "joints": [],
        "high resolution path": "../",
        "ignore inter-collision": False,
        "namespace": "/ambf/env/phantom/",
        **bodies,
    }


def launch(*own: str, tool: str = "") -> dict[str, Any]:
    """A launch file in a folder beside `theatre`: files of its own, and both arms; ``tool`` ends their file names."""
    there = "../suturing_small"
    arms = [part for arm in ("psm1", "psm2") for part in (f"{arm}{tool}.yaml", f"ghosts_actuators_{arm}.yaml")]
    return {
        "world config": "../theatre/world.yaml",
        "color config": f"{there}/colors.yaml",
        "input devices config": f"{there}/input_devices.yaml",
        "multibody configs": [*own, *(f"{there}/{arm}" for arm in arms)],
    }


def in_text(documents: dict[str, dict[str, Any]], own: dict[str, dict[str, Solid]], script: str) -> dict[str, str]:
    """Text of every file of a folder by its path there: ADF documents, and meshes below ``high_res``."""
    written = {name: small.text(values, script) for name, values in documents.items()}
    return written | {f"high_res/{name}": text for name, text in files(own, script).items()}


def write(folder: Path, written: dict[str, str]) -> None:
    """Write every file of a folder."""
    (folder / "high_res").mkdir(parents=True, exist_ok=True)
    for name, text in written.items():
        (folder / name).write_text(text, encoding="utf-8")


def texts() -> dict[str, str]:
    """Text of every file by its path in `theatre`."""
    return in_text({"world.yaml": world(), "environment.yaml": environment()}, meshes(), Path(__file__).name)


if __name__ == "__main__":
    write(HERE, texts())
