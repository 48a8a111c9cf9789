"""What an action makes of a set-point: the same bits as the equations in NumPy."""

from __future__ import annotations

import numpy as np
from ligature.environments.actions import AHEAD_ANGLE, AHEAD_LENGTH, STEP_ANGLE, STEP_LENGTH, _step_setpoint
from ligature.model.frames import axis_rotation
from ligature.robots.psm import Psm

Array = np.ndarray

PSM = Psm(400006, "SRC")


def stepped(before: Array, action: Array) -> Array:
    T = PSM.forward(before)
    T[:3, 3] += STEP_LENGTH * action[:3]
    x, y, z = turn = STEP_ANGLE * action[3:6]
    angle = float(np.sqrt(x * x + y * y + z * z))
    if angle > 0.0:
        T[:3, :3] = T[:3, :3] @ axis_rotation(turn / angle, angle)
    return T


def test_an_action_moves_the_set_point_by_its_equations_to_the_bit() -> None:
    rng = np.random.default_rng(0)
    measured, T = np.empty((4, 4)), np.empty((4, 4))
    near = set()
    for n in range(3000):
        before = rng.uniform(PSM.lower, PSM.upper)
        q, action = before + rng.uniform(-0.1, 0.1, 6) * rng.uniform(), rng.uniform(-1.0, 1.0, 7)
        if n % 4 == 0:
            action[3 + n % 3 :] = 0.0
        is_near = _step_setpoint(*PSM.tables(), q, before, action, measured, T)
        wanted, there = stepped(before, action), PSM.forward(q)
        assert T.tobytes() == wanted.tobytes()
        assert measured.tobytes() == there.tobytes()
        ahead = wanted[:3, 3] - there[:3, 3]
        cosine = 0.5 * (float((there[:3, :3] * wanted[:3, :3]).sum()) - 1.0)
        assert is_near == (np.linalg.norm(ahead) <= AHEAD_LENGTH and cosine >= np.cos(AHEAD_ANGLE))
        near.add(is_near)
    assert near == {False, True}
