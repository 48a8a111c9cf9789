"""Jaws: two fingers about one axis, whichever way the file turns it, and nothing that only looks like them."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature.model.jaws import PARALLEL, SAME_PLACE
from ligature.model.scene import Jaw

LENGTH, WIDTH = 0.02, 0.004
BOX = f"collision shape: BOX, collision geometry: {{x: {LENGTH}, y: 0.002, z: {WIDTH}}}, collision offset: {{position: {{x: {LENGTH / 2}, y: {{y}}, z: 0}}}}"
CYLINDER = f"collision shape: CYLINDER, collision geometry: {{radius: 0.001, height: {LENGTH}, axis: X}}, collision offset: {{position: {{x: {LENGTH / 2}, y: {{y}}, z: 0}}}}"
SPHERE = f"collision shape: SPHERE, collision geometry: {{radius: 0.002}}, collision offset: {{position: {{x: {LENGTH - 0.002}, y: {{y}}, z: 0}}}}"


def finger(
    name: str, y: float, side: int, shape: str = BOX, kind: str = "revolute", mass: float = 0.01,
    at: tuple[float, float, float] = (0.0, 0.0, 0.0), lean: float = 0.0, limits: str = "low: -1, high: 1",
) -> str:  # fmt: skip
    """A finger along x whose shape lies at ``y``, on an axis along ``side`` z that leans by ``lean`` rad."""
    axis = f"{{x: 0, y: {np.sin(lean):.6f}, z: {side * np.cos(lean):.6f}}}"
    x, y_, z = at
    return (
        f"{name}: {{name: {name}, mass: {mass}, inertial offset: {{}}, {shape.replace('{y}', str(y))}}}\n"
        f"J{name}: {{name: j{name}, type: {kind}, parent: P, child: {name}, joint limits: {{{limits}}}, "
        f"parent pivot: {{x: {x}, y: {y_}, z: {z}}}, child pivot: {{x: 0, y: 0, z: 0}}, parent axis: {axis}, child axis: {axis}}}\n"
    )


def jaws(folder: Path, *fingers: str, more: str = "") -> tuple[Jaw, ...]:
    names = "ABCD"[: len(fingers)]
    text = f"bodies: [P, {', '.join(names)}]\njoints: [{', '.join(f'J{n}' for n in names)}]\nP: {{name: p, mass: 1, inertial offset: {{}}}}\n"
    (folder / "m.yaml").write_text(text + "".join(fingers) + more)
    return ligature.load(folder / "m.yaml").jaws


@pytest.mark.parametrize("sides", [(1, 1), (1, -1), (-1, 1), (-1, -1)])
@pytest.mark.parametrize("up", [0.002, -0.002])
@pytest.mark.parametrize(
    ("shape", "reach", "width"),
    [
        (BOX, np.hypot(LENGTH, 0.003), WIDTH),
        (CYLINDER, np.hypot(LENGTH, 0.003), 0.002),
        (SPHERE, np.hypot(LENGTH, 0.004), 0.004),
    ],
)
def test_each_finger_opens_away_from_the_other(
    tmp_path: Path, sides: tuple[int, int], up: float, shape: str, reach: float, width: float
) -> None:
    (jaw,) = jaws(tmp_path, finger("A", up, sides[0], shape), finger("B", -up, sides[1], shape))
    assert (jaw.name, jaw.palm, jaw.fingers, jaw.joints) == ("P", 0, (1, 2), (0, 1))
    assert jaw.opening == tuple(np.sign(y) * side for y, side in zip((up, -up), sides, strict=True))
    assert jaw.half_width == pytest.approx(width / 2)
    assert jaw.reach == pytest.approx(reach)
    np.testing.assert_allclose(jaw.axis, [0, 0, sides[0]], atol=1e-9)
    np.testing.assert_allclose(jaw.pivot, 0.0, atol=1e-9)


@pytest.mark.parametrize("share", [0.97, 1.03])
def test_fingers_about_two_axes_are_no_jaw(tmp_path: Path, share: float) -> None:
    """Their pivots are apart, or their axes lean away from each other."""
    one = finger("A", 0.002, 1)
    assert bool(jaws(tmp_path, one, finger("B", -0.002, 1, at=(share * SAME_PLACE, 0.0, 0.0)))) is (share < 1.0)
    assert bool(jaws(tmp_path, one, finger("B", -0.002, -1, lean=share * float(np.arccos(PARALLEL))))) is (share < 1.0)


@pytest.mark.parametrize(
    "other",
    [
        finger("B", -0.002, 1, kind="prismatic"),
        finger("B", -0.002, 1, mass=0.0),
        finger("B", -0.002, 1, shape="location: {}"),
        "",
    ],
)
def test_what_is_no_pair_of_free_fingers_is_no_jaw(tmp_path: Path, other: str) -> None:
    assert jaws(tmp_path, finger("A", 0.002, 1), *([other] if other else [])) == ()


def test_three_fingers_are_no_jaw(tmp_path: Path) -> None:
    assert jaws(tmp_path, *(finger(name, 0.002, 1) for name in "ABC")) == ()


@pytest.mark.parametrize(
    ("limits", "opening"),
    [("low: -0.2, high: 1", 1.0), ("low: -1, high: 0.2", -1.0), ("low: -1, high: 1", 1.0), ("", 1.0)],
)
def test_fingers_that_lie_on_each_other_open_to_where_they_can_go(tmp_path: Path, limits: str, opening: float) -> None:
    (jaw,) = jaws(tmp_path, *(finger(name, 0.0, 1, limits=limits) for name in "AB"))
    assert jaw.opening == (opening, -opening)
