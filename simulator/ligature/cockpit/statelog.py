"""A log of states: one numpy array on disk with a row for each sample, and a list of what its columns belong to."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.model.scene import Scene

FIELDS = (
    "tick", "resets", "sim_time", "stamp", "body_pose", "joint_position", "joint_velocity", "rod_tension",
    "insertion_count", "insertion_hole", "insertion_body", "insertion_depth", "insertion_force", "jaw_body",
    "jaw_force", "arm",
)  # fmt: skip
"""Fields of the state that are kept; see `ligature.model.state.state_dtype`."""

INTERVAL = 0.02
"""Simulated seconds between rows."""


ROUNDING = 1e-6
"""Seconds by which simulated time may seem to be early: it is a sum of ticks."""


class StateLog:
    """Writes ``FOLDER/SCENE-DATE.npy`` and ``.json``; until `close` the array is called ``.part``."""

    def __init__(self, scene: Scene, dtype: np.dtype[np.void], folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        stem = f"{''.join(c if c.isalnum() else '_' for c in scene.name)}-{time.strftime('%Y%m%d-%H%M%S')}"
        self.path = folder / f"{stem}.npy"
        self._part = folder / f"{stem}.part"
        kept: list[tuple[Any, ...]] = [(name, *_sub(dtype, name)) for name in FIELDS]
        self._row = np.zeros(1, np.dtype(kept))
        self._file = self._part.open("wb")
        self.rows = 0
        self._write_header()
        self._begin = self._file.tell()
        self._next = float("-inf")
        self.path.with_suffix(".json").write_text(json.dumps(_legend(scene), indent=1), encoding="utf-8")

    def _write_header(self) -> None:
        header = {
            "descr": np.lib.format.dtype_to_descr(self._row.dtype), "fortran_order": False, "shape": (self.rows,)
        }  # fmt: skip
        np.lib.format.write_array_header_2_0(self._file, header)

    def observe(self, state: NDArray[np.void]) -> None:
        """Take ``state`` (1,); keeps it when `INTERVAL` has passed since the last row. Raises OSError."""
        now = float(state["sim_time"][0])
        if now < self._next:
            return
        self._next = now + INTERVAL - ROUNDING
        for name in FIELDS:
            self._row[name] = state[name]
        self._file.write(self._row.tobytes())
        self.rows += 1

    def close(self) -> Path:
        """Finish the file and give it its name."""
        if not self._file.closed:
            self._file.seek(0)
            self._write_header()
            if self._file.tell() != self._begin:  # numpy leaves room for a longer shape in its headers
                raise RuntimeError("the header of the log has grown")
            self._file.close()
            self._part.rename(self.path)
        return self.path


def _sub(dtype: np.dtype[np.void], name: str) -> tuple[Any, ...]:
    field = dtype[name]
    return (field.base, field.shape) if field.shape else (field,)


def _legend(scene: Scene) -> dict[str, Any]:
    return {
        "scene": scene.name,
        "bodies": [body.identity.identifier for body in scene.bodies],
        "joints": [joint.identity.identifier for joint in scene.joints],
        "arms": [arm.name for arm in scene.arms],
        "jaws": [jaw.name for jaw in scene.jaws],
        "fields": list(FIELDS),
    }
