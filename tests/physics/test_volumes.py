"""Voxels that are cut: brute force over all voxels, and geometry, are the oracles."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from ligature.model.voxels import MOST_CHUNKS, VolumeForm
from ligature.physics.volumes import Voxels

SIZES = st.tuples(*[st.floats(0.002, 0.02)] * 3).map(np.array)
POINTS = arrays.arrays(float, 3, elements=st.floats(-0.02, 0.02))
FORMS = st.builds(
    VolumeForm,
    arrays.arrays(np.uint8, st.tuples(*[st.integers(1, 20)] * 3), elements=st.sampled_from([0, 90, 200, 255])),
    st.sampled_from([1.0, 100.5, 127.5, 255.0]),
    SIZES,
)
CUTS = st.lists(st.tuples(POINTS, POINTS, st.floats(1e-4, 0.01)), min_size=1, max_size=4)


def middles(form: VolumeForm) -> np.ndarray:
    """Middles (nx, ny, nz, 3) of all voxels: they fill the box."""
    axes = [size * ((np.arange(n) + 0.5) / n - 0.5) for n, size in zip(form.values.shape, form.size, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)


def distances(points: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """From a segment, by the three cases of the schoolbook."""
    way = end - start
    length = np.linalg.norm(way)
    ends = np.minimum(np.linalg.norm(points - start, axis=-1), np.linalg.norm(points - end, axis=-1))
    if length < 1e-12:
        return ends
    along = (points - start) @ (way / length)
    beside = np.linalg.norm(np.cross(points - start, way / length), axis=-1)
    return np.where((along >= 0) & (along <= length), beside, ends)


@settings(max_examples=60, deadline=None)
@given(form=FORMS, cuts=CUTS)
def test_what_is_removed_is_what_the_swept_ball_meets(form: VolumeForm, cuts: list) -> None:
    voxels, points = Voxels(form, form.values.copy()), middles(form)
    inside, sure = form.values >= form.level, np.ones(form.values.shape, dtype=bool)
    for start, end, radius in cuts:
        away = distances(points, start, end)
        before, values = inside.copy(), voxels.values.copy()
        removed = voxels.cut(start, end, radius)
        inside &= away >= radius
        sure &= np.abs(away - radius) > 1e-12
        now = voxels.values >= form.level
        assert (now == inside)[sure].all()
        assert (voxels.values <= values).all(), "nothing grows"
        assert (voxels.values == values)[away > radius + 2 * form.spacing.max()].all(), "nothing else changes"
        inside = now
        assert removed == np.count_nonzero(before & ~now)
        assert voxels.count == np.count_nonzero(now)
        assert voxels.removed == np.count_nonzero(form.values >= form.level) - voxels.count
        assert voxels.cut(start, end, radius) == 0, "what is gone is gone"


@settings(max_examples=20, deadline=None)
@given(form=FORMS, cuts=CUTS)
def test_the_surface_is_closed_after_every_cut(form: VolumeForm, cuts: list) -> None:
    voxels = Voxels(form, form.values.copy())
    parts = [form.surface(voxels.values, k) for k in range(len(form.chunks))]
    for cut in cuts:
        before = voxels.values.copy()
        voxels.cut(*cut)
        for k in form.changed(before, voxels.values):
            parts[k] = form.surface(voxels.values, k)
        for k, part in enumerate(parts):
            assert all(np.array_equal(a, b) for a, b in zip(part, form.surface(voxels.values, k), strict=True))
        corners = np.concatenate([v[f].reshape(-1, 3) for v, _, f in parts])
        faces = np.unique(corners, axis=0, return_inverse=True)[1].reshape(-1, 3)
        # vertices of two cells may be in one place: so not "two faces an edge", but as many one way as the other
        edges = np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)])
        balance: dict[tuple[int, int], int] = {}
        for a, b in edges.tolist():
            balance[min(a, b), max(a, b)] = balance.get((min(a, b), max(a, b)), 0) + (a < b) - (a > b)
        assert not any(balance.values())


@settings(max_examples=40, deadline=None)
@given(form=FORMS, centre=POINTS, radius=st.floats(1e-4, 0.01))
def test_what_a_ball_shares_with_the_inside(form: VolumeForm, centre: np.ndarray, radius: float) -> None:
    voxels, points = Voxels(form, form.values.copy()), middles(form)
    found = voxels.overlap(centre, radius)
    away, inside = np.linalg.norm(points - centre, axis=-1), form.values >= form.level
    half, each = 0.5 * form.spacing.max(), np.prod(form.spacing)
    least, most = (inside & (away <= radius - half)).sum() * each, (inside & (away < radius + half)).sum() * each
    assert least * (1 - 1e-9) <= found.volume <= most * (1 + 1e-9)
    assert np.linalg.norm(found.moment) <= (radius + half) * found.volume * (1 + 1e-9)
    if not (inside & (away < radius + half)).any():
        assert found.volume == 0.0 and not found.moment.any()


@pytest.mark.parametrize("depth", [0.2e-3, 0.5e-3, 1e-3, 2e-3, 3.5e-3])
def test_the_overlap_with_a_plane_is_a_cap(depth: float) -> None:
    """A ball of 2 mm that is ``depth`` below the flat side of a block shares pi h² (r - h / 3) with it."""
    values = np.full((60, 60, 40), 255, dtype=np.uint8)
    form, radius = VolumeForm(values, 127.5, np.array([0.012, 0.012, 0.008])), 2e-3
    found = Voxels(form, values.copy()).overlap(np.array([1.3e-5, 0.4e-4, 0.004 + radius - depth]), radius)
    assert found.volume == pytest.approx(np.pi * depth**2 * (radius - depth / 3), rel=0.02, abs=2e-12)
    away = -found.moment / np.linalg.norm(found.moment)
    assert away == pytest.approx([0, 0, 1], abs=0.05)


def test_a_cut_surface_is_where_the_ball_was_to_a_tenth_of_a_voxel() -> None:
    values = np.full((40, 40, 40), 255, dtype=np.uint8)
    form, radius = VolumeForm(values, 127.5, np.full(3, 0.02)), 4e-3
    voxels = Voxels(form, values.copy())
    voxels.cut(np.zeros(3), np.zeros(3), radius)
    vertices = np.concatenate([form.surface(voxels.values, k)[0] for k in range(len(form.chunks))])
    within = np.abs(vertices).max(axis=1) < 0.006
    assert within.sum() > 200
    assert np.abs(np.linalg.norm(vertices[within], axis=1) - radius).max() < 0.1 * 0.5e-3


@pytest.mark.parametrize("shape", [(1, 1, 1), (15, 16, 17), (114, 114, 114), (1500, 1000, 1), (2, 3, 4096)])
def test_chunks_share_out_all_edges(shape: tuple[int, ...]) -> None:
    form = VolumeForm(np.zeros(shape, dtype=np.uint8), 1.0, np.ones(3))
    assert len(form.chunks) <= MOST_CHUNKS
    seen = np.zeros(np.array(shape) + 1, dtype=int)
    for low, high in form.chunks:
        seen[tuple(slice(a + 1, b + 1) for a, b in zip(low, high, strict=True))] += 1
    assert (seen == 1).all()
