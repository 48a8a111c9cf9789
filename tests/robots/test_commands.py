"""Every CRTK verb reaches the method of an arm that it is for, with its fields in order."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature.model.scene import ArmKind
from ligature.robots.arm import Arm
from ligature.robots.commands import VERBS, ArmCommand, ServoCi
from ligature.robots.ecm_arm import EcmArm
from ligature.robots.mtm_arm import MtmArm
from ligature.robots.operating_state import Rejected
from ligature.robots.psm_arm import PsmArm

CLASSES = {ArmKind.PSM: PsmArm, ArmKind.ECM: EcmArm, ArmKind.MTM: MtmArm, None: Arm}


@pytest.mark.parametrize("verb", sorted(VERBS))
def test_a_verb_names_a_method_of_the_arms_that_take_it(verb: str) -> None:
    command = VERBS[verb]
    assert command._call is not ArmCommand._call or callable(getattr(CLASSES[command.kind], command._method, None))


@pytest.mark.parametrize("verb", sorted(verb for verb, command in VERBS.items() if command.kind is not None))
def test_an_arm_of_another_kind_rejects_a_verb_with_a_reason(verb: str) -> None:
    kind = VERBS[verb].kind
    for other in set(ArmKind) - {kind}:
        arm = SimpleNamespace(name="A", kind=other.name)
        with pytest.raises(Rejected, match="^A "):
            VERBS[verb].carry_out(SimpleNamespace(kind=kind), arm)


@given(st.lists(st.floats(-1e3, 1e3), min_size=48, max_size=48), st.lists(st.floats(-1, 1), min_size=3, max_size=3))
def test_gains_of_an_impedance_go_by_side_gain_and_axis(numbers: list[float], position: list[float]) -> None:
    taken: list[Any] = []
    sides = [tuple(numbers[12 * side : 12 * side + 12]) for side in range(4)]
    turned = (0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5))
    ServoCi(0, tuple(position), (0.0,) * 4, turned, *sides).carry_out(
        SimpleNamespace(name="A", kind="PSM", servo_ci=taken.append)
    )
    (impedance,) = taken
    assert impedance.force_position.tolist() == position
    np.testing.assert_array_equal(impedance.R_force, np.eye(3))
    np.testing.assert_allclose(impedance.R_torque, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-12)
    for side in range(4):
        for gain in range(4):
            assert impedance.gains[side, gain].tolist() == list(sides[side][3 * gain : 3 * gain + 3])
