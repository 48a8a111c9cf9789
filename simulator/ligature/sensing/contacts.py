"""Contact sensors: which bodies touch the sensor's body, where, and how deep (as in AMBF).

World axes, metres; points and normals are on the other body.
"""

from __future__ import annotations

from ligature.model.hits import Contact
from ligature.model.scene import Scene, SensorType
from ligature.model.state import MAX_CONTACT_EVENTS, StateRecord
from ligature.model.subsystem import Subsystem
from ligature.sensing.targets import Targets


class Contacts(Subsystem):
    """The contact sensors of a scene and their last contact points."""

    def __init__(self, scene: Scene, targets: Targets) -> None:
        self._targets = targets
        self._sensors = [s for s in scene.sensors if s.type is SensorType.CONTACT]
        self.events: list[tuple[int, Contact]] = []

    def sense(self, state: StateRecord) -> None:
        """Find the contacts of every sensor's body, and write them."""
        if self._sensors:
            self._look()
            self._write(state)

    def reset(self) -> None:
        """Nothing: contacts follow from the bodies."""

    def snapshot(self) -> None:
        """Nothing: contacts follow from the bodies."""

    def restore(self, snapshot: None) -> None:
        """Nothing: contacts follow from the bodies."""

    def _look(self) -> None:
        self.events = [
            (sensor.index, contact)
            for sensor in self._sensors
            for contact in self._targets.contacts(sensor.parent, sensor.distance_threshold)
        ]

    def _write(self, state: StateRecord) -> None:
        """Write the first `MAX_CONTACT_EVENTS` points; ``contact_count`` counts them all."""
        for name in ("sensor", "body", "distance", "point", "normal"):
            state[f"contact_{name}"] = 0
        state["contact_count"] = len(self.events)
        for row, (sensor, contact) in enumerate(self.events[:MAX_CONTACT_EVENTS]):
            state["contact_sensor"][0, row] = sensor
            state["contact_body"][0, row] = contact.body
            state["contact_distance"][0, row] = contact.distance
            state["contact_point"][0, row] = contact.point
            state["contact_normal"][0, row] = contact.normal
