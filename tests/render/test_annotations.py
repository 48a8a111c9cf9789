"""Annotations state which pixels show which object, in COCO's own terms."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from ligature.render.annotations import coco, mask_image, run_lengths


def from_run_lengths(counts: list[int], shape: tuple[int, int]) -> np.ndarray:
    values = np.concatenate([np.full(n, i % 2, dtype=bool) for i, n in enumerate(counts)])
    return values.reshape(shape, order="F")


@given(st.integers(1, 9), st.integers(1, 9), st.integers(0, 2**32))
def test_run_lengths_give_the_mask_back(height: int, width: int, seed: int) -> None:
    mask = np.random.default_rng(seed).random((height, width)) < 0.5
    assert (from_run_lengths(run_lengths(mask), mask.shape) == mask).all()


def test_coco_lists_every_object_in_the_picture_with_box_and_area() -> None:
    ids = np.zeros((6, 8), dtype=np.int32)
    ids[1:3, 2:7] = 3
    ids[5, 0] = 1
    found = coco(ids, {1: "A", 2: "B", 3: "C"}, "picture.png")
    assert found["images"] == [{"id": 1, "width": 8, "height": 6, "file_name": "picture.png"}]
    assert [c["name"] for c in found["categories"]] == ["A", "B", "C"]
    first, second = found["annotations"]
    assert (first["category_id"], first["bbox"], first["area"]) == (1, [0, 5, 1, 1], 1)
    assert (second["category_id"], second["bbox"], second["area"]) == (3, [2, 1, 5, 2], 10)
    assert second["segmentation"]["size"] == [6, 8]
    assert (from_run_lengths(second["segmentation"]["counts"], (6, 8)) == (ids == 3)).all()


def test_a_mask_holds_ids_of_any_size() -> None:
    assert mask_image(np.array([[0, 7]], dtype=np.int32)).getpixel((1, 0)) == 7
    assert np.asarray(mask_image(np.array([[0, 700]], dtype=np.int32)))[0, 1] == 700
