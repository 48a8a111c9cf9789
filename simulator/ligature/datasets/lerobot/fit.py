"""What of a dataset LeRobot's formats can hold: episodes that are left out, and what makes an export impossible."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import h5py
import numpy as np

from ligature.datasets.lerobot.features import STATE, Robot
from ligature.datasets.quality import not_finite, pace
from ligature.datasets.soundness import episode_names
from ligature.datasets.store import DatasetError
from ligature.paths import printable

SHORTEST = 2
"""Samples of an episode."""

LARGEST, MOST = 1e100, 2**63 - 1
"""Floats and whole numbers of a caller's array: of larger ones there are no statistics, or no column."""


def left_out(file: h5py.File, bad: Mapping[str, str]) -> dict[str, str]:
    """Episodes that no export has, with the reasons: those that are ``bad``, and those that are too short."""
    counts = {name: int(file[name].attrs["samples"]) for name in episode_names(file, bad)}
    why = f"an episode of LeRobot needs {SHORTEST} samples: record longer, or more samples a second"
    return {**bad, **{name: f"it has {n}; {why}" for name, n in counts.items() if n < SHORTEST}}


def check(file: h5py.File, source: Path, out: Mapping[str, str]) -> None:
    """Raise `DatasetError` for data that the formats cannot store; episodes that are left ``out`` do not matter."""
    if file.attrs["format"] != "ligature dataset 2":
        raise DatasetError(
            f"'{source}' has the format '{file.attrs['format']}'; only 'ligature dataset 2' can be exported"
        )
    rate, names = float(file.attrs["rate"]), episode_names(file, out)
    if rate != round(rate):
        raise DatasetError(f"'{source}' has {rate:g} samples a second; record it again with a whole number")
    if not names:
        raise DatasetError(f"'{source}' has no episode to export; {_why(out) or 'record one to its end'}")
    if not Robot.of(file).arms:
        raise DatasetError(f"'{source}' has no arm with a jaw, whose motion would be state and action; add a PSM")
    for name in names:
        _check_episode(file[name], f"'{source}': {name}", rate)


def _why(out: Mapping[str, str]) -> str:
    """Why the first of the episodes that are left ``out`` is, and how many others are."""
    if not out:
        return ""
    name, why = next(iter(out.items()))
    return f"{printable(name)}: {why}" + (f" (and {len(out) - 1} more)" if len(out) > 1 else "")


def _check_episode(episode: h5py.Group, name: str, rate: float) -> None:
    if fault := not_finite(episode):
        raise DatasetError(f"{name}: {fault}; numbers must be finite: record it again, or delete the episode")
    _check_pace(episode, name, rate)
    for extra, array in episode.get("extra", {}).items():
        _check_range(array, f"{name}: 'extra/{extra}'", extra == STATE)
    for camera, pictures in episode.get("cameras", {}).items():
        height, width = pictures["rgb"].shape[1:3]
        if height % 2 or width % 2:
            even = f"{width - width % 2}x{height - height % 2}"
            raise DatasetError(
                f"{name}: pictures of {camera} are {width}x{height}; videos need even sizes, such as {even}"
            )


def _check_pace(episode: h5py.Group, name: str, rate: float) -> None:
    found = pace(episode["time"][:], rate)
    if not found.holds:
        raise DatasetError(
            f"{name} has {found.measured:.4g} samples a second by its times, and {rate:g} by its rate: the time of an "
            "export would be wrong. Record it again with a rate that is not above the steps a second of your loop"
        )


def _check_range(array: h5py.Dataset, name: str, single: bool) -> None:
    """Raise `DatasetError` for numbers of a caller that no column or statistic holds."""
    values = array[:]
    most = MOST if values.dtype.kind == "u" else float(np.finfo(np.float32).max) if single else LARGEST
    if values.dtype.kind in "uf" and (values.size and np.abs(values).max() > most):
        raise DatasetError(f"{name} has {np.abs(values).max()}; numbers of an export must be at most {most:g}")
