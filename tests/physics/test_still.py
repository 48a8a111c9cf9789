"""What is still sleeps in Bullet, which changes no bit: the same run in which nothing may sleep is the judge."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature import Simulation
from ligature.model.commands import BodyCommand, CommandType
from ligature.model.scene import Scene
from ligature.physics import bullet, engine

from tests.conftest import ROOT
from tests.driving import Driver


@pytest.fixture
def pair(monkeypatch: pytest.MonkeyPatch) -> Callable[[Scene], tuple[Simulation, Simulation]]:
    """Two simulations of a scene, in the second of which nothing may sleep."""

    def make(scene: Scene) -> tuple[Simulation, Simulation]:
        first = Simulation(scene)
        with monkeypatch.context() as patch:
            patch.setattr(engine, "find_sleepers", lambda boxes: np.zeros(0, dtype=np.int64))
            return first, Simulation(scene)

    return make


def _asleep(simulation: Simulation) -> list[bool]:
    return simulation._world.engine.motions.trees.asleep.tolist()  # type: ignore[no-any-return]


@pytest.mark.parametrize("name", ["suturing_small", "needle_pick"])
def test_arms_at_rest_sleep_and_wake_with_the_same_bits(
    name: str, pair: Callable[[Scene], tuple[Simulation, Simulation]]
) -> None:
    scene = ligature.load(ROOT / "scenes" / name / "launch.yaml")
    runs, slept = pair(scene), 0
    taken = [simulation.snapshot() for simulation in runs]
    for seed in range(3):
        for simulation in runs:
            Driver(scene, 30 + seed).run(simulation, 0, 40)
        assert len({simulation.state_hash() for simulation in runs}) == 1
        for simulation, snapshot in zip(runs, taken, strict=True):
            simulation.reset() if seed else simulation.restore(snapshot)
            simulation.step(60)
        assert len({simulation.state_hash() for simulation in runs}) == 1
        slept += sum(_asleep(runs[0]))
        assert not any(_asleep(runs[1]))
    assert slept, "nothing slept: PyBullet keeps it elsewhere, or something disturbs what is still"


SMOOTH = (
    "friction: {static: 0.4, rolling: 0}, restitution: 0.2, collision margin: 0.0001, inertial offset: {}, "
    "gravity: {x: 0, y: 0, z: 0}, damping: {linear: 0.04, angular: 0.1}"
)


def _free_bodies(rng: np.random.Generator) -> str:
    """A row of boxes and balls with gaps between them, a door on a hinge, and a wall that stands."""
    names, parts = ["Wall", "Post", "Door"], []
    parts.append(
        f"Wall: {{name: Wall, mass: 0, collision shape: BOX, collision geometry: {{x: 0.02, y: 0.3, z: 0.3}}, {SMOOTH}, "
        "location: {position: {x: -0.2, y: 0, z: 0}}}\n"
    )
    parts.append(
        f"Post: {{name: Post, mass: 0, collision shape: BOX, collision geometry: {{x: 0.01, y: 0.01, z: 0.1}}, {SMOOTH}, "
        "location: {position: {x: -0.1, y: -0.1, z: 0}}}\n"
    )
    parts.append(
        f"Door: {{name: Door, mass: 0.3, collision shape: BOX, collision geometry: {{x: 0.01, y: 0.12, z: 0.1}}, {SMOOTH}, "
        "inertia: {ix: 1e-4, iy: 1e-4, iz: 1e-4}, location: {position: {x: -0.1, y: 0, z: 0}}}\n"
    )
    x = 0.0
    for k in range(4):
        name, size = f"B{k}", float(rng.uniform(0.01, 0.03))
        shape = (
            f"collision shape: BOX, collision geometry: {{x: {size}, y: {size}, z: {size}}}"
            if rng.integers(2)
            else f"collision shape: SPHERE, collision geometry: {{radius: {size / 2}}}"
        )
        names.append(name)
        x += size + float(rng.uniform(0.001, 0.004))
        parts.append(
            f"{name}: {{name: {name}, mass: {rng.uniform(0.05, 0.5)}, {shape}, {SMOOTH}, "
            f"location: {{position: {{x: {x}, y: {rng.uniform(-0.002, 0.002)}, z: 0}}}}}}\n"
        )
        x += size / 2
    # Bullet never wakes links that fixed joints hold to what stands, or to the first link of a tree
    frame = rng.integers(3)  # the door hangs on its post, on a frame that is fixed to it, or has a handle fixed to it
    hung, joints = ("Frame", "Hinge, Fix") if frame == 1 else ("Post", "Hinge, Fix" if frame else "Hinge")
    if frame:
        at, turn = ("{x: -0.1, y: -0.1, z: 0.1}", "Post") if frame == 1 else ("{x: -0.1, y: 0.06, z: 0.1}", "Door")
        name = "Frame" if frame == 1 else "Handle"
        names.append(name)
        parts.append(
            f"{name}: {{name: {name}, mass: 0.1, collision shape: BOX, collision geometry: {{x: 0.01, y: 0.01, z: 0.05}}, "
            f"{SMOOTH}, inertia: {{ix: 1e-4, iy: 1e-4, iz: 1e-4}}, location: {{position: {at}}}}}\n"
        )
    joint = (
        f"joints: [{joints}]\nHinge: {{name: Hinge, parent: {hung}, child: Door, type: revolute, "
        f"parent pivot: {{x: 0, y: 0.01, z: {-0.1 if frame == 1 else 0}}}, child pivot: {{x: 0, y: -0.09, z: 0}}, "
        "parent axis: {x: 0, y: 0, z: 1}, child axis: {x: 0, y: 0, z: 1}, joint limits: {low: -1.0, high: 1.0}, "
        "enable motor: 1}\n"
    )
    if frame:
        pivot = "{x: 0, y: 0, z: 0.1}" if frame == 1 else "{x: 0, y: 0.06, z: 0.1}"
        joint += (
            f"Fix: {{name: Fix, parent: {turn}, child: {name}, type: fixed, parent pivot: {pivot}, "
            "child pivot: {x: 0, y: 0, z: 0}, parent axis: {x: 0, y: 0, z: 1}, child axis: {x: 0, y: 0, z: 1}}\n"
        )
    return f"namespace: /ambf/env/\nbodies: [{', '.join(names)}]\n" + "".join(parts) + joint


THROWN = """namespace: /ambf/env/
bodies: [Ball, Post, Door, Part]
Ball: {{name: Ball, mass: 0.1, collision shape: SPHERE, collision geometry: {{radius: 0.01}}, {smooth},
  location: {{position: {{x: 0.1, y: 0.05, z: 0}}}}}}
