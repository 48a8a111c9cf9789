"""The compiled tick of grasps: the same bits as through PyBullet, and efforts by the law of every command."""

from __future__ import annotations

import numpy as np
import pytest
from ligature import Simulation
from ligature.physics import bullet
from ligature.physics.axes import FORCE, FREE, POSITION, SERVO, VELOCITY, axes, requested_effort
from ligature.physics.trees import trees
from ligature.simulation import Snapshot
from ligature.tables import table_of

from tests.grasping.theatre import Theatre


def _work(simulation: Simulation, needle: int, seed: int) -> list[str]:
    """Hashes while PSM1 moves and presses anew with the needle that it holds, is pulled at, and lets go in the end."""
    rng, hashes, arm = np.random.default_rng(seed), [], simulation.arms["PSM1"]
    handle = next(h for name, h in simulation.bodies.items() if h.body.index == needle)
    for k in range(12):
        arm.servo_jr(0.002 * rng.standard_normal(6))
        if k % 3 == 1:
            arm.servo_jaw([rng.uniform(-0.2, -0.05)])
        handle.command_wrench(rng.choice([0.0, 4.0]) * rng.standard_normal(6) * [1, 1, 1, 1e-3, 1e-3, 1e-3])
        simulation.step(int(rng.integers(1, 9)))
        hashes.append(simulation.state_hash())
    assert simulation.grasps["PSM1"] is not None
    arm.servo_jaw([0.5])
    simulation.step(30)
    assert simulation.grasps["PSM1"] is None
    return [*hashes, simulation.state_hash()]


def test_a_held_needle_moves_with_the_same_bits_through_pybullet(
    stage: tuple[Theatre, Snapshot], held: Theatre, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bullet._Clients, "begin", 0)
    plain = Simulation(held.sim.scene)
    assert not plain._world.engine.motions.handle and held.sim._world.engine.motions.handle
    plain.restore(stage[1])
    needle = held.needle.body.index
    assert _work(held.sim, needle, 5) == _work(plain, needle, 5)
    plain.close()


@pytest.mark.parametrize("seed", range(20))
def test_an_axis_asks_for_the_effort_of_its_command(seed: int) -> None:
    rng = np.random.default_rng(seed)
    bodies, laws = trees(1, 2, 1), axes(1, 1)
    mode = int(rng.choice([FREE, FORCE, POSITION, VELOCITY, SERVO]))
    target, at, strength, own, asked = rng.uniform(-4.0, 4.0, 5)
    bodies.joints[0, 0], laws.mode[0], laws.target[0], laws.strength[0] = at, mode, target, abs(strength)
    laws.yield_stiffness[0], laws.asked[0] = rng.choice([0.0, abs(own)]), asked
    laws.turns[0], laws.force_output[0] = rng.integers(2, size=2)
    behind = np.arctan2(np.sin(target - at), np.cos(target - at)) if laws.turns[0] else target - at
    wanted = {
        FREE: 0.0,
        FORCE: target,
        VELOCITY: np.copysign(abs(strength), target),
        SERVO: (laws.yield_stiffness[0] or 2.0) * behind,
        POSITION: asked if laws.force_output[0] else 2.0 * behind,
    }[mode]
    assert requested_effort(table_of(bodies), table_of(laws), 0, 2.0) == pytest.approx(wanted, abs=1e-12)
