"""Statistics of features, as LeRobot normalises by them: least, largest, mean, deviation, count and quantiles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
MOST_PICTURES, MOST_PIXELS = 100, 160
"""Pictures of an episode that are evaluated, evenly spaced, and pixels of their longer side."""

Statistics = dict[str, Any]


def of_numbers(values: NDArray[Any], quantiles: bool) -> Statistics:
    """Statistics of a feature (n, k): lists of k numbers, and the count (1)."""
    numbers = np.asarray(values, dtype=float)
    found = {
        "min": numbers.min(axis=0).tolist(), "max": numbers.max(axis=0).tolist(), "mean": numbers.mean(axis=0).tolist(),
        "std": numbers.std(axis=0).tolist(), "count": [len(numbers)],
    }  # fmt: skip
    if quantiles:
        found |= {name: np.quantile(numbers, q, axis=0).tolist() for name, q in QUANTILES.items()}
    return found


def chosen(count: int) -> NDArray[np.int64]:
    """Indices of the pictures of ``count`` that are evaluated."""
    return np.unique(np.linspace(0, count - 1, min(count, MOST_PICTURES)).round().astype(np.int64))


def thinned(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Every so many pixels of a picture (h, w, 3)."""
    step = max(1, max(picture.shape[:2]) // MOST_PIXELS)
    return picture[::step, ::step]


def of_pictures(pixels: NDArray[np.uint8], count: int, quantiles: bool) -> Statistics:
    """Statistics of pixels (p, 3) of ``count`` pictures: shape (3, 1, 1), colours from 0 to 1."""
    found = of_numbers(pixels / 255.0, quantiles)
    return {name: value if name == "count" else [[[x]] for x in value] for name, value in found.items()} | {
        "count": [count]
    }


def joined(each: Sequence[Mapping[str, Any]]) -> Statistics:
    """Statistics of all episodes from those of each: exact but for quantiles, which are weighted means."""
    counts = np.array([one["count"][0] for one in each], dtype=float)
    weights = counts / counts.sum()
    mean = _weighted(each, "mean", weights)
    second = sum(w * (np.square(one["std"]) + np.square(one["mean"])) for w, one in zip(weights, each, strict=True))
    found: Statistics = {
        "min": np.min([one["min"] for one in each], axis=0).tolist(),
        "max": np.max([one["max"] for one in each], axis=0).tolist(),
        "mean": mean.tolist(), "std": np.sqrt(np.maximum(second - np.square(mean), 0.0)).tolist(),
        "count": [int(counts.sum())],
    }  # fmt: skip
    return found | {name: _weighted(each, name, weights).tolist() for name in QUANTILES if name in each[0]}


def _weighted(each: Sequence[Mapping[str, Any]], name: str, weights: NDArray[Any]) -> NDArray[Any]:
    return np.asarray(sum(w * np.asarray(one[name]) for w, one in zip(weights, each, strict=True)))
