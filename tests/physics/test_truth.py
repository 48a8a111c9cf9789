"""Rigid-body truth against closed forms; each tolerance names where the error of 1 ms ticks comes from."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from ligature import Simulation
from ligature.model.frames import pose7_matrix

Make = Callable[[str], Simulation]
UNDAMPED = "damping: {linear: 0, angular: 0}, "
POINT = "inertia: {ix: 1.0e-6, iy: 1.0e-6, iz: 1.0e-6}, inertial offset: {}, "


def joint(kind: str, parent: str, child: str, parent_pivot: str, child_pivot: str, axis: str, more: str = "") -> str:
    return (
        f"{{name: {parent}-{child}, type: {kind}, parent: {parent}, child: {child}, "
        f"parent pivot: {parent_pivot}, child pivot: {child_pivot}, parent axis: {axis}, child axis: {axis}, {more}}}\n"
    )


def test_free_fall(simulate: Make) -> None:
    sim = simulate(f"bodies: [A]\nA: {{name: A, mass: 2, {UNDAMPED}{POINT}}}\n")
    sim.step(1000)
    # semi-implicit Euler falls g t dt / 2 = 4.9 mm further than the closed form
    assert sim.bodies["A"].pose[2] == pytest.approx(-0.5 * 9.8, abs=5e-3)
    assert sim.bodies["A"].twist[2] == pytest.approx(-9.8, rel=1e-9)


def test_damping_decays_velocity_by_its_part_each_second(simulate: Make) -> None:
    text = f"bodies: [A]\ngravity: {{x: 0, y: 0, z: 0}}\nA: {{name: A, mass: 1, damping: {{linear: 0.9, angular: 0}}, {POINT}}}\n"
    sim = simulate(text)
    sim.bodies["A"].command_twist([1, 0, 0, 0, 0, 0])
    sim.step(1)
    sim.bodies["A"].release()
    before = sim.bodies["A"].twist[0]
    sim.step(1000)
    assert sim.bodies["A"].twist[0] / before == pytest.approx(0.1, rel=0.01)


def test_pendulum_period(simulate: Make) -> None:
    length, angle = 0.5, 0.1
    text = (
        "bodies: [Base, Bob]\njoints: [J]\n"
        "Base: {name: Base, mass: 0}\n"
        f"Bob: {{name: Bob, mass: 1, {UNDAMPED}{POINT}location: {{position: {{x: 0, y: 0, z: -{length}}}}}}}\n"
        "J: "
        + joint("revolute", "Base", "Bob", "{x: 0, y: 0, z: 0}", f"{{x: 0, y: 0, z: {length}}}", "{x: 0, y: 1, z: 0}")
    )
    sim = simulate(text)
    sim._world.set_joint_position(0, angle)
    crossings, last = [], angle
    for tick in range(6000):
        sim.step()
        now = sim.joints["Base-Bob"].position
        if last > 0 >= now:
            crossings.append(tick + last / (last - now))
        last = now
    period = np.diff(crossings).mean() * 1e-3
    exact = 2 * np.pi * np.sqrt((length + 1e-6 / length) / 9.8) * (1 + angle**2 / 16)
    assert period == pytest.approx(exact, rel=1e-3)
    assert max(abs(sim.joints["Base-Bob"].position), 0) <= angle * 1.02


@pytest.mark.parametrize(("angle", "slides"), [(0.24, False), (0.32, True)])
def test_a_box_on_a_slope_holds_up_to_the_friction_angle(simulate: Make, angle: float, slides: bool) -> None:
    """Bullet multiplies frictions: 0.5 · 0.5 holds up to atan 0.25 = 0.245."""
    text = (
        "bodies: [Ramp, Box]\n"
        f"Ramp: {{name: Ramp, mass: 0, friction: {{static: 0.5, rolling: 0}}, restitution: 0, collision margin: 0.0001, collision shape: BOX, "
        f"collision geometry: {{x: 4, y: 2, z: 0.2}}, location: {{orientation: {{r: 0, p: {angle}, y: 0}}}}}}\n"
        "Box: {name: Box, mass: 1, friction: {static: 0.5, rolling: 0}, restitution: 0, collision margin: 0.0001, collision shape: BOX, "
        f"collision geometry: {{x: 0.2, y: 0.2, z: 0.1}}, {UNDAMPED}inertial offset: {{}}, "
        f"location: {{position: {{x: {0.1501 * np.sin(angle)}, y: 0, z: {0.1501 * np.cos(angle)}}}, orientation: {{r: 0, p: {angle}, y: 0}}}}}}\n"
    )
    sim = simulate(text)
    sim.step(300)
    start = sim.bodies["Box"].pose[:3]
    sim.step(1000)
    moved = np.linalg.norm(sim.bodies["Box"].pose[:3] - start)
    if slides:
        speed = 9.8 * (np.sin(angle) - 0.25 * np.cos(angle))
        assert moved == pytest.approx(speed * (0.3 * 1.0 + 0.5), rel=0.1)
    else:
        assert moved < 1e-3


def test_spring_and_damper_follow_the_step_response(simulate: Make) -> None:
    mass, stiffness, damping = 1.0, 100.0, 4.0
    text = (
        "bodies: [Base, Block]\njoints: [J]\ngravity: {x: 0, y: 0, z: 0}\nBase: {name: Base, mass: 0}\n"
        f"Block: {{name: Block, mass: {mass}, {UNDAMPED}{POINT}}}\n"
        "J: " + joint(
            "linear spring", "Base", "Block", "{x: 0, y: 0, z: 0}", "{x: 0, y: 0, z: 0}", "{x: 0, y: 0, z: 1}",
            f"stiffness: {stiffness}, damping: {damping}, joint limits: {{low: -1, high: 1}}, equilibrium point: 0.1",
        )
    )  # fmt: skip
    sim = simulate(text)
    omega, zeta = np.sqrt(stiffness / mass), damping / (2 * np.sqrt(stiffness * mass))
    damped = omega * np.sqrt(1 - zeta**2)
    worst = 0.0
    for tick in range(1, 1001):
        sim.step()
        t = tick * 1e-3
        exact = 0.1 * (
            1 - np.exp(-zeta * omega * t) * (np.cos(damped * t) + zeta * omega / damped * np.sin(damped * t))
        )
        worst = max(worst, abs(sim.bodies["Block"].pose[2] - exact))
    assert worst < 1e-3


def test_momentum_and_angular_momentum_are_kept_in_free_flight(simulate: Make) -> None:
    text = (
        "bodies: [A, B]\njoints: [J]\ngravity: {x: 0, y: 0, z: 0}\n"
        f"A: {{name: A, mass: 2, {UNDAMPED}inertia: {{ix: 0.02, iy: 0.03, iz: 0.01}}, inertial offset: {{}}}}\n"
        f"B: {{name: B, mass: 1, {UNDAMPED}inertia: {{ix: 0.01, iy: 0.01, iz: 0.02}}, inertial offset: {{}}, "
        "location: {position: {x: 0.4, y: 0, z: 0}}}\n"
        "J: " + joint("revolute", "A", "B", "{x: 0.2, y: 0, z: 0}", "{x: -0.2, y: 0, z: 0}", "{x: 0, y: 0, z: 1}")
    )
    sim = simulate(text)
    sim.bodies["A"].command_wrench([0.3, 0, 0.6, 0.06, 0.02, 0.1])
    sim.step(200)
    sim.bodies["A"].release()
    sim.step(1)

    def momenta() -> tuple[np.ndarray, np.ndarray]:
        linear, angular = np.zeros(3), np.zeros(3)
        for name in "AB":
            body, pose, twist = sim.bodies[name].body, sim.bodies[name].pose, sim.bodies[name].twist
            R = pose7_matrix(pose)[:3, :3]
            linear += body.mass * twist[:3]
            angular += np.cross(pose[:3], body.mass * twist[:3]) + R @ (body.inertia * (R.T @ twist[3:]))
        return linear, angular

    before = momenta()
    sim.step(1000)
    after = momenta()
    assert np.allclose(after[0], before[0], rtol=2e-3, atol=2e-4)
    assert np.allclose(after[1], before[1], rtol=1e-2, atol=1e-4)


def test_a_four_bar_linkage_stays_closed(simulate: Make) -> None:
    """Cranks of 0.1 m on a base of 0.3 m: the loop's pivots stay within 0.1 mm while it swings."""
    shape = "inertia: {ix: 0.001, iy: 0.001, iz: 0.001}, inertial offset: {}, damping: {linear: 0.1, angular: 0.1}, "
    y = "{x: 0, y: 1, z: 0}"
    text = (
        "bodies: [Base, Left, Coupler, Right]\njoints: [J1, J2, J3, J4]\nBase: {name: Base, mass: 0}\n"
        f"Left: {{name: Left, mass: 0.5, {shape}location: {{position: {{x: 0, y: 0, z: -0.05}}}}}}\n"
        f"Coupler: {{name: Coupler, mass: 0.5, {shape}location: {{position: {{x: 0.15, y: 0, z: -0.1}}}}}}\n"
        f"Right: {{name: Right, mass: 0.5, {shape}location: {{position: {{x: 0.3, y: 0, z: -0.05}}}}}}\n"
        "J1: " + joint("revolute", "Base", "Left", "{x: 0, y: 0, z: 0}", "{x: 0, y: 0, z: 0.05}", y)
        + "J2: " + joint("revolute", "Left", "Coupler", "{x: 0, y: 0, z: -0.05}", "{x: -0.15, y: 0, z: 0}", y)
        + "J3: " + joint("revolute", "Coupler", "Right", "{x: 0.15, y: 0, z: 0}", "{x: 0, y: 0, z: -0.05}", y)
        + "J4: " + joint("revolute", "Right", "Base", "{x: 0, y: 0, z: 0.05}", "{x: 0.3, y: 0, z: 0}", y)
    )  # fmt: skip
    sim = simulate(text)
    assert len(sim.scene.loops) == 1
    sim.bodies["Left"].command_wrench([4, 0, 0, 0, 0, 0])
    sim.step(150)
    sim.bodies["Left"].release()
    worst = swing = 0.0
    closing = sim.scene.joints[sim.scene.loops[0]]
    parent, child = sim.scene.bodies[closing.parent], sim.scene.bodies[closing.child]
    for _ in range(1000):
        sim.step()
        one = pose7_matrix(sim.state["body_pose"][0, parent.index]) @ parent.T_body_inertial @ closing.T_parent_a
        two = pose7_matrix(sim.state["body_pose"][0, child.index]) @ child.T_body_inertial @ closing.T_child_b
        worst = max(worst, np.linalg.norm(one[:3, 3] - two[:3, 3]))
        swing = max(swing, abs(sim.bodies["Coupler"].pose[0] - 0.15))
    assert swing > 0.02
    assert worst < 1e-4


