"""What of a rod a jaw grasps: against all of its elements, one by one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.model.shapes import Sphere
from ligature.suture.description import from_material
from ligature.suture.partners import JawPads
from ligature.suture.rod import Rod
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from tests.suture.conftest import Bench, body, line


def crooked(seed: int, n: int) -> Rod:
    """A rod of ``n`` elements of other lengths, which lie anyhow."""
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.uniform(1e-3, 3e-3, (n + 1, 1)) * [[1.0, 0.0, 0.0]], axis=0)
    rod = Rod(from_material(points, 2e-4, 1e9, 1200.0))
    rod.positions[:] = rng.normal(0.0, 3e-3, (n, 3))
    rod.orientations[:] = Rotation.random(n, random_state=seed).as_quat()
    return rod


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(2, 40))
def test_the_nearest_point_is_on_the_axis_of_the_element_whose_centre_is_nearest(seed: int, n: int) -> None:
    rod = crooked(seed, n)
    point = np.random.default_rng([seed, 1]).normal(0.0, 5e-3, 3)
    element, on_rod, way, arc = rod.nearest(point)
    assert element == np.linalg.norm(rod.positions - point, axis=1).argmin()
    a, b = rod.positions[element] + Rotation.from_quat(rod.orientations[element]).apply(rod.description.ends[element])
    best = minimize_scalar(
        lambda s: np.linalg.norm(a + s * (b - a) - point), bounds=(0.0, 1.0), method="bounded",
        options={"xatol": 1e-12},
    ).x  # fmt: skip
    assert on_rod == pytest.approx(a + best * (b - a), abs=1e-8)
    assert way == pytest.approx((b - a) / np.linalg.norm(b - a), abs=1e-12)
    lengths = np.linalg.norm(rod.description.ends[:, 1] - rod.description.ends[:, 0], axis=1)
    assert arc == pytest.approx(lengths[:element].sum() + np.linalg.norm(on_rod - a), abs=1e-12)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), ticks=st.integers(2, 12))
def test_pads_whose_limit_alone_changes_hold_as_those_that_are_set_anew(seed: int, ticks: int) -> None:
    def held(anew: bool) -> np.ndarray:
        rng = np.random.default_rng(seed)
        bench = Bench([body(0, Sphere(1e-4), at=(0.01, 0.0, 0.01)), body(1, Sphere(1e-4), at=(0.02, 0.0, 0.01))])
        rod = bench.add(from_material(line(20, 0.03), 2e-4, 1e9, 1200.0, friction=0.5))
        points = list(rng.uniform(-1e-3, 1e-3, (2, 2, 3)) - [0.0, 0.0, 0.01])  # the same arrays in every tick
        normal = np.array([0.0, 1.0, 0.0])
        forces, remade = [], []
        for _ in range(ticks):
            limits = rng.uniform(0.0, 2.0, 2)
            pads = [
                JawPads(b, points[b].copy() if anew else points[b], normal, limit) for b, limit in enumerate(limits)
            ]
            rows = rod._constraint_rows[1]
            rod.set_pads(pads)
            remade.append(rod._constraint_rows[1] is not rows)
            bench.twist[0][:3] = rng.normal(0.0, 0.05, 3)
            bench.step()
            forces.append([rod.grasped(b)[1] for b in (0, 1)])
        assert remade == [True] + [anew] * (ticks - 1)
        return np.array([*np.ravel(forces), *rod.positions.ravel()])

    anew, kept = held(True), held(False)
    assert (anew == kept).all()
    assert np.abs(kept[: 6 * ticks]).max() > 0.0


def test_what_no_pads_hold_is_none() -> None:
    bench = Bench([body(0, Sphere(1e-3), at=(0.01, 0.0, 0.1))])
    rod = bench.add(from_material(line(20, 0.03), 2e-4, 1e9, 1200.0))
    bench.step()
    element, force = rod.grasped(0)
    assert element == -1
    assert (force == 0.0).all()
