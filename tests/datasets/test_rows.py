"""Rows and pictures come out of HDF5 as they went in: its own filters unpack what is packed here."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.datasets.rows import GATHERED, EpisodeRows, Packed


@settings(max_examples=30, deadline=None)
@given(
    dtype=st.sampled_from(["u1", "u2"]),
    shape=st.tuples(st.integers(1, 9), st.integers(1, 9)) | st.tuples(st.integers(1, 9), st.integers(1, 9), st.just(3)),
    count=st.integers(1, 4),
    seed=st.integers(0, 99),
    levels=st.sampled_from([1, 3, 65536]),
)
def test_pictures_are_read_as_they_were_written(
    dtype: str, shape: tuple[int, ...], count: int, seed: int, levels: int
) -> None:
    drawn = np.random.default_rng(seed).integers(0, levels, (count, *shape)).astype(dtype)
    with h5py.File("x", "w", driver="core", backing_store=False) as file:
        rows = EpisodeRows(file)
        for picture in drawn:
            rows.append_picture("a/rgb", Packed.of(np.asfortranarray(picture)), units="depth_unit")
        rows.finish()
        kept = file["a/rgb"]
        assert (kept.chunks, kept.compression, kept.shuffle) == ((1, *shape), "gzip", True)
        assert kept.dtype == drawn.dtype and kept.attrs["units"] == "depth_unit"
        assert (kept[:] == drawn).all()


@pytest.mark.parametrize("count", [1, GATHERED - 1, GATHERED, 2 * GATHERED + 3])
def test_rows_that_wait_are_written_by_the_end(tmp_path: Path, count: int) -> None:
    state = np.zeros(3)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        rows = EpisodeRows(file)
        for k in range(count):
            state[:] = k, -k, 0.5  # one array, as a simulation's state is
            rows.append("needle/pose", state, "f4", units="m")
            rows.append("time", float(k), "f8")
        rows.finish()
    with h5py.File(tmp_path / "a.h5") as file:
        assert (file["time"][:] == np.arange(count)).all()
        assert (file["needle/pose"][:, 1] == -np.arange(count)).all()
        assert file["needle/pose"].chunks == (GATHERED, 3)
