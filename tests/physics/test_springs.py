"""Springs of every joint type against the damped oscillator: single, repeated, between free bodies, with any numbers.

Frames: joints lie along z of a frame that is turned at random; bodies start displaced by the joint's position.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import ligature
import numpy as np
import pytest
import yaml
from ligature.adf import Severity
from ligature.adf.frames import axis_rotation, matrix_rpy
from ligature.cli.check import findings
from ligature.model.frames import pose7_matrix, rpy_matrix
from ligature.physics.guard import MAX_SPEED

LINEAR = ("linear spring", "six dof spring")
ANGULAR = ("torsion spring", "six dof spring")


@dataclass(frozen=True)
class Sprung:
    """``copies`` joints of a ``type`` with a spring along or about one axis, stretched by ``stretch`` at the start."""

    type: str
    slides: bool
    mass: float
    inertia: float
    parent_mass: float  # 0 is static
    stiffness: float
    damping: float
    stretch: float
    rest: float
    copies: int = 1

    @property
    def moved(self) -> float:
        """Mass or inertia that a spring between the two bodies moves."""
        own = self.mass if self.slides else self.inertia
        if self.parent_mass == 0.0:
            return own
        other = self.parent_mass if self.slides else self.inertia * self.parent_mass / self.mass
        return own * other / (own + other)

    def position(self, t: float) -> float:
        """Closed form: the stretch of the damped oscillator of all copies at time ``t``."""
        decay = self.copies * self.damping / (2.0 * self.moved)
        root = np.sqrt(complex(decay**2 - self.copies * self.stiffness / self.moved) + 1e-12)
        value = np.exp(-decay * t) * (np.cosh(root * t) + decay / root * np.sinh(root * t))
        return self.rest + self.stretch * float(value.real)


def random_case(rng: np.random.Generator) -> Sprung:
    """An oscillator of up to 5 Hz that ticks of 1 ms follow, with bodies of 1 g to 10 kg."""
    slides = bool(rng.random() < 0.5)
    mass = 10.0 ** rng.uniform(-3, 1)
    inertia = mass * rng.uniform(0.01, 0.1) ** 2
    parent = 0.0 if rng.random() < 0.5 else mass * 10.0 ** rng.uniform(-1, 1)
    copies = int(rng.choice((1, 1, 2, 3)))
    case = Sprung(
        str(rng.choice(LINEAR if slides else ANGULAR)), slides, mass, inertia, parent, 0.0, 0.0,
        rng.uniform(0.01, 0.1) * rng.choice((-1, 1)), rng.uniform(-0.05, 0.05), copies,
    )  # fmt: skip
    rate = rng.uniform(3.0, 30.0)
    stiffness = case.moved * rate**2 / copies
    return replace(case, stiffness=stiffness, damping=2.0 * rng.uniform(0.0, 1.5) * case.moved * rate / copies)


def model(case: Sprung, rng: np.random.Generator) -> str:
    """A model file of two bodies that the joints of a case connect."""
    R = rpy_matrix(*rng.uniform(-3.0, 3.0, 3))
    q, z = case.rest + case.stretch, np.array([0.0, 0.0, 1.0])
    R_child = R if case.slides else R @ axis_rotation(z, q)

    def xyz(v: object) -> dict[str, float]:
        return {k: float(c) for k, c in zip("xyz", v, strict=True)}  # type: ignore[call-overload]

    def body(mass: float, at: object, turn: object) -> dict[str, object]:
        inertia = case.inertia * (mass / case.mass or 1.0)
        return {
            "mass": mass, "inertia": dict.fromkeys(("ix", "iy", "iz"), inertia), "inertial offset": {},
            "damping": {"linear": 0.0, "angular": 0.0},
            "location": {"position": xyz(at), "orientation": {k: float(c) for k, c in zip("rpy", matrix_rpy(turn), strict=True)}},
        }  # fmt: skip

    spring: dict[str, object] = {"stiffness": case.stiffness, "damping": case.damping, "equilibrium point": case.rest}
    limits: dict[str, object] = {"low": -3.0, "high": 3.0}
    if case.type.startswith("six"):
        half, other = ("linear", "angular") if case.slides else ("angular", "linear")
        none, along = xyz((0, 0, 0)), xyz((0, 0, 1))
        limits = {
            half: {end: {k: s * 3.0 * v for k, v in along.items()} for end, s in (("low", -1.0), ("high", 1.0))},
            other: {"low": none, "high": none},
        }
        spring = {
            key: {half: {k: float(value) * v for k, v in along.items()}, other: none} for key, value in spring.items()
        }  # type: ignore[arg-type]
    joint = {
        "type": case.type, "parent": "A", "child": "B", "joint limits": limits, **spring,
        "parent pivot": xyz((0, 0, 0)), "child pivot": xyz((0, 0, 0)), "parent axis": xyz(z), "child axis": xyz(z),
    }  # fmt: skip
    names = [f"J{i}" for i in range(case.copies)]
    return yaml.safe_dump(
        {
            "bodies": ["A", "B"], "joints": names, "gravity": xyz((0, 0, 0)),
            "A": {"name": "A", **body(case.parent_mass, (0, 0, 0), R)},
            "B": {"name": "B", **body(case.mass, R @ z * q if case.slides else (0, 0, 0), R_child)},
            **{name: {"name": name, **joint} for name in names},
        },
        sort_keys=False,
    )  # fmt: skip


def coordinate(simulation: ligature.Simulation, case: Sprung) -> float:
    """Position of the child along or about z of the parent, from the poses of both."""
    (one, other) = (simulation.state["body_pose"][0, i] for i in range(2))
    R, R_child = (_rotation(pose[3:]) for pose in (one, other))
    if case.slides:
        return float((R.T @ (other[:3] - one[:3]))[2])
    turn = R.T @ R_child
    return float(np.arctan2(turn[1, 0], turn[0, 0]))


def _rotation(q: np.ndarray) -> np.ndarray:
    x, y, z, w = q
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + 2.0 * w * K + 2.0 * K @ K


@pytest.fixture
def simulate_case(tmp_path: Path) -> Callable[[Sprung, np.random.Generator], ligature.Simulation]:
    def make(case: Sprung, rng: np.random.Generator) -> ligature.Simulation:
        (tmp_path / "m.yaml").write_text(model(case, rng))
        return ligature.Simulation(ligature.load(tmp_path / "m.yaml"))

    return make


@pytest.mark.parametrize("seed", range(16))
def test_a_displaced_spring_moves_as_the_damped_oscillator(
    seed: int, simulate_case: Callable[[Sprung, np.random.Generator], ligature.Simulation]
) -> None:
    rng = np.random.default_rng(seed)
    case = random_case(rng)
    simulation = simulate_case(case, rng)
    assert coordinate(simulation, case) == pytest.approx(case.rest + case.stretch, abs=1e-9)
    worst = 0.0
    for tick in range(1, 501):
        simulation.step()
        worst = max(worst, abs(coordinate(simulation, case) - case.position(1e-3 * tick)))
    simulation.close()
    assert worst < 0.04 * abs(case.stretch), case


EXTREMES = 16


@pytest.mark.parametrize("seed", range(EXTREMES))
def test_springs_that_check_passes_stay_slow_whatever_their_numbers(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng((1, seed))
    case = random_case(rng)
    sign = -1.0 if rng.random() < 0.2 else 1.0
    case = replace(
        case, stiffness=sign * 10.0 ** rng.uniform(-6, 9), damping=float(rng.choice((-1.0, 1.0, 1.0))) * 10.0 ** rng.uniform(-6, 9),
        stretch=float(rng.uniform(-1.0, 1.0)),
    )  # fmt: skip
    file = tmp_path / "m.yaml"
    file.write_text(model(case, rng))
    found = findings(file, [], strict=False)
    assert not any(finding.severity >= Severity.ERROR for finding in found), found
    warned = any(finding.code == "speed" for finding in found)
    simulation = ligature.Simulation(ligature.load(file))
    max_speed = 0.0
    for _ in range(500):
        simulation.step()
        speeds = np.linalg.norm(simulation.state["body_twist"][0, :, :3], axis=1)
        assert np.isfinite(simulation.state["body_pose"]).all()
        max_speed = max(max_speed, float(speeds.max()))
    simulation.close()
    assert warned or max_speed < MAX_SPEED, case


@pytest.mark.parametrize("seed", range(4))
def test_check_reports_exactly_the_springs_that_throw_a_body(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng((2, seed))
    case = replace(
        random_case(rng), type="linear spring", slides=True, parent_mass=0.0, copies=1, mass=0.01, damping=0.0,
    )  # fmt: skip
    speed = MAX_SPEED * (1.2 if seed % 2 else 0.8)
    case = replace(case, stiffness=case.mass * (speed / case.stretch) ** 2)
    if case.stiffness > case.mass / (16 * 1e-6):  # as stiff as a spring may act: stretched more, then
        case = replace(case, stiffness=case.mass * 100.0**2, stretch=speed / 100.0)
    file = tmp_path / "m.yaml"
    file.write_text(model(case, rng))
    found = [str(finding) for finding in findings(file, [], strict=False) if finding.code == "speed"]
    assert len(found) == seed % 2, found
    if found:
        assert f"enough to throw 'B' (0.01 kg) at {speed:.3g} m/s" in found[0].replace("/ambf/env/", ""), found
    simulation = ligature.Simulation(ligature.load(file))
    max_speed = 0.0
    for _ in range(200):
        simulation.step()
        max_speed = max(max_speed, float(np.linalg.norm(simulation.state["body_twist"][0, 1, :3])))
    simulation.close()
    assert max_speed == pytest.approx(speed, rel=0.05)


def suspended(rng: np.random.Generator) -> str:
    """A body on a joint with springs along and about several axes, far from its centre of mass, and repeated."""
    mass = 10.0 ** rng.uniform(-3, 0)
    inertia = mass * rng.uniform(0.02, 0.1, 3) ** 2
    arm = rng.uniform(-0.3, 0.3, 3)
    free = rng.random(6) < 0.6

    def six(values: object) -> dict[str, dict[str, float]]:
        six = [float(v) for v in values]  # type: ignore[call-overload]
        return {half: dict(zip("xyz", six[a : a + 3], strict=True)) for half, a in (("linear", 0), ("angular", 3))}

    def log(low: float, high: float) -> np.ndarray:
        return 10.0 ** rng.uniform(low, high, 6)

    reach = np.where(np.arange(6) < 3, 0.05, 0.5) * free
    limits = {
        half: {"low": {k: -v for k, v in part.items()}, "high": part} for half, part in six(reach).items()
    }  # fmt: skip
    joint = {
        "type": "six dof spring", "parent": "A", "child": "B", "joint limits": limits,
        "stiffness": six(log(-2, 4)), "damping": six(log(-4, 2)), "equilibrium point": six(np.zeros(6)),
        "parent pivot": {k: float(v) for k, v in zip("xyz", arm, strict=True)},
        "child pivot": {k: float(v) for k, v in zip("xyz", arm, strict=True)},
        "parent axis": dict(zip("xyz", (0, 0, 1), strict=True)), "child axis": dict(zip("xyz", (0, 0, 1), strict=True)),
    }  # fmt: skip
    names = [f"J{i}" for i in range(int(rng.choice((1, 1, 2, 3))))]
    body = {"inertial offset": {}, "damping": {"linear": 0.0, "angular": 0.0}}
    return yaml.safe_dump(
        {
            "bodies": ["A", "B"], "joints": names, "gravity": {"x": 0.0, "y": 0.0, "z": -9.8},
            "A": {"name": "A", "mass": 0 if rng.random() < 0.5 else mass * 10.0 ** float(rng.uniform(-1, 1)), **body,
                  "inertia": dict.fromkeys(("ix", "iy", "iz"), mass * 1e-3)},
            "B": {"name": "B", "mass": float(mass), **body, "inertia": {k: float(v) for k, v in zip(("ix", "iy", "iz"), inertia, strict=True)}},
            **{name: {"name": name, **joint} for name in names},
        },
        sort_keys=False,
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(20))
def test_a_body_on_springs_along_and_about_many_axes_falls_no_faster_than_without(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng((3, seed))
    file = tmp_path / "m.yaml"
    file.write_text(suspended(rng))
    simulation = ligature.Simulation(ligature.load(file))
    for tick in range(1, 301):
        simulation.step()
        speed = float(np.linalg.norm(simulation.state["body_twist"][0, :, :3], axis=1).max())
        assert speed < 9.8e-3 * tick + 0.5, f"{speed:.3g} m/s after {tick} ms"
    simulation.close()


@pytest.mark.parametrize("seed", range(24))
def test_springs_and_dampers_give_no_energy_where_two_of_three_axes_become_parallel(seed: int, tmp_path: Path) -> None:
    """A body is let go with the middle axis 0 to 40° from gimbal lock, its springs stretched, its dampers of any number."""
    rng = np.random.default_rng((5, seed))
    mass = 10.0 ** float(rng.uniform(-3, 0))
    inertia = mass * rng.uniform(0.03, 0.06, 3) ** 2
    turns = np.array([rng.uniform(-1, 1), rng.choice((-1, 1)) * rng.uniform(0.87, 1.57), rng.uniform(-1, 1)])
    stiffness = inertia.mean() * (2 * np.pi * rng.uniform(0.0, 5.0, 3)) ** 2
    damping = inertia.mean() * 10.0 ** rng.uniform(0, 4, 3)
    xyz = partial(zip, "xyz", strict=True)
    zero, free = dict.fromkeys("xyz", 0.0), {"low": dict.fromkeys("xyz", 1.0), "high": dict.fromkeys("xyz", -1.0)}
    body = {"damping": {"linear": 0.0, "angular": 0.0}, "inertial offset": {}}
    up = {"x": 0.0, "y": 0.0, "z": 1.0}
    file = tmp_path / "m.yaml"
    file.write_text(
        yaml.safe_dump(
            {
                "bodies": ["A", "B"], "joints": ["J"], "gravity": zero,
                "A": {"name": "A", "mass": 0},
                "B": {"name": "B", "mass": mass, "inertia": dict(zip(("ix", "iy", "iz"), inertia.tolist(), strict=True)),
                      "location": {"orientation": dict(zip("rpy", turns.tolist(), strict=True))}, **body},
                "J": {"name": "J", "type": "six dof spring", "parent": "A", "child": "B",
                      "parent pivot": zero, "child pivot": zero, "parent axis": up, "child axis": up,
                      "joint limits": {"linear": {"low": zero, "high": zero}, "angular": free},
                      "stiffness": {"linear": zero, "angular": dict(xyz(stiffness.tolist()))},
                      "damping": {"linear": zero, "angular": dict(xyz(damping.tolist()))}},
            }
        )
    )  # fmt: skip
    with closing(ligature.Simulation(ligature.load(file))) as simulation:
        stretched = 0.5 * float(stiffness @ turns**2)
        most = 0.0
        for _ in range(400):
            simulation.step()
            pose, twist = simulation.state["body_pose"][0, 1], simulation.state["body_twist"][0, 1]
            omega = pose7_matrix(pose)[:3, :3].T @ twist[3:]
            most = max(most, 0.5 * float(inertia @ omega**2 + mass * twist[:3] @ twist[:3]))
        assert not simulation.problems
        assert most < 1.05 * stretched, f"{most / stretched:.3g} of the energy of the springs"


def _hung(unit: float, number: int) -> str:
    """A body on a spring, with ``unit`` for each kilogram; what hangs there depends on ``number`` alone."""
    rng = random.Random(number)
    kind = rng.choice(("torsion spring", "linear spring"))
    stiffness, damping = 10.0 ** rng.uniform(-4, 0), rng.choice((0.0, 10.0 ** rng.uniform(-6, -3)))
    pull = rng.choice((0.0, 0.0, -1e-3, -9.81))
    up, nowhere = "{x: 0, y: 0, z: 1}", "{x: 0, y: 0, z: 0}"
    inertia = ", ".join(f"{axis}: {1e-4 * unit!r}" for axis in ("ix", "iy", "iz"))
    return f"""
