"""What an arm of a simulation reports, as views of the state record: nothing is asked twice, or computed again."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

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
        ox, oy, oz, x, y, z, w = self.base.tolist()
        px, py, pz = self.tip[:3].tolist()
        cx, cy, cz = y * pz - z * py + w * px, z * px - x * pz + w * py, x * py - y * px + w * pz
        return np.array([
            ox + px + 2.0 * (y * cz - z * cy), oy + py + 2.0 * (z * cx - x * cz), oz + pz + 2.0 * (x * cy - y * cx),
        ])  # fmt: skip
