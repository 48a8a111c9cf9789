"""From a command that travelled as numbers to the method of the arm that it means.

The layout of the numbers of each verb stands here alone; front ends fill them by `ligature.model.commands.VERBS`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ligature.model.commands import VERBS, ArmCommand
from ligature.model.frames import quaternion_matrix
from ligature.robots.arm import Arm
from ligature.robots.ecm_arm import EcmArm
from ligature.robots.impedance import CartesianImpedance
from ligature.robots.mtm_arm import MtmArm
from ligature.robots.operating_state import Refused
from ligature.robots.psm_arm import PsmArm

Values = tuple[float, ...]
Method = Callable[[Arm, Values, str], None]

IMPEDANCE_NUMBERS = 3 + 4 + 4 + 48
"""Force position, force orientation, torque orientation, gains (4, 4, 3)."""


def carry_out(arm: Arm, command: ArmCommand) -> None:
    """Have ``arm`` do what ``command`` says; raises `Refused` when it does not."""
    _METHODS[command.verb](arm, command.values, command.text)


def _one(values: Values, what: str) -> float:
    if len(values) != 1:
        raise Refused(f"{what} takes one number, not {len(values)}")
    return values[0]


def _state_command(arm: Arm, values: Values, text: str) -> None:
    if text == "adopt":
        arm.adopt()
    else:
        arm.state_command(text)


def _servo_jp(arm: Arm, values: Values, text: str) -> None:
    """Positions, or positions and as many velocities."""
    n = arm.joints.n
    if len(values) == 2 * n:
        arm.servo_jp(values[:n], values[n:])
    else:
        arm.servo_jp(values)


def _servo_ci(arm: Arm, values: Values, text: str) -> None:
    if len(values) != IMPEDANCE_NUMBERS:
        raise Refused(f"servo_ci takes {IMPEDANCE_NUMBERS} numbers, not {len(values)}")
    numbers = np.array(values)
    gains = numbers[11:].reshape(4, 4, 3)
    R_force, R_torque = _rotation(numbers[3:7]), _rotation(numbers[7:11])
    arm.servo_ci(CartesianImpedance(numbers[:3], R_force, R_torque, gains))


def _rotation(
    quaternion: np.ndarray[tuple[int, ...], np.dtype[np.float64]],
) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Rotation (3, 3) of a quaternion (4,); one of zeros is none."""
    length = float(np.linalg.norm(quaternion))
    return np.eye(3) if length < 0.1 else quaternion_matrix(quaternion / length)


def _servo_cs(arm: Arm, values: Values, text: str) -> None:
    """A letter for each part that is given (``p``, ``t``, ``w``), and the numbers of all three."""
    if len(values) != 19:
        raise Refused(f"servo_cs takes 19 numbers, not {len(values)}")
    parts = {"p": values[:7], "t": values[7:13], "w": values[13:]}
    given = {letter: part if letter in text else None for letter, part in parts.items()}
    arm.servo_cs(given["p"], given["t"], given["w"])


def _psm(method: Callable[[PsmArm, Values, str], None]) -> Method:
    def call(arm: Arm, values: Values, text: str) -> None:
        if not isinstance(arm, PsmArm):
            raise Refused(f"{arm.name} is no PSM: it has neither jaw nor tool")
        method(arm, values, text)

    return call


def _mtm(method: Callable[[MtmArm, Values, str], None]) -> Method:
    def call(arm: Arm, values: Values, text: str) -> None:
        if not isinstance(arm, MtmArm):
            raise Refused(f"{arm.name} is no MTM")
        method(arm, values, text)

    return call


def _set_endoscope_type(arm: Arm, values: Values, text: str) -> None:
    if not isinstance(arm, EcmArm):
        raise Refused(f"{arm.name} is no ECM: it has no endoscope")
    arm.set_endoscope_type(text)


_METHODS: dict[str, Method] = {
    "state_command": _state_command,
    "servo_jp": _servo_jp,
    "servo_jr": lambda arm, values, _: arm.servo_jr(values),
    "servo_jv": lambda arm, values, _: arm.servo_jv(values),
    "servo_jf": lambda arm, values, _: arm.servo_jf(values),
    "servo_cp": lambda arm, values, _: arm.servo_cp(values),
    "servo_cv": lambda arm, values, _: arm.servo_cv(values),
    "servo_ci": _servo_ci,
    "servo_cs": _servo_cs,
    "spatial/servo_cf": lambda arm, values, _: arm.spatial_servo_cf(values),
    "body/servo_cf": lambda arm, values, _: arm.body_servo_cf(values),
    "move_jp": lambda arm, values, _: arm.move_jp(values),
    "move_jr": lambda arm, values, _: arm.move_jr(values),
    "move_cp": lambda arm, values, _: arm.move_cp(values),
    "place_jp": lambda arm, values, _: arm.place_jp(values),
    "hold": lambda arm, _, __: arm.hold(),
    "free": lambda arm, _, __: arm.free(),
    "use_gravity_compensation": lambda arm, values, _: arm.use_gravity_compensation(bool(_one(values, "the flag"))),
    "body/set_cf_orientation_absolute": lambda arm, values, _: arm.body_set_cf_orientation_absolute(
        bool(_one(values, "the flag"))
    ),
    "set_base_frame": lambda arm, values, text: arm.set_base_frame(values, text),
    "trajectory_j/set_ratio": lambda arm, values, _: arm.trajectory_j_set_ratio(_one(values, "the ratio")),
    "trajectory_j/set_ratio_v": lambda arm, values, _: arm.trajectory_j_set_ratio_v(_one(values, "the ratio")),
    "trajectory_j/set_ratio_a": lambda arm, values, _: arm.trajectory_j_set_ratio_a(_one(values, "the ratio")),
    "jaw/servo_jp": _psm(lambda arm, values, _: arm.servo_jaw(values)),
    "jaw/servo_jf": _psm(lambda arm, values, _: arm.push_jaw(values)),
    "jaw/move_jp": _psm(lambda arm, values, _: arm.move_jaw(values)),
    "set_tool_type": _psm(lambda arm, _, text: arm.set_tool_type(text)),
    "tool_type_request": _psm(lambda arm, _, __: arm.emit("tool_type", arm.tool_type)),
    "emulate_adapter_present": _psm(lambda arm, values, _: None),
    "emulate_tool_present": _psm(lambda arm, values, _: arm.emulate_tool_present(bool(_one(values, "the flag")))),
    "set_endoscope_type": _set_endoscope_type,
    "lock_orientation": _mtm(lambda arm, values, _: arm.lock_orientation(values)),
    "unlock_orientation": _mtm(lambda arm, _, __: arm.unlock_orientation()),
    "gripper/servo_jp": _mtm(lambda arm, values, _: arm.gripper_servo_jp(values)),
}

assert set(_METHODS) == set(VERBS)
