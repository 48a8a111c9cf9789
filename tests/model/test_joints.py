"""Joints of every type: what of their keys becomes limits, springs and free axes."""

from __future__ import annotations

import math
from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature.adf.writer import flow_text
from ligature.model.axes import axes_of
from ligature.model.joints import SIX, fixed_joint
from ligature.model.scene import Joint, OutputType, Scene

POSED = "location: {{position: {{x: {}, y: 0.2, z: 0}}, orientation: {{r: 0.3, p: -0.4, y: {}}}}}"
BODY = "{0}: {{name: {0}, mass: 1, inertial offset: {{position: {{x: 0.1, y: 0, z: 0.2}}, orientation: {{r: 0.5, p: 0, y: 0}}}}, {1}}}\n"
FRAMES = (
    "parent pivot: {x: 0.1, y: 0.2, z: 0.3}, child pivot: {x: 0, y: -0.1, z: 0}, "
    "parent axis: {x: 0, y: 0.6, z: 0.8}, child axis: {x: 1, y: 0, z: 0}"
)


def loaded(folder: Path, kind: str, keys: str = "") -> Scene:
    bodies = BODY.format("A", POSED.format(1, 0.7)) + BODY.format("B", POSED.format(-1, -0.2))
    text = f"bodies: [A, B]\njoints: [J]\n{bodies}J: {{name: j, type: {kind}, parent: A, child: B, {keys}{FRAMES}}}\n"
    (folder / "m.yaml").write_text(text)
    return ligature.load(folder / "m.yaml")


def joint(folder: Path, kind: str, keys: str = "") -> Joint:
    return loaded(folder, kind, keys).joints[0]


def free(described: Joint) -> list[tuple[bool, str, float | None, float | None]]:
    """Whether each free axis slides, its letter, and its limits."""
    return [(a.prismatic, "xyz"[int(np.argmax(a.direction))], a.low, a.high) for a in axes_of(described) or ()]


@pytest.mark.parametrize("kind", ["revolute", "prismatic", "fixed", "torsion spring", "linear spring", "p2p"])
@pytest.mark.parametrize(
    ("low", "high"), [(-1.0, 2.0), (1.0, 1.0), (2.0, -1.0), (-3.5, 3.0), (None, 1.0), (None, None)]
)
def test_limits_count_by_the_type_of_the_joint(
    tmp_path: Path, kind: str, low: float | None, high: float | None
) -> None:
    ends = [f"{name}: {value}" for name, value in (("low", low), ("high", high)) if value is not None]
    found = joint(tmp_path, kind, f"joint limits: {{{', '.join(ends)}}}, " if ends else "")
    slides, spring = kind in ("prismatic", "linear spring"), "spring" in kind
    both = low is not None and high is not None
    kept = (low, high) if low is not None and high is not None and low <= high else (None, None)
    if kind == "revolute" and kept[0] is not None and high - low >= 2.0 * math.pi:  # type: ignore[operator]
        kept = (None, None)
    locked = kind in ("fixed", "p2p") or (spring and not both)
    assert free(found) == ([] if locked else [(slides, "x" if kind == "prismatic" else "z", *kept)])
    assert found.equilibrium == ((low + high) / 2 if spring and both else 0.0)  # type: ignore[operator]


def test_only_springs_have_stiffness_damping_and_where_they_rest(tmp_path: Path) -> None:
    keys = "joint limits: {low: -1, high: 1}, stiffness: 3, damping: 0.4, equilibrium point: 0.2, "
    (axis,) = axes_of(joint(tmp_path, "torsion spring", keys)) or ()
    assert (axis.stiffness, axis.damping, axis.rest, axis.sprung) == (3.0, 0.4, 0.2, True)
    (axis,) = axes_of(joint(tmp_path, "revolute", keys)) or ()
    assert (axis.stiffness, axis.damping, axis.rest, axis.sprung) == (0.0, 0.0, 0.0, False)


def test_a_cone_twist_turns_about_z_y_and_x(tmp_path: Path) -> None:
    found = free(joint(tmp_path, "cone twist", "joint limits: {x: 0.1, y: 0.2, z: 0.3}, "))
    assert found == [(False, "z", -0.3, 0.3), (False, "y", -0.2, 0.2), (False, "x", -0.1, 0.1)]


LIMITS = {
    "locked": (0.0, 0.0),
    "locked off zero": (0.5, 0.5),
    "limited": (-0.5, 0.25),
    "free": (1.0, -1.0),
    "beyond half a turn": (3.5, 3.8),
    "beyond both": (-4.0, 4.0),
}


