"""Wounds, their stitches and their score: by made-up deformations of the scene's tissue, and of its punctures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import ligature
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.model.state import new_state
from ligature.tasks import MissingBodies
from ligature.tasks.wounds import CLOSED, OUT, ClosureScore, Stitch, Wound, torn

SCENES = Path(__file__).resolve().parents[2] / "scenes"


@pytest.fixture(scope="module")
def scene() -> ligature.Scene:
    return ligature.load(SCENES / "soft_suturing" / "launch.yaml")


def bent(state: np.ndarray, seed: int) -> np.ndarray:
    """The state with the tissue's nodes moved by a gentle affine motion and a wave."""
    rng = np.random.default_rng(seed)
    node = state["tissue_node"]
    middle = node.mean(axis=0)
    node[:] = middle + (node - middle) @ (np.eye(3) + rng.uniform(-0.1, 0.1, (3, 3))).T + rng.uniform(-0.01, 0.01, 3)
    node[:, 2] += 1e-3 * np.sin(100.0 * node[:, 0])
    return state


def test_the_wound_of_the_scene_gapes_as_its_file_has_it(scene: ligature.Scene) -> None:
    wound, state = Wound.of(scene), new_state(scene)[0]
    assert wound.length == pytest.approx(0.04)
    for place in (-0.015, 0.0, 0.015):
        assert wound.gap(state, place) == pytest.approx(0.004, abs=5e-6)
    np.testing.assert_allclose(wound.axes(state), np.eye(3), atol=1e-12)


def test_a_scene_without_a_wound_is_refused() -> None:
    block = ligature.load(SCENES / "needle_insertion" / "launch.yaml")
    with pytest.raises(MissingBodies, match="has no wound: no slit of soft tissue reaches its upper side"):
        Wound.of(block)


def test_the_gap_is_what_the_lips_have_moved(scene: ligature.Scene) -> None:
    wound, state = Wound.of(scene), new_state(scene)[0]
    far = state["tissue_node"][:, 0] > scene.bodies[wound.tissue.body].T_world_body[0, 3]
    state["tissue_node"][far, 0] -= 0.0045
    assert wound.gap(state, 0.0) == pytest.approx(-0.0005, abs=5e-6)


@settings(deadline=None, max_examples=15)
@given(
    st.integers(0, 1000), st.floats(-0.01, 0.01), st.tuples(*[st.floats(0.001, 0.008)] * 4), st.floats(-0.002, 0.002)
)
def test_a_stitch_is_found_by_its_punctures_however_the_tissue_is_bent(
    scene: ligature.Scene, seed: int, place: float, sizes: tuple[float, ...], aside: float
) -> None:
    wound, state = Wound.of(scene), bent(new_state(scene)[0], seed)
    widths, depths = sizes[:2], sizes[2:]
    points = [wound.point(state, side, place + aside, w) for side, w in zip((-1, 1), widths, strict=True)]
    points += [wound.point(state, side, place + aside, 0.0, d) for side, d in zip((-1, 1), depths, strict=True)]
    k = wound.tissue.index
    state["puncture_point"][k][:4], state["puncture_count"][k] = points[::-1], 4
    stitch = wound.stitch(state, place)
    assert stitch is not None
    np.testing.assert_allclose(stitch.figures, [*widths, *depths, place + aside, place + aside], atol=2e-4)
    state["puncture_count"][k] = 3
    assert wound.stitch(state, place) is None


def test_a_wound_counts_as_closed_when_every_stitch_was_made_and_holds_it_together() -> None:
    stitch = Stitch((0.0045, 0.004), (0.002, 0.0026), (0.0, 0.0))
    score = ClosureScore((2, 0.0045), (stitch, stitch), 0.004, (1e-4, 2e-4), 0.0, 0.3, 1.0, 30.0)
    assert score.success
    assert score.asymmetry == pytest.approx(5e-4)
    assert score.step == pytest.approx(6e-4)
    assert score.report()["gap"] == 2e-4
    assert any("2 of 2 stitches" in line for line in score.lines())
    assert not replace(score, gaps=(1e-4, CLOSED)).success
    assert not replace(score, stitches=(stitch,)).success


def test_a_puncture_that_moved_in_the_tissue_has_torn_it() -> None:
    before, after = Stitch((4e-3, 4e-3), (2e-3, 2e-3), (0, 0)), Stitch((4e-3, 3e-3), (2e-3, 2e-3), (0, 5e-4))
    assert torn([before, None], [after, None]) == pytest.approx(1e-3)
    assert torn([before], [None]) == OUT
    assert torn([], []) == 0.0
