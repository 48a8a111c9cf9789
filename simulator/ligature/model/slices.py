"""Reads a stack of pictures as a field of values from 0 to 1 (as in AMBF)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ligature.adf.resolver import Resolver
from ligature.model.pictures import PictureError, read_picture

MOST_SLICES = 4096
"""Largest number of a slice."""

MOST_VALUES = 1_500_000
"""Most values of a field; finer stacks are averaged over blocks."""


def slice_files(folder: Path, prefix: str, suffix: str, last: int, resolver: Resolver) -> list[Path]:
    """The files ``prefix<number>.suffix`` from 0 to ``last`` that exist, in order.

    A number may have leading zeros, up to as many digits as the last one has.

    Raises `PictureError` for more than `MOST_SLICES`.
    """
    if last > MOST_SLICES:
        raise PictureError(f"'count' is {last}; the maximum is {MOST_SLICES} slices")
    found = []
    for number in range(last + 1):
        for digits in range(len(str(number)), len(str(last)) + 1):
            path = folder / f"{prefix}{number:0{digits}d}.{suffix}"
            if resolver.exists(path):
                found.append(path)
                break
    return found


def read_field(files: list[Path]) -> NDArray[np.float32]:
    """The field (nx, ny, nz) of ``files``: columns along x, rows from the bottom along y, files along z.

    Of pictures with transparent places the opacity counts, of others the brightest colour. Raises `PictureError`,
    which names the file, and FileNotFoundError.
    """
    width, height = _read(files[0]).size
    block = max(1, int(np.ceil((width * height * len(files) / MOST_VALUES) ** (1.0 / 3.0))))
    layers = [np.mean(stack, axis=0) for stack in _stacks(files, (width, height), block)]
    return np.ascontiguousarray(np.stack(layers, axis=-1), dtype=np.float32)


def _stacks(files: list[Path], size: tuple[int, int], block: int) -> Iterator[list[NDArray[np.float64]]]:
    """The slices that become one layer, each reduced."""
    for begin in range(0, len(files), block):
        yield [_values(path, size, block) for path in files[begin : begin + block]]


def _values(path: Path, size: tuple[int, int], block: int) -> NDArray[np.float64]:
    picture = _read(path)
    if picture.size != size:
        raise PictureError(
            f"'{path.name}' has {picture.size[0]} × {picture.size[1]} pixels, the first {size[0]} × {size[1]}"
        )
    pixels = np.asarray(picture.convert("RGBA"), dtype=np.uint8)
    opaque = bool((pixels[..., 3] == 255).all())
    grey = pixels[..., :3].max(axis=-1) if opaque else pixels[..., 3]
    reduced = Image.fromarray(grey).reduce(block) if block > 1 else Image.fromarray(grey)
    return np.asarray(reduced, dtype=float)[::-1].T / 255.0


def _read(path: Path) -> Image.Image:
    try:
        return read_picture(path)
    except PictureError as error:
        raise PictureError(f"'{path.name}': {error}") from None
