"""Annotations of a picture for learning: which pixels show which object, as COCO and as a mask.

Boxes are x, y, width, height in pixels from the top left corner; ids are those of `Frame.ids`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

COLOURS = 255
"""Objects that a palette of one byte distinguishes."""


def run_lengths(mask: NDArray[np.bool_]) -> list[int]:
    """COCO's uncompressed run lengths of ``mask`` (h, w): down the columns, beginning with what is outside."""
    flat = mask.ravel(order="F")
    ends = np.concatenate([np.flatnonzero(flat[1:] != flat[:-1]) + 1, [flat.size]])
    counts: list[int] = np.diff(ends, prepend=0).tolist()
    return [0, *counts] if flat[0] else counts


def coco(ids: NDArray[np.int32], names: Mapping[int, str], file_name: str) -> dict[str, Any]:
    """COCO object detection of one picture: an annotation with box, area and run lengths for each object in it."""
    height, width = ids.shape
    annotations: list[dict[str, Any]] = []
    for number in np.unique(ids[ids > 0]).tolist():
        mask = ids == number
        rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        box = [columns[0], rows[0], columns[-1] - columns[0] + 1, rows[-1] - rows[0] + 1]
        annotations.append(
            {
                "id": len(annotations) + 1,
                "image_id": 1,
                "category_id": number,
                "bbox": [int(v) for v in box],
                "area": int(mask.sum()),
                "segmentation": {"size": [height, width], "counts": run_lengths(mask)},
                "iscrowd": 0,
            }
        )
    return {
        "images": [{"id": 1, "width": width, "height": height, "file_name": file_name}],
        "categories": [{"id": number, "name": name} for number, name in names.items()],
        "annotations": annotations,
    }


def mask_image(ids: NDArray[np.int32]) -> Image.Image:
    """A picture whose pixel values are ids, coloured where one byte holds them all."""
    if ids.max(initial=0) > COLOURS:
        return Image.fromarray(ids.astype(np.uint16))
    image = Image.fromarray(ids.astype(np.uint8)).convert("P")
    colours = np.random.default_rng(0).integers(64, 256, (COLOURS + 1, 3), dtype=np.uint8)
    colours[0] = 0
    image.putpalette(colours.tobytes())
    return image
