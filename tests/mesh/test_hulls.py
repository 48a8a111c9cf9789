"""Convex hulls that are kept are those that SciPy finds, and damaged files of them are found anew."""

from __future__ import annotations

from pathlib import Path

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies as st
from ligature.mesh import hulls
from scipy.spatial import ConvexHull


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("LIGATURE_CACHE", str(tmp_path))
    return tmp_path / "hulls"


def refuse(points: hulls.Array) -> hulls.ConvexHull:
    raise AssertionError("a hull that is kept is computed")


@hypothesis.settings(
    suppress_health_check=[hypothesis.HealthCheck.function_scoped_fixture], max_examples=25, deadline=None
)
@hypothesis.given(seed=st.integers(0, 2**32 - 1), count=st.integers(5, 60), dimensions=st.integers(2, 3))
def test_a_hull_is_the_same_when_it_is_read_again(
    folder: Path, monkeypatch: pytest.MonkeyPatch, seed: int, count: int, dimensions: int
) -> None:
    points = np.random.default_rng(seed).normal(size=(count, dimensions))
    expected = ConvexHull(points)
    for computed in (hulls._computed, refuse):
        with monkeypatch.context() as patch:
            patch.setattr(hulls, "_computed", computed)
            found = hulls.convex_hull(points)
        for name, array in found._asdict().items():
            np.testing.assert_array_equal(array, getattr(expected, name), name)
    transposed = hulls.convex_hull(points.T.copy().T)
    np.testing.assert_array_equal(transposed.equations, expected.equations)


def test_points_that_enclose_nothing_are_kept_too(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    square = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    with pytest.raises(ValueError, match="enclose no volume"):
        hulls.convex_hull(square)
    monkeypatch.setattr(hulls, "_computed", refuse)
    with pytest.raises(ValueError, match="enclose no volume"):
        hulls.convex_hull(square)
    np.testing.assert_array_equal(np.abs(hulls.hull_planes(square)[:, :3]).sum(axis=0), [2.0, 2.0, 2.0])


@pytest.mark.parametrize(
    "damage", [lambda data: b"", lambda data: data[:-3], lambda data: data[:50] + b"\xff" + data[51:]]
)
def test_a_damaged_file_is_replaced(folder: Path, damage: object) -> None:
    points = np.random.default_rng(0).normal(size=(20, 3))
    whole = hulls.convex_hull(points)
    (path,) = folder.iterdir()
    data = path.read_bytes()
    path.write_bytes(damage(data))  # type: ignore[operator]
    np.testing.assert_array_equal(hulls.convex_hull(points).simplices, whole.simplices)
    assert path.read_bytes() == data


def test_who_can_keep_nothing_still_gets_hulls(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise OSError("the disk is full")

    monkeypatch.setattr(hulls, "write_atomically", fail)
    points = np.random.default_rng(1).normal(size=(20, 3))
    np.testing.assert_array_equal(hulls.convex_hull(points).simplices, ConvexHull(points).simplices)
