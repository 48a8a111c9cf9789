"""Needles: any arc is fitted, and slender short open arcs of shapes are needles with their tip away from the thread."""

from __future__ import annotations

import math
from pathlib import Path

import ligature
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature.model.frames import rpy_matrix
from ligature.model.needles import LONGEST, SLENDER, WIDEST_TURN, fit_arc
from ligature.model.piercing import Needle
from ligature.model.scene import Scene

from tests.model.test_load import chain

ANGLES = st.tuples(*[st.floats(-3.0, 3.0)] * 3)


@given(
    ANGLES, st.tuples(*[st.floats(-0.1, 0.1)] * 3), st.floats(0.002, 0.1), st.floats(0.5, float(WIDEST_TURN)), st.integers(3, 20),
    st.booleans(),
)  # fmt: skip
def test_the_points_of_an_arc_give_the_arc(
    turned: tuple[float, ...], centre: tuple[float, ...], radius: float, turn: float, count: int, reverse: bool
) -> None:
    angles = np.linspace(0.0, turn, count)[:: -1 if reverse else 1]
    flat = radius * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(count)])
    points = flat @ rpy_matrix(*turned).T + centre
    arc = fit_arc(points)
    assert arc.radius == pytest.approx(radius, rel=1e-6)
    np.testing.assert_allclose(arc.centre, centre, atol=1e-6 * radius)
    assert arc.length == pytest.approx(radius * turn, rel=1e-6)
    np.testing.assert_allclose(arc.point(0.0), points[-1], atol=1e-6 * radius)
    np.testing.assert_allclose(arc.point(arc.length), points[0], atol=1e-6 * radius)


