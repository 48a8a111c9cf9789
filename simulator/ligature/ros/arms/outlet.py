"""One arm on ROS: its readings, events and services. Radians, metres."""

from __future__ import annotations

from typing import Any

import numpy as np

from ligature.model.frames import inverse, pose7_matrix
from ligature.model.scene import ArmDescription, Scene
from ligature.robots.fitting import base_pose, kinematics_of
from ligature.robots.instruments import INSTRUMENTS
from ligature.robots.psm import Psm
from ligature.ros.arms.events import EventTopics, event_topics
from ligature.ros.arms.readings import Reading, readings
from ligature.ros.arms.services import Services
from ligature.ros.publisher import Publisher

EVERY = {
    "measured_js": 1, "measured_cp": 1, "setpoint_js": 2, "setpoint_cp": 2, "jaw/measured_js": 2,
    "jaw/setpoint_js": 2, "gripper/measured_js": 2, "measured_cv": 2, "body/measured_cf": 2,
}  # fmt: skip
SELDOM = 4
"""Readings are published every so many periods: where the arm is at 200 Hz, what else programs close loops on at
100 Hz, the rest at 50 Hz. A client of the dVRK listens to a dozen of them for each arm, in one Python process.
"""


def published_topics(description: ArmDescription, root: str) -> list[str]:
    """What an arm publishes below ``root``."""
    names = (*(reading.topic for reading in readings(description.kind, (), "")), *event_topics(description.kind))
    return [f"{root}/{name}" for name in names]


class ArmOutlet:
    """One arm: its topics and services."""

    def __init__(self, index: int, description: ArmDescription, root: str, scene: Scene) -> None:
        self.index, self.description, self.root = index, description, root
        self.frame = f"{scene.world.frame_prefix}{description.name}"
        self.base_frame = f"{self.frame}_base"
        self.T_base = base_pose(scene, description)
        self._kinematics = kinematics = kinematics_of(scene, description)
        self._T_reference_base = np.eye(4)
        self.events = EventTopics(root, description.kind)
        self._readings = readings(description.kind, kinematics.joint_names, self.base_frame)
        self._outlets: list[tuple[Reading, Publisher, int]] = [
            (reading, Publisher(f"{root}/{reading.topic}", type(reading.message)), EVERY.get(reading.topic, SELDOM))
            for reading in self._readings
        ]
        self._services = Services(root, self.events, lambda: self._kinematics, lambda: self._T_reference_base)
        self.subscribers: list[Any] = []

    def follow(self, record: Any) -> None:
        """Keep up with the instrument and the base frame of the state record."""
        kinematics = self._kinematics
        if isinstance(kinematics, Psm) and int(record["tool"]) not in (0, kinematics.instrument.id):
            self._kinematics = Psm(INSTRUMENTS[int(record["tool"])], kinematics.model, kinematics.lengths)
        local, referred = pose7_matrix(record["local_measured_cp"]), pose7_matrix(record["measured_cp"])
        self._T_reference_base = referred @ inverse(local)

    def publish(self, record: Any, stamp: Any, count: int) -> int:
        """Publish the readings that are due in period number ``count`` and have subscribers."""
        sent = 0
        for reading, publisher, every in self._outlets:
            if publisher.heard and count % every == 0:
                publisher.publish(reading.filled(record, stamp))
                sent += 1
        return sent

    def close(self) -> None:
        """Fall silent and take no commands: all topics and services are left to others. Asks the master a lot."""
        for subscriber in self.subscribers:
            subscriber.unregister()
        self.events.close()
        for _, publisher, _ in self._outlets:
            publisher.close()
        self._services.close()

    @property
    def dropped(self) -> int:
        """Messages that slow clients missed."""
        return sum(publisher.dropped for _, publisher, _ in self._outlets)