SIX = (
    "joint limits: {{linear: {{low: {{x: 0, y: 0, z: -0.05}}, high: {{x: 0, y: 0, z: 0.05}}}}, "
    "angular: {{low: {{x: 0, y: 0, z: -0.5}}, high: {{x: 0, y: 0, z: 0.5}}}}}}, "
    "stiffness: {{linear: {{x: 1, y: 1, z: {k}}}, angular: {{x: 1, y: 1, z: {k}}}}}, "
    "damping: {{linear: {{x: 1, y: 1, z: {d}}}, angular: {{x: 1, y: 1, z: 0.5}}}}, "
    "equilibrium point: {{linear: {{x: 0, y: 0, z: 0.02}}, angular: {{x: 0, y: 0, z: 0.3}}}}"
)


def six_dof(mass: float = 1.0, gravity: float = 0.0, stiffness: float = 200.0) -> str:
    return (
        f"bodies: [Base, Body]\njoints: [J]\ngravity: {{x: 0, y: 0, z: {gravity}}}\nBase: {{name: Base, mass: 0}}\n"
        f"Body: {{name: Body, mass: {mass}, inertia: {{ix: 0.01, iy: 0.01, iz: 0.01}}, inertial offset: {{}}}}\n"
        "J: " + joint(
            "six dof spring", "Base", "Body", "{x: 0, y: 0, z: 0}", "{x: 0, y: 0, z: 0}", "{x: 0, y: 0, z: 1}",
            SIX.format(k=stiffness, d=20),
        )
    )  # fmt: skip


