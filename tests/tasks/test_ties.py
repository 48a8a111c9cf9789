"""How a long end goes around jaws, and what tells where a thread leaves a vessel."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from ligature.tasks import ties
from scipy.spatial import ConvexHull

VESSEL, RADIUS = np.array([0.1, 0.2, 0.7]), 0.003
SPHERE = st.tuples(st.floats(0.1, 3.0), st.floats(-3.0, 3.0)).map(
    lambda angles: np.array(
        [np.sin(angles[0]) * np.cos(angles[1]), np.sin(angles[0]) * np.sin(angles[1]), np.cos(angles[0])]
    )
)


@given(st.floats(-2.0, -1.2), st.floats(0.01, 0.05), st.floats(1.1, 3.0), st.floats(0.011, 0.045))
def test_a_taut_thread_around_the_jaws_is_half_the_hull_of_its_ends_and_the_jaws(
    at: float, away: float, angle: float, radius: float
) -> None:
    """Up to half a turn: the shortest way around a circle is the part of the convex hull on that side."""
    anchor, end = (r * np.array([np.cos(a), np.sin(a)]) for r, a in ((away, at), (radius, angle)))
    found = ties.length_around(anchor, angle, radius)
    around = np.linspace(0.0, 2.0 * np.pi, 4000)
    circle = ties.FINGER * np.column_stack([np.cos(around), np.sin(around)])
    points = np.vstack([anchor, end, circle])
    hull = points[ConvexHull(points).vertices]  # counter-clockwise
    start = int(np.flatnonzero((hull == anchor).all(axis=1))[0])
    way = np.roll(hull, -start, axis=0)
    stop = int(np.flatnonzero((way == end).all(axis=1))[0])
    length = float(np.linalg.norm(np.diff(way[: stop + 1], axis=0), axis=1).sum())
    assert found == pytest.approx(length, rel=2e-3)


@given(st.floats(0.02, 0.045), st.floats(1.0, 7.3), st.floats(0.05, 0.1))
def test_the_other_tool_never_draws_the_thread_taut_but_where_it_must_keep_clear(
    height: float, angle: float, length: float
) -> None:
    anchor = np.array([0.003, -height])
    radius = ties.radius_for(anchor, angle, length)
    assert radius >= ties.THINNEST
    assert radius == ties.THINNEST or ties.length_around(anchor, angle, radius) <= length


@pytest.mark.parametrize("table", [ties.SHARES, ties.ASIDE])
def test_tables_go_from_the_first_to_the_last_angle(table: ties.Table) -> None:
    """`numpy.interp` takes angles that do not rise without a word."""
    angles = [angle for angle, _ in table]
    assert angles == sorted(set(angles)) and (angles[0], angles[-1]) == (ties.BEGIN, ties.END)
    assert all(ties.between(table, angle) == value for angle, value in table)


@given(
    st.floats(0.022, 0.04), st.floats(-0.004, 0.004), st.floats(0.06, 0.1), st.floats(0.0, 0.01),
    st.floats(ties.BEGIN, ties.END),
)  # fmt: skip
def test_the_way_of_the_second_throw_is_the_mirror_image_of_that_of_the_first(
    height: float, beside: float, length: float, slack: float, degrees: float
) -> None:
    centre, mirror = VESSEL + [0.01, 0.0, height], np.array([1.0, -1.0, 1.0])
    there, here = (
        ties.Wrap(centre, VESSEL + [0.0, side * beside, 0.0], side, length, height).at(degrees, slack) - centre
        for side in (1.0, -1.0)
    )
    assert np.allclose(here, there * mirror)
    assert here[2] >= -ties.BELOW - 1e-9
    assert here[2] >= ties.OVER - height - 1e-9 or np.hypot(*here[1:]) == pytest.approx(ties.THINNEST)
    assert np.hypot(*here[1:]) >= ties.THINNEST - 1e-9


def straight(turned: float = 0.0) -> np.ndarray:
    """A thread of 141 points, 1 mm apart, that lies across below the vessel."""
    y = np.arange(-40, 101) * -1e-3
    return VESSEL + np.column_stack([y * np.sin(turned), y * np.cos(turned), np.full(141, -RADIUS)])


@given(st.floats(-0.5, 0.5))
def test_a_thread_leaves_the_vessel_where_it_is_beside_it(turned: float) -> None:
    short, long = ties.leaves(straight(turned), VESSEL, RADIUS, knotted=False)
    points = straight(turned) - VESSEL
    away = np.hypot(points[:, 1], points[:, 2])
    assert short < 40 < long
    assert away[short] < ties.BESIDE * RADIUS <= away[short - 1]
    assert away[long] < 1.15 * ties.BESIDE * RADIUS <= away[long + 1]


@given(st.integers(20, 60), st.floats(0.0005, 0.001), st.floats(0.6, 1.5))
def test_a_thread_leaves_a_knot_where_it_touches_itself_last(loop: int, apart: float, turned: float) -> None:
    """A loop of ``loop`` millimetres whose strands cross above the vessel, and both ends led away."""
    around = np.linspace(0.0, 2.0 * np.pi, loop + 1)
    r = loop * 1e-3 / (2.0 * np.pi)
    ring = np.column_stack([np.linspace(0.0, apart, loop + 1), r * np.sin(around), r * np.cos(around) - r])
    away = np.arange(1, 41)[:, None] * 1e-3 * np.array([0.0, np.cos(turned), np.abs(np.sin(turned))])
    points = VESSEL + [0.0, 0.0, RADIUS] + np.vstack([away[::-1] * [1.0, -1.0, 1.0] + ring[0], ring, away + ring[-1]])
    short, long = ties.leaves(points, VESSEL, RADIUS, knotted=True)
    assert abs(short - 40) <= 2 and abs(long - 40 - loop) <= 2


@given(st.floats(-2.0, 2.0), st.floats(0.003, 0.02), st.floats(-0.02, 0.005), st.floats(-0.004, 0.004))
def test_a_strand_goes_around_jaws_where_it_turns_more_than_from_below_to_above(
    turns: float, radius: float, at: float, drift: float
) -> None:
    assume(abs(2.0 * np.pi * abs(turns) - ties.ONCE) > 0.8)
    share = np.linspace(0.0, 1.0, 60)
    angles = 2.0 * np.pi * turns * share
    strand = np.column_stack([radius * np.cos(angles), radius * np.sin(angles), at + drift * share])
    assert ties.fingers_within(strand) == (2 if 2.0 * np.pi * abs(turns) > ties.ONCE else 0)
    assert ties.fingers_within(strand + [0.0, 0.0, 0.05]) == 0
    assert ties.fingers_within(strand + [2.0 * radius, 0.0, 0.0]) == 0


@given(st.floats(-0.01, 0.01), st.floats(-0.5, 0.5), st.floats(0.005, 0.03))
def test_an_upright_strand_is_seen_level_with_the_jaws(aside: float, lean: float, ahead: float) -> None:
    x = np.arange(-20, 21) * 1e-3 + 0.0002
    found = ties.level_with(np.column_stack([x, aside + 0.0 * x, ahead + lean * x]))
    assert abs(found[0]) < 0.003
    assert found[1] == pytest.approx(aside)


@given(st.floats(-0.03, 0.03), st.floats(0.035, 0.05))
def test_an_end_that_leans_reaches_as_far_along_the_vessel_as_it_is_told(along: float, length: float) -> None:
    way = ties.leaning(VESSEL, VESSEL[0] + along, length)
    assert np.linalg.norm(way) == pytest.approx(1.0)
    assert (length * way)[0] == pytest.approx(along) and way[1] == 0.0 and way[2] > 0.0


@given(SPHERE, SPHERE, st.floats(0.0, 1.0))
def test_a_sweep_turns_at_a_constant_rate_in_one_plane(a: np.ndarray, b: np.ndarray, share: float) -> None:
    angle = np.arccos(np.clip(a @ b, -1.0, 1.0))
    if angle > 3.1:
        return
    way = ties.swept(a, b, share)
    assert np.linalg.norm(way) == pytest.approx(1.0, abs=1e-6)
    assert np.arccos(np.clip(a @ way, -1.0, 1.0)) == pytest.approx(share * angle, abs=1e-5)
    assert abs(np.cross(a, b) @ way) < 1e-6
