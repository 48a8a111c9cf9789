"""What an arm of a simulation reports, as views of the state record: nothing is asked twice, or computed again."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.environments.layout import Places
from ligature.kernels import compiled
from ligature.robots.psm_arm import PsmArm
from ligature.simulation import Simulation

Array = NDArray[np.float64]


class ArmReading:
    """One arm as it was when the state was written last; all arrays are views that follow the state.

    Attributes
    ----------
    base
        Pose (7,) of the base in the world.
    joints, joint_velocities, joint_setpoints
        (6,) each; radians and metres.
    jaw, jaw_setpoint
        Position, velocity and effort (3,) of the jaw; zero without one.
    tip, setpoint
        Poses (7,) of the tip in the base, measured and asked for.
    """

    def __init__(self, simulation: Simulation, arm: PsmArm) -> None:
        described = simulation.scene.arms
        number = next(k for k, one in enumerate(described) if one.name == arm.name)
        state = simulation.state
        record, n = state["arm"][0, number], arm.joints.n
        self.base: Array = state["body_pose"][0, described[number].base]
        self.joints, self.joint_velocities = record["measured_js"][0, :n], record["measured_js"][1, :n]
        self.joint_setpoints: Array = record["setpoint_js"][0, :n]
        self.jaw, self.jaw_setpoint = record["jaw_measured_js"], record["jaw_setpoint_js"]
        self.tip, self.setpoint = record["local_measured_cp"], record["local_setpoint_cp"]

    def tip_position(self) -> Array:
        """The control point of the tool (3,), world axes."""
        found = np.empty(3)
        _write_tip(self.base, self.tip, found)
        return found

    def write(self, places: Places, side: Array, found: Array) -> None:
        """Write what a state observation has of this arm to its ``places`` in ``found``.

        Quaternions get the sign that is nearer to ``side`` (4,).
        """
        _write_arm(
            self.joints, self.jaw, self.tip, self.base, self.joint_velocities, self.setpoint, self.jaw_setpoint, side,
            places.joints, places.control_point, places.velocities, found,
        )  # fmt: skip


@compiled
def write_on_side(pose: Array, side: Array, found: Array) -> None:
    """A pose (7,) whose quaternion has the sign that is nearer to ``side`` (4,): it has no leaps near there."""
    same = pose[3] * side[0] + pose[4] * side[1] + pose[5] * side[2] + pose[6] * side[3] >= 0.0
    for a in range(3):
        found[a] = pose[a]
    for a in range(3, 7):
        found[a] = pose[a] if same else -pose[a]


@compiled
def _write_tip(base: Array, tip: Array, found: Array) -> None:
    """Position (3,) in the world of a ``tip`` (7,) in a ``base`` (7,)."""
    x, y, z, w = base[3], base[4], base[5], base[6]
    px, py, pz = tip[0], tip[1], tip[2]
    cx, cy, cz = y * pz - z * py + w * px, z * px - x * pz + w * py, x * py - y * px + w * pz
    found[0] = base[0] + px + 2.0 * (y * cz - z * cy)
    found[1] = base[1] + py + 2.0 * (z * cx - x * cz)
    found[2] = base[2] + pz + 2.0 * (x * cy - y * cx)


@compiled
def _write_arm(
    joints: Array, jaw: Array, tip: Array, base: Array, velocities: Array, setpoint: Array, jaw_setpoint: Array,
    side: Array, begin: int, point: int, moving: int, found: Array,
) -> None:  # fmt: skip
    """See `ArmReading.write`: joints, jaw and tip from ``begin`` on, velocities and set-points from ``moving`` on."""
    n = joints.shape[0]
    for j in range(n):
        found[begin + j], found[moving + j] = joints[j], velocities[j]
    found[begin + n], found[moving + n] = jaw[0], jaw[1]
    write_on_side(tip, side, found[begin + n + 1 : begin + n + 8])
    write_on_side(setpoint, side, found[moving + n + 1 : moving + n + 8])
    found[moving + n + 8] = jaw_setpoint[0]
    _write_tip(base, tip, found[point : point + 3])
