"""Reads a dataset of `ligature.datasets` with h5py alone: what is in it, and batches to learn from.

``python examples/read_dataset.py FILE.h5``; `ligature.datasets` is not needed for it.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np


def steps(file: h5py.File, camera: str = "cameraL", arm: str = "PSM1") -> Iterator[tuple[np.ndarray, ...]]:
    """Picture (h, w, 3), depth in metres (h, w), joints (n,) now and wanted (n,), of all successful episodes."""
    for name, episode in file.items():
        if not name.startswith("episode_") or not episode.attrs["success"]:
            continue
        seen, moved = episode["cameras"][camera], episode["arms"][arm]
        for k in range(episode.attrs["samples"]):
            depth = seen["depth"][k] * file.attrs["depth_unit"]
            yield (
                seen["rgb"][k],
                np.where(depth > 0, depth, np.inf),
                moved["measured_js"][k, 0],
                moved["setpoint_js"][k, 0],
            )


def main() -> int:
    """Report what is in a dataset."""
    arguments = argparse.ArgumentParser(description="Report what is in a dataset.")
    arguments.add_argument("file", type=Path, help="HDF5 file of DatasetWriter, demo or replay")
    path = arguments.parse_args().file
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        arguments.error(f"cannot read '{path}': {error}")
    with file:
        if "format" not in file.attrs:
            arguments.error(f"'{path}' is an HDF5 file, but not a Ligature dataset")
        print(f"{file.attrs['format']}, scene '{file.attrs['scene']}', {file.attrs['rate']:g} samples a second")
        for name, episode in file.items():
            if not name.startswith("episode_"):
                continue
            labels, counts = np.unique(episode["phase"][:], return_counts=True)
            phases = ", ".join(f"{file.attrs['phases'][k] or 'none'} {n}" for k, n in zip(labels, counts, strict=True))
            print(f"{name}: {episode.attrs['samples']} samples, success {bool(episode.attrs['success'])}; {phases}")
        picture, depth, joints, wanted = next(steps(file), (None, None, None, None))
        if picture is not None and depth is not None and joints is not None:
            print(f"first step: picture {picture.shape}, nearest {depth.min():.3f} m, joints {np.round(joints, 3)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