@pytest.mark.parametrize("seed", range(8))
def test_each_axis_of_six_is_locked_limited_or_free(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    drawn = {name: LIMITS[str(rng.choice(list(LIMITS)))] for name in SIX}
    limits = {
        half: {end: {axis: drawn[f"{half}.{axis}"][k] for axis in "xyz"} for k, end in enumerate(("low", "high"))}
        for half in ("linear", "angular")
    }
    keys = f"joint limits: {flow_text(limits)}, "
    for tens, key in enumerate(("stiffness", "damping", "equilibrium point"), 1):
        springs = dict.fromkeys(("linear", "angular"), {axis: 10 * tens + k for k, axis in enumerate("xyz", 1)})
        keys += f"{key}: {flow_text(springs)}, "
    expected = []
    for name in ("linear.x", "linear.y", "linear.z", "angular.z", "angular.y", "angular.x"):
        low, high = drawn[name]
        if "angular" in name:  # as in Bullet, angles beyond half a turn come out on the other side
            low, high = (math.remainder(end, 2.0 * math.pi) for end in (low, high))
        if not low == high == 0.0:
            ends = (None, None) if low > high else (pytest.approx(low), pytest.approx(high))
            expected.append(("linear" in name, name[-1], *ends))
    sprung = joint(tmp_path, "six dof spring", keys)
    assert free(sprung) == expected
    for axis, (_, letter, _, _) in zip(axes_of(sprung) or (), expected, strict=True):
        k = 1 + "xyz".index(letter)
        assert (axis.stiffness, axis.damping, axis.rest) == (10 + k, 20 + k, 30 + k)
    plain = joint(tmp_path, "six dof", keys)
    assert free(plain) == expected and not any(axis.sprung for axis in axes_of(plain) or ())


@pytest.mark.parametrize("kind", ["revolute", "prismatic", "fixed", "torsion spring"])
@pytest.mark.parametrize("offset", ["", "offset: 0.7, ", "child offset: 0.7, "])
def test_the_frames_of_a_joint_meet_at_zero(tmp_path: Path, kind: str, offset: str) -> None:
    scene = loaded(tmp_path, kind, offset)
    found, (parent, child) = scene.joints[0], scene.bodies
    T_a = parent.T_body_inertial @ found.T_parent_a
    T_b = found.T_parent_child_zero @ child.T_body_inertial @ found.T_child_b
    np.testing.assert_allclose(T_a[:3, 3], (0.1, 0.2, 0.3), atol=1e-9)
    np.testing.assert_allclose(T_b, T_a, atol=1e-9)
    np.testing.assert_allclose(parent.T_body_inertial[:3, :3] @ found.axis, (0, 0.6, 0.8), atol=1e-9)
    for axis in axes_of(found) or ():
        np.testing.assert_allclose(found.T_parent_a[:3, :3] @ axis.direction, found.axis, atol=1e-9)
    bare = joint(tmp_path, kind)
    assert np.allclose(found.T_parent_child_zero, bare.T_parent_child_zero) is not bool(offset)


def test_pivots_grow_with_the_scale_of_their_bodies(tmp_path: Path) -> None:
    loaded(tmp_path, "revolute")
    file = tmp_path / "m.yaml"
    file.write_text(file.read_text().replace("A: {", "A: {scale: 2, ").replace("B: {", "B: {scale: 3, "))
    scene = ligature.load(file)
    found = scene.joints[0]
    for T, body, pivot in zip(
        (found.T_parent_a, found.T_child_b), scene.bodies, ((0.2, 0.4, 0.6), (0, -0.3, 0)), strict=True
    ):
        np.testing.assert_allclose((body.T_body_inertial @ T)[:3, 3], pivot, atol=1e-9)


def test_bodies_that_are_held_as_they_stand_do_not_move(tmp_path: Path) -> None:
    scene = loaded(tmp_path, "fixed")
    parent, child = scene.bodies
    held = fixed_joint(3, scene.joints[0].identity, parent, child)
    assert (held.index, held.parent, held.child, held.passive, axes_of(held)) == (3, 0, 1, True, ())
    np.testing.assert_allclose(parent.T_world_body @ held.T_parent_child_zero, child.T_world_body, atol=1e-12)
    T_i = parent.T_world_body @ parent.T_body_inertial @ held.T_parent_a
    np.testing.assert_allclose(T_i @ held.T_child_b, child.T_world_body @ child.T_body_inertial, atol=1e-12)


@pytest.mark.parametrize(
    ("keys", "output"),
    [
        ("", OutputType.VELOCITY),
        ("controller: {P: 1, I: 0, D: 0}, ", OutputType.FORCE),
        ("controller: {P: 1, I: 0, D: 0}, controller output type: VELOCITY, ", OutputType.VELOCITY),
        ("controller output type: FORCE, ", OutputType.FORCE),
    ],
)
def test_a_controller_outputs_forces_unless_the_file_states_another(
    tmp_path: Path, keys: str, output: OutputType
) -> None:
    assert joint(tmp_path, "revolute", keys).output is output