Post: {{name: Post, mass: 0, collision shape: BOX, collision geometry: {{x: 0.01, y: 0.01, z: 0.1}}, {smooth}}}
Door: {{name: Door, mass: 0.3, collision shape: BOX, collision geometry: {{x: 0.01, y: 0.12, z: 0.1}}, {smooth},
  inertia: {{ix: 1e-4, iy: 1e-4, iz: 1e-4}}, location: {{position: {{x: 0, y: 0.07, z: 0}}}}}}
Part: {{name: Part, mass: 0.1, collision shape: BOX, collision geometry: {{x: 0.01, y: 0.01, z: 0.01}}, {smooth},
  inertia: {{ix: 1e-4, iy: 1e-4, iz: 1e-4}}, location: {{position: {{x: 0, y: {part}, z: {high}}}}}}}
joints: [Hinge, Fix]
Hinge: {{name: Hinge, parent: {hung}, child: Door, type: revolute, parent pivot: {{x: 0, y: 0, z: {low}}},
  child pivot: {{x: 0, y: -0.07, z: 0}}, parent axis: {{x: 0, y: 0, z: 1}}, child axis: {{x: 0, y: 0, z: 1}}}}
Fix: {{name: Fix, parent: {held}, child: Part, type: fixed, parent pivot: {{x: 0, y: 0, z: {high}}},
  child pivot: {{x: 0, y: 0, z: 0}}, parent axis: {{x: 0, y: 0, z: 1}}, child axis: {{x: 0, y: 0, z: 1}}}}
