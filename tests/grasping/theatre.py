"""A needle in the air between two arms of our own scene."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
from ligature import Simulation
from ligature.model.frames import inverse, matrix_pose7, pose7_matrix

SCENE = Path(__file__).resolve().parents[2] / "scenes" / "suturing_small" / "launch.yaml"

T_PALM_TIP = np.array([[0.0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
NEEDLE_AT = np.array([0.03, 0.28, 0.765, 0.27436727, -0.95455669, 0.02253886, 0.11417583])
"""Where both arms reach the needle with straight wrists."""

PLACES = {"PSM1": (1, np.pi / 4), "PSM2": (7, np.pi / 3)}
"""Which capsule of the needle an arm takes, and its way there: angle in radians about the wire from the needle's plane."""

DEPTH = 0.0065
"""Distance in metres of the needle from the axis of the fingers."""


class Theatre:
    """Two arms, a needle with its thread, and what tests do with them."""

    def __init__(self, needle_at: np.ndarray = NEEDLE_AT) -> None:
        self.sim = Simulation(ligature.load(SCENE))
        self.needle = self.sim.bodies["Needle"]
        self.needle_at = needle_at
        for name in PLACES:
            arm = self.sim.arms[name]
            arm.enable()
            arm.home()
        self.wait()

    def wait(self, limit: float = 5.0) -> None:
        """Step until no arm moves."""
        for _ in range(int(limit / 0.02)):
            self.sim.step(20)
            if not any(self.sim.arms[name].is_busy for name in PLACES):
                return
        raise AssertionError("an arm does not arrive")

    def palm(self, name: str) -> np.ndarray:
        """Pose (4, 4) of the body that an arm's fingers sit on, inertial frame."""
        return pose7_matrix(self.sim._world.motion(self._jaw(name).palm)[0])

    def needle_in_jaw(self, name: str) -> np.ndarray:
        """Pose (4, 4) of the needle as the arm's jaw sees it."""
        return inverse(self.palm(name)) @ pose7_matrix(self.sim._world.motion(self.needle.body.index)[0])

    def tools(self, name: str) -> list[int]:
        """Bodies at the end of an arm."""
        jaw = self._jaw(name)
        return [jaw.palm, *jaw.fingers]

    def _jaw(self, name: str):
        return next(jaw for jaw in self.sim.scene.jaws if jaw.name == name)

    def grasp_pose(self, name: str, back: float = 0.0) -> np.ndarray:
        """Pose (7,) of an arm's tip in its base frame, ``back`` metres before where it grasps the needle."""
        capsule, angle = PLACES[name]
        T = pose7_matrix(self.needle_at) @ self.needle.body.colliders[capsule].T_body_shape
        along, normal = T[:3, 2], pose7_matrix(self.needle_at)[:3, 2]
        way = np.cos(angle) * normal + np.sin(angle) * np.cross(along, normal)
        H = np.eye(4)
        H[:3, :3] = np.column_stack([np.cross(-way, along), -way, along])
        H[:3, 3] = T[:3, 3] - (DEPTH + back) * way
        arm = next(a for a in self.sim.scene.arms if a.name == name)
        return matrix_pose7(inverse(pose7_matrix(self.sim._world.pose7(arm.base))) @ H @ T_PALM_TIP)

    def reach(self, name: str, back: float = 0.0) -> None:
        """Move an arm to the needle, or ``back`` metres before it."""
        self.sim.arms[name].move_cp(self.grasp_pose(name, back))
        self.wait()

    def open(self, name: str) -> None:
        """Open an arm's jaw and wait."""
        self.sim.arms[name].move_jaw([0.5])  # type: ignore[attr-defined]  # a PSM
        self.wait()

    def close(self, name: str, angle: float = -0.14, ticks: int = 600) -> None:
        """Close an arm's jaw until it holds the needle."""
        self.sim.arms[name].servo_jaw([angle])  # type: ignore[attr-defined]
        for _ in range(ticks):
            self.sim.step()
            if self.sim.grasps[name] is not None:
                self.sim.step(50)
                return
        raise AssertionError(f"{name} closed on nothing")

    def hand_needle_to(self, name: str, angle: float = -0.14) -> None:
        """Put the needle between an arm's pads and let them close on it."""
        self.reach(name)
        self.open(name)
        self.needle.set_pose(self.needle_at)
        self.needle.command_pose(self.needle_at)
        self.sim.step(100)
        self.close(name, angle)
        self.needle.release()
        self.sim.step(200)