def test_a_six_dof_spring_rests_at_its_equilibrium_in_natural_signs(simulate: Make) -> None:
    sim = simulate(six_dof())
    sim.step(3000)
    pose = sim.bodies["Body"].pose
    assert pose[:3] == pytest.approx([0, 0, 0.02], abs=1e-5)
    assert 2 * np.arctan2(pose[5], pose[6]) == pytest.approx(0.3, abs=1e-3)


def test_a_six_dof_spring_gives_way_by_hooke(simulate: Make) -> None:
    sim = simulate(six_dof(gravity=-2.0))
    sim.step(4000)
    assert sim.bodies["Body"].pose[2] == pytest.approx(0.02 - 2.0 / 200.0, abs=1e-4)


def test_six_dof_limits_hold_and_locked_axes_do_not_move(simulate: Make) -> None:
    sim = simulate(six_dof(gravity=-100.0))
    sim.bodies["Body"].command_wrench([5, 3, 0, 0.2, 0.2, 0])
    sim.step(2000)
    pose = sim.bodies["Body"].pose
    assert pose[2] == pytest.approx(-0.05, abs=2e-3)
    assert np.abs(pose[:2]).max() < 5e-5
    assert np.abs(pose[3:5]).max() < 1e-4


def test_a_body_held_by_a_reversed_joint_moves_the_same(simulate: Make) -> None:
    """The static body is the child: the tree runs against the joint, coordinates keep their signs."""
    text = six_dof(gravity=0).replace("parent: Base, child: Body", "parent: Body, child: Base")
    sim = simulate(text)
    sim.step(3000)
    pose = sim.bodies["Body"].pose
    # D = A^-1 B is now the base seen from the body
    assert pose7_matrix(pose)[:3, :3].T @ -pose[:3] == pytest.approx([0, 0, 0.02], abs=1e-5)
    assert 2 * np.arctan2(pose[5], pose[6]) == pytest.approx(-0.3, abs=1e-3)