@pytest.mark.parametrize(("count", "words"), [(2, "needs three points"), (5, "not on one line")])
def test_points_that_make_no_arc_are_refused(count: int, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        fit_arc(np.outer(np.arange(count), [1.0, 2.0, 3.0]))


def loaded(
    folder: Path, radius: float, turn: float, keys: str = "mass: 0.001", size: float = 0.0, more: str = ""
) -> Scene:
    """A body of 40 balls along an arc in its xy plane, from angle 0 on; one also stands ``size`` above and below it."""
    items = []
    for k, angle in enumerate(np.linspace(0.0, turn, 40)):
        at = f"x: {radius * math.cos(angle):.9f}, y: {radius * math.sin(angle):.9f}"
        items += [
            f"{{shape: SPHERE, geometry: {{radius: 0.0001}}, offset: {{position: {{{at}, z: {z}}}}}}}"
            for z in ({-size, 0.0, size} if k == 20 else {0.0})
        ]
    joints = "joints: [J]\n" + more if more else ""
    text = f"bodies: [N, T]\n{joints}N: {{name: n, {keys}, inertial offset: {{}}, compound collision shape: [{', '.join(items)}]}}\n"
    (folder / "m.yaml").write_text(text + "T: {name: t, mass: 1}\n")
    return ligature.load(folder / "m.yaml")


def needles(folder: Path, *shape: float, **more: object) -> tuple[Needle, ...]:
    return loaded(folder, *shape, **more).needles  # type: ignore[arg-type]


@pytest.mark.parametrize("share", [0.97, 1.03])
def test_a_needle_is_slender_short_and_open(tmp_path: Path, share: float) -> None:
    assert bool(needles(tmp_path, 0.01, share * WIDEST_TURN)) is (share < 1.0)
    assert bool(needles(tmp_path, share * LONGEST / 2.0, 2.0)) is (share < 1.0)
    assert bool(needles(tmp_path, 0.01, 2.0, size=share * 0.02 / SLENDER)) is (share < 1.0)


@pytest.mark.parametrize(
    ("keys", "found"),
    [
        ("mass: 0.001", True),
        ("mass: 0", False),
        ("mass: 0.001, ligature needle: false", False),
        ("mass: 0.001, ligature needle: true", True),
    ],
)
def test_a_fixed_body_or_one_that_opts_out_is_none(tmp_path: Path, keys: str, found: bool) -> None:
    scene = loaded(tmp_path, 0.01, 2.0, keys)
    assert [needle.body for needle in scene.needles] == [0] * found
    reported = [d for d in scene.diagnostics if d.code == "needle"]
    assert [d.message for d in reported] == ["'N' is a needle, 20.0 mm long, radius 10.0 mm"] * found


def test_a_body_that_a_joint_holds_is_none(tmp_path: Path) -> None:
    frames = "parent pivot: {x: 0, y: 0, z: 0}, child pivot: {x: 0, y: 0, z: 0}, parent axis: {x: 0, y: 0, z: 1}, child axis: {x: 0, y: 0, z: 1}"
    joint = f"J: {{name: j, type: revolute, parent: T, child: N, {frames}}}\n"
    assert needles(tmp_path, 0.01, 2.0, more=joint) == ()


@pytest.mark.parametrize("at_end", [False, True])
@pytest.mark.parametrize("parent", [False, True])
def test_the_tip_is_away_from_the_thread(tmp_path: Path, at_end: bool, parent: bool) -> None:
    turn = 2.0
    ends = np.array([[0.01 * math.cos(angle), 0.01 * math.sin(angle), 0.0] for angle in (0.0, turn)])
    x, y, _ = tail = ends[int(at_end)]
    file = tmp_path / "m.yaml"
    loaded(tmp_path, 0.01, turn)
    needle = [line for line in file.read_text().splitlines() if line.startswith("N:")][0]
    thread = chain().replace("bodies: [", "bodies: [N, ").replace("joints: [", "joints: [JN, ")
    for k in range(5):
        old = f"position: {{x: 0, y: 0, z: {0.01 * k}}}"
        thread = thread.replace(old, f"position: {{x: {x:.6f}, y: {y:.6f}, z: {0.01 * k + 0.005}}}")
    places = [f"{{x: {x:.6f}, y: {y:.6f}, z: 0}}", "{x: 0, y: 0, z: -0.005}"]
    one, two = ("N", "T0") if parent else ("T0", "N")
    first, second = places if parent else reversed(places)
    joint = (
        f"JN: {{name: jn, type: fixed, parent: {one}, child: {two}, parent pivot: {first}, child pivot: {second}, "
        "parent axis: {x: 0, y: 0, z: 1}, child axis: {x: 0, y: 0, z: 1}}\n"
    )
    file.write_text(f"{thread}{needle}\n{joint}")
    scene = ligature.load(file)
    assert len(scene.rods) == 1
    (found,) = scene.needles
    np.testing.assert_allclose(found.arc.point(found.arc.length), tail, atol=1e-5)
    np.testing.assert_allclose(found.arc.point(0.0), ends[int(not at_end)], atol=1e-5)
    assert found.arc.begin < found.arc.end


@pytest.mark.parametrize(
    "shape",
    [
        "shape: CAPSULE, geometry: {radius: 0.0002, height: 0.002, axis: X}",
        "shape: CYLINDER, geometry: {radius: 0.0002, height: 0.002, axis: X}",
        "shape: BOX, geometry: {x: 0.002, y: 0.0004, z: 0.0004}",
    ],
)
def test_a_shape_counts_by_its_middle_line(tmp_path: Path, shape: str) -> None:
    """Ten shapes of 2 mm along 20 mm of an arc: what they reach beyond it, and beside it, is small."""
    items = ", ".join(
        f"{{{shape}, offset: {{position: {{x: {0.01 * math.cos(a):.9f}, y: {0.01 * math.sin(a):.9f}, z: 0}}, "
        f"orientation: {{r: 0, p: 0, y: {a + math.pi / 2:.9f}}}}}}}"
        for a in np.arange(0.1, 2.0, 0.2)
    )
    (tmp_path / "m.yaml").write_text(
        f"bodies: [N]\nN: {{name: n, mass: 0.001, inertial offset: {{}}, compound collision shape: [{items}]}}\n"
    )
    (needle,) = ligature.load(tmp_path / "m.yaml").needles
    assert needle.arc.length == pytest.approx(0.02, rel=0.01)
    assert needle.arc.radius == pytest.approx(0.01, rel=0.01)