"""


@pytest.mark.parametrize(("hung", "held", "part"), [("Part", "Post", 0.0), ("Post", "Door", 0.07)])
def test_a_door_with_a_fixed_joint_opens_as_a_ball_hits_it(hung: str, held: str, part: float, tmp_path: Path) -> None:
    text = THROWN.format(smooth=SMOOTH, hung=hung, held=held, part=part, high=0.1, low=-0.1 if hung == "Part" else 0.0)
    (tmp_path / "model.yaml").write_text(text, encoding="utf-8")
    simulation = Simulation(ligature.load(tmp_path / "model.yaml"))
    simulation.step(20)
    ball = simulation.bodies["Ball"]
    ball.command_twist([-2.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    simulation.step(5)
    ball.release()
    simulation.step(150)
    assert abs(simulation.joints["Hinge"].position) > 0.05


@pytest.mark.parametrize("seed", range(8))
def test_whatever_acts_on_what_is_still_wakes_it(
    seed: int, tmp_path: Path, pair: Callable[[Scene], tuple[Simulation, Simulation]]
) -> None:
    rng = np.random.default_rng(seed)
    (tmp_path / "model.yaml").write_text(_free_bodies(rng), encoding="utf-8")
    scene = ligature.load(tmp_path / "model.yaml")
    index = {body.identity.name: body.index for body in scene.bodies}
    runs, welds, slept, woken = pair(scene), [[], []], 0, 0
    for _ in range(12):
        event = int(rng.integers(6))
        free, other = (index[f"B{k}"] for k in rng.permutation(4)[:2])
        aside = rng.uniform(-0.01, 0.01, 3)
        push = np.concatenate([rng.uniform(-2, 2, 1), rng.uniform(-0.1, 0.1, 2), rng.uniform(-0.001, 0.001, 3)])
        for simulation, held in zip(runs, welds, strict=True):
            world = simulation._world
            if event <= 1:
                simulation.apply(BodyCommand(free, CommandType.FORCE, tuple(push.tolist())))
            elif event == 2:
                if held:
                    world.welds.remove(held.pop())
                else:
                    T = np.linalg.inv(_frame(world.pose7(other))) @ _frame(world.pose7(free))
                    T[:3, 3] += aside / 10
                    held.append(world.welds.add(other, free, T, np.eye(4)))
            elif event == 3:
                pose = world.pose7(free)
                pose[:3] += aside
                world.set_pose(index["Wall"], pose)
            elif event == 4:
                simulation.apply(
                    BodyCommand(index["Door"], CommandType.FORCE, (0.0,) * 6, (CommandType.FORCE,), (float(push[0]),))
                )
            else:
                world.set_joint_position(0, float(aside[0] * 10))
        for tick in range(50):
            if tick == 3:
                for simulation in runs:
                    simulation.apply(BodyCommand(free, CommandType.FORCE, (0.0,) * 6))
            before = _asleep(runs[0])
            for simulation in runs:
                simulation.step()
            assert runs[0].state_hash() == runs[1].state_hash(), f"event {event}, tick {tick}"
            now = _asleep(runs[0])
            slept += sum(now)
            woken += sum(a and not b for a, b in zip(before, now, strict=True))
    assert slept > 100
    assert woken > 3


def _frame(pose: np.ndarray) -> np.ndarray:
    """The frame (4, 4) of a pose (7,)."""
    from scipy.spatial.transform import Rotation

    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.from_quat(pose[3:]).as_matrix(), pose[:3]
    return T


def test_nothing_sleeps_where_bullet_keeps_it_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = ligature.load(ROOT / "scenes" / "needle_pick" / "launch.yaml")
    monkeypatch.setattr(engine, "exclude_void", lambda boxes: 0)  # all boxes keep their owners
    simulation = Simulation(scene)
    boxes = simulation._world.engine._boxes
    assert len(bullet.find_sleepers(boxes)) >= len(simulation._world.engine._colliders), "ghosts have boxes, too"
    assert len(bullet.find_sleepers(0)) == 0
    for name in ("_COLLIDER_BOX", "_COLLIDER_STATE"):
        for shift in (-64, -8, 8, 16, 64):
            with monkeypatch.context() as patch:
                patch.setattr(bullet, name, getattr(bullet, name) + shift)
                assert len(bullet.find_sleepers(boxes)) == 0, f"{name} {shift:+d}: another version of PyBullet"


def _sprung(rng: np.random.Generator) -> tuple[str, list[float], list[float], list[float]]:
    """Weights on springs that hang from a post, among balls that nothing pulls; their masses, stiffness, damping."""
    count = int(rng.integers(1, 4))
    mass = (10.0 ** rng.uniform(-3, 0, count)).tolist()
    stiffness = [m * 10.0 ** rng.uniform(3, 5) for m in mass]
    damping = [2.0 * rng.uniform(0.2, 1.5) * np.sqrt(k * m) for k, m in zip(stiffness, mass, strict=True)]
    names, joints = ["Post"], ""
    parts = (
        "Post: {name: Post, mass: 0, collision shape: BOX, collision geometry: {x: 0.01, y: 0.01, z: 0.01}, "
        f"{SMOOTH}, location: {{position: {{x: 0, y: 0, z: 0.5}}}}}}\n"
    )
    for k in range(4):
        names.append(f"Ball{k}")
        parts += (
            f"Ball{k}: {{name: Ball{k}, mass: 0.1, collision shape: SPHERE, collision geometry: {{radius: 0.01}}, "
            f"{SMOOTH}, location: {{position: {{x: {0.1 * k}, y: 0.2, z: 0}}}}}}\n"
        )
    falls = SMOOTH.replace("gravity: {x: 0, y: 0, z: 0}", "gravity: {x: 0, y: 0, z: -9.81}")
    for k in range(count):
        x, inertia = 0.1 * (k + 1), 1e-3 * mass[k]
        names.append(f"Weight{k}")
        parts += (
            f"Weight{k}: {{name: Weight{k}, mass: {mass[k]!r}, collision shape: BOX, collision geometry: "
            f"{{x: 0.02, y: 0.02, z: 0.02}}, inertia: {{ix: {inertia}, iy: {inertia}, iz: {inertia}}}, {falls}, "
            f"location: {{position: {{x: {x}, y: 0, z: 0}}}}}}\n"
        )
        still = "{x: 0, y: 0, z: 0}"
        joints += (
            f"Spring{k}: {{name: Spring{k}, type: six dof spring, parent: Post, child: Weight{k}, "
            f"parent axis: {{x: 0, y: 0, z: 1}}, child axis: {{x: 0, y: 0, z: 1}}, parent pivot: "
            f"{{x: {x}, y: 0, z: -0.5}}, child pivot: {still}, joint limits: {{linear: {{low: {{x: 0, y: 0, z: -0.1}}, "
            f"high: {{x: 0, y: 0, z: 0.1}}}}, angular: {{low: {{x: -1, y: 0, z: 0}}, high: {{x: 1, y: 0, z: 0}}}}}}, "
            f"stiffness: {{linear: {{x: 0, y: 0, z: {stiffness[k]!r}}}, angular: {{x: {stiffness[k] * 1e-3!r}, "
            f"y: 0, z: 0}}}}, damping: {{linear: {{x: 0, y: 0, z: {damping[k]!r}}}, angular: "
            f"{{x: {damping[k] * 1e-3!r}, y: 0, z: 0}}}}}}\n"
        )
    hung = ", ".join(f"Spring{k}" for k in range(count))
    head = f"namespace: /ambf/env/\nbodies: [{', '.join(names)}]\njoints: [{hung}]\n"
    return head + parts + joints, mass, stiffness, damping


@pytest.mark.parametrize("seed", range(6))
def test_weights_on_springs_sleep_at_their_sag_and_wake_when_touched(
    seed: int, tmp_path: Path, pair: Callable[[Scene], tuple[Simulation, Simulation]], monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(seed)
    text, mass, *_ = _sprung(rng)
    (tmp_path / "model.yaml").write_text(text, encoding="utf-8")
    scene = ligature.load(tmp_path / "model.yaml")
    with monkeypatch.context() as patch:
        patch.setattr(bullet._Clients, "begin", 0)
        plain = Simulation(scene)
    runs = (*pair(scene), plain)
    hung = next(k for k, tree in enumerate(runs[0]._world.engine.trees) if tree.axes)
    trees, axes = runs[0]._world.engine.motions.trees, runs[0]._world.joints._axes

    def settle() -> None:
        for simulation in runs:
            simulation.step(4000)
        assert len({simulation.state_hash() for simulation in runs}) == 1
        assert trees.asleep[hung], "a spring at its sag never sleeps"
        assert not trees.joints[1].any()

    settle()
    where = trees.joints[0].copy()
    slides = axes.stiffness * np.abs(where - axes.rest)
    assert np.sort(slides)[-len(mass) :] == pytest.approx(np.sort(9.81 * np.array(mass)), rel=1e-9)
    for simulation in runs:
        simulation.step(1000)
    assert (trees.joints[0] == where).all(), "what sleeps does not creep"
    for simulation in runs:
        ball = simulation.bodies["Ball0"]
        ball.set_pose([0.1, 0.0, 0.05, 0, 0, 0, 1])
        ball.command_twist([0.0, 0.0, -0.5, 0.0, 0.0, 0.0])
        simulation.step(80)
        ball.release()
    assert not trees.asleep[hung] and np.abs(trees.joints[0] - where).max() > 1e-6, "the ball moves a weight"
    for simulation in runs:
        simulation.bodies["Ball0"].set_pose([0.0, 0.2, 0.05, 0, 0, 0, 1])
    settle()
    assert trees.joints[0] == pytest.approx(where, abs=1e-9)


def test_holes_on_springs_sleep_among_bodies_of_another_gravity() -> None:
    """With one arm, which has no gravity, most moving bodies of the scene are holes, which have."""
    scene = ligature.load(ROOT / "scenes" / "suturing" / "launch.yaml", [0, 1, 4, 5])
    simulation = Simulation(scene)
    simulation.step(1000)
    phantom = [scene.bodies[tree.root].identity.name for tree in simulation._world.engine.trees].index("Phantom")
    assert _asleep(simulation)[phantom]