gravity: {{x: 0, y: 0, z: {pull}}}
bodies: [A, B]
joints: [J]
A: {{name: A, mass: 0}}
B: {{name: B, mass: {0.01 * unit!r}, inertia: {{{inertia}}}}}
J: {{name: J, type: {kind}, parent: A, child: B, parent axis: {up}, child axis: {up}, parent pivot: {nowhere},
  child pivot: {nowhere}, joint limits: {{low: -10, high: 10}}, stiffness: {stiffness * unit!r},
  damping: {damping * unit!r}, equilibrium point: {rng.uniform(0.001, 0.2)}}}
"""


@pytest.mark.parametrize("number", range(12))
def test_the_unit_of_mass_changes_no_motion(number: int, tmp_path: Path) -> None:
    """Newton's law has one mass on both sides: with all of them a power of two times as large, no bit moves."""
    ways = []
    for unit in (1.0, 2.0**-12, 2.0**-25):
        file = tmp_path / f"{unit}.yaml"
        file.write_text(_hung(unit, number))
        simulation = ligature.Simulation(ligature.load(file))
        way = []
        for _ in range(20):
            simulation.step(10)
            way.append(float(simulation.state["joint_position"][0, 0]))
        simulation.close()
        ways.append(way)
    assert ways[0] == ways[1] == ways[2]
    assert len(set(ways[0])) > 1
