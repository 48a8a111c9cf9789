"""Writes the slices of the bone that the scene drills: a dense shell around a porous inside, drawn from a formula.

``python examples/plugins/drilling/make_bone.py`` writes ``slices/bone00.png`` to ``bone31.png`` beside this file.
Voxels are 0.5 mm wide; brightness is density.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import gaussian_filter

SHAPE, SPACING = (96, 64, 32), 0.5
"""Voxels along x, y, z, and their edges in millimetres."""

SHELL = 2.5
"""Thickness of the dense shell in millimetres."""

SEED = 1


def bone() -> NDArray[np.uint8]:
    """Densities (96, 64, 32) from 0 to 255."""
    x, y, z = np.meshgrid(*((np.arange(n) + 0.5 - 0.5 * n) * SPACING for n in SHAPE), indexing="ij")
    # half an ellipsoid on a flat base, 44 mm long, 28 mm wide, 14 mm high; depth below its surface to first order
    height = z + 7.0
    depth = np.minimum(13.0 * (1.0 - np.sqrt((x / 22.0) ** 2 + (y / 14.0) ** 2 + (height / 14.0) ** 2)), height)
    grain = gaussian_filter(np.random.default_rng(SEED).standard_normal(SHAPE), 1.3)
    porous = 0.70 + 0.12 * np.clip(grain / grain.std(), -1.0, 1.0)
    inside = np.where(depth > SHELL, porous, 1.0)
    density = inside * np.clip(0.5 + depth / (2.0 * SPACING), 0.0, 1.0)
    return np.round(255.0 * density).astype(np.uint8)


def main() -> None:
    """Write all slices."""
    folder = Path(__file__).resolve().parent / "slices"
    folder.mkdir(exist_ok=True)
    for number, slice_ in enumerate(np.moveaxis(bone(), 2, 0)):
        Image.fromarray(slice_.T[::-1]).save(folder / f"bone{number:02d}.png", optimize=True)


if __name__ == "__main__":
    main()
