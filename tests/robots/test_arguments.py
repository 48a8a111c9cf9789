"""Arguments of arms and kinematics as programs have them: any container of numbers works, others are reported."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from ligature.robots.ecm import Ecm
from ligature.robots.mtm import Mtm
from ligature.robots.operating_state import Rejected
from ligature.robots.psm import Psm
from ligature.robots.psm_arm import PsmArm

from tests.robots.test_operating_state import homed, make_arm

Q = [0.1, -0.2, 0.14, 0.3, 0.2, -0.1]
NO_NUMBERS: dict[str, Any] = {
    "text": "home", "texts": ["a"] * 6, "mapping": dict(enumerate(Q)), "generator": (q for q in Q), "a function": print,
    "complex": np.array(Q, complex), "unequal": [[1.0], [1.0, 2.0]], "huge": [10**400] * 6, "objects": [object()] * 6,
}  # fmt: skip
TAKES: dict[str, Callable[[PsmArm, Any], object]] = {
    "move_jp": PsmArm.move_jp, "move_jr": PsmArm.move_jr, "servo_jp": PsmArm.servo_jp, "servo_jr": PsmArm.servo_jr,
    "servo_jv": PsmArm.servo_jv, "servo_jf": PsmArm.servo_jf, "move_cp": PsmArm.move_cp, "servo_cp": PsmArm.servo_cp,
    "servo_cr": PsmArm.servo_cr, "servo_cv": PsmArm.servo_cv, "body_servo_cf": PsmArm.body_servo_cf,
    "spatial_servo_cf": PsmArm.spatial_servo_cf, "place_jp": PsmArm.place_jp, "servo_jaw": PsmArm.servo_jaw,
    "forward_kinematics": PsmArm.forward_kinematics, "seed": lambda arm, value: arm.inverse_kinematics(value, np.eye(4)),
    "inverse_kinematics": lambda arm, value: arm.inverse_kinematics(Q, value),
    "set_base_frame": lambda arm, value: arm.set_base_frame(value, "world"),
    "ratio": PsmArm.trajectory_j_set_ratio, "ratio_v": PsmArm.trajectory_j_set_ratio_v,
}  # fmt: skip


@pytest.fixture(scope="module")
def arm() -> PsmArm:
    return homed()


@pytest.mark.parametrize("wrong", NO_NUMBERS)
@pytest.mark.parametrize("method", TAKES)
def test_what_is_no_number_is_rejected_and_changes_nothing(arm: PsmArm, method: str, wrong: str) -> None:
    before = arm.setpoint_js().position
    with pytest.raises(Rejected, match="takes .*not|ratio"):
        TAKES[method](arm, NO_NUMBERS[wrong])
    np.testing.assert_array_equal(arm.setpoint_js().position, before)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, None])
def test_the_forward_kinematics_of_an_arm_takes_finite_numbers(arm: PsmArm, value: Any) -> None:
    with pytest.raises(Rejected, match="forward_kinematics takes finite numbers"):
        arm.forward_kinematics([0.0, value])


@pytest.mark.parametrize("ratio", [None, 0.0, 1.5, np.nan, [0.5, 0.5], []])
def test_a_ratio_is_one_number_up_to_one(arm: PsmArm, ratio: Any) -> None:
    with pytest.raises(Rejected, match="a ratio must be above 0 and at most 1"):
        arm.trajectory_j_set_ratio(ratio)
    assert arm.joints.ratio_v == arm.joints.ratio_a == 1.0


@pytest.mark.parametrize("reference", [None, 3, b"world", ["world"]])
def test_a_frame_has_a_name(arm: PsmArm, reference: Any) -> None:
    with pytest.raises(Rejected, match="takes the name of a frame"):
        arm.set_base_frame([0, 0, 0, 0, 0, 0, 1], reference)


@pytest.mark.parametrize("method", [None, 3, "nope", "_check_running", "servo cp", "name", ["servo_cp"]])
def test_what_is_no_command_is_carried_out_by_nobody(arm: PsmArm, method: Any) -> None:
    with pytest.raises(Rejected, match="direct takes the name of a command, such as 'servo_cp', not "):
        arm.direct(method)


@pytest.mark.parametrize("stiffness", [None, 3.0, np.eye(3), {"gains": 1}])
def test_an_impedance_is_one(arm: PsmArm, stiffness: Any) -> None:
    with pytest.raises(Rejected, match="servo_ci takes a CartesianImpedance, not "):
        arm.servo_ci(stiffness)


@pytest.mark.parametrize("seed", range(5))
def test_a_base_is_so_near_that_a_pose_keeps_its_digits(seed: int) -> None:
    rng, arm = np.random.default_rng(seed), homed()
    near = rng.uniform(-1e6, 1e6, 3)
    arm.set_base_frame([*near, 0, 0, 0, 1], "world")
    before = arm.local_setpoint_cp()
    arm.servo_cp(arm.setpoint_cp())
    np.testing.assert_allclose(arm.local_setpoint_cp(), before, atol=1e-9)
    far = near * 10.0 ** rng.uniform(2.0, 300.0) / np.abs(near).max() * 1e6
    with pytest.raises(Rejected, match=r"the base must stay within 1e\+06 m"):
        arm.set_base_frame([*far, 0, 0, 0, 1], "world")
    np.testing.assert_array_equal(arm.base_frame[:3, 3], near)


def test_a_pose_out_of_reach_names_the_joint(arm: PsmArm) -> None:
    with pytest.raises(Rejected, match="it needs insertion = .* outside its limits"):
        arm.inverse_kinematics(Q, arm.kinematics.forward([0, 0, 1.0, 0, 0, 0]))


@pytest.mark.parametrize("use", [
    PsmArm.home, PsmArm.enable, PsmArm.disable, PsmArm.adopt, PsmArm.take_over, PsmArm.hold, PsmArm.spatial_measured_cf,
    lambda arm: arm.move_jp(Q), lambda arm: arm.place_jp(Q), lambda arm: arm.jaw.open(), lambda arm: arm.direct("hold"),
])  # fmt: skip
def test_the_arm_of_a_closed_simulation_reports_it(use: Callable[[PsmArm], object]) -> None:
    arm = make_arm()
    arm.end()
    with pytest.raises(RuntimeError, match="the simulation of PSM1 is closed"):
        use(arm)
    assert np.isfinite(arm.measured_cp()).all()


@pytest.mark.parametrize("chain", [Psm(420006, "Si"), Ecm("Si_HD_UP"), Mtm("left")], ids=["PSM", "ECM", "MTM"])
@pytest.mark.parametrize("leading", [(), (0,), (3, 0), (0, 2), (2, 3)])
def test_leading_axes_are_kept_also_where_there_is_no_pose(chain: Any, leading: tuple[int, ...]) -> None:
    q = np.zeros((*leading, len(chain.joint_names)))
    result = chain.inverse(chain.forward(q))
    assert result.q.shape == q.shape
    assert np.shape(result.code) == np.shape(result.joint) == np.shape(result.reason) == leading


@pytest.mark.parametrize("chain", [Psm(420006, "Si"), Ecm("Si_HD_UP"), Mtm("left")], ids=["PSM", "ECM", "MTM"])
def test_a_pose_beyond_a_thousand_kilometres_is_called_that(chain: Any) -> None:
    T = chain.forward(np.zeros(len(chain.joint_names)))
    for exponent in range(7, 300, 40):
        T[:3, 3] = -(10.0**exponent)
        assert chain.inverse(T).reason == "not a rigid pose within 1000 km"


@pytest.mark.parametrize("shape", [(5,), (7,), (2, 3), (4, 6), (), (0,)])
def test_a_seed_of_another_shape_is_reported(shape: tuple[int, ...]) -> None:
    psm = Psm(420006, "Si")
    with pytest.raises(ValueError, match="expected one seed of 6 joint values, or one for each of 1 poses, got "):
        psm.inverse(psm.forward(Q), seed=np.zeros(shape))
