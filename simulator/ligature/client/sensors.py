"""Handles of sensors: rays, contacts, ghost volumes. Poses are in the parent's frame, ranges in metres."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import rospy
from ambf_msgs.msg import (
    ContactEvent,
    ContactSensorCmd,
    ContactSensorState,
    GhostObjectCmd,
    GhostObjectState,
    SensorCmd,
    SensorState,
)
from geometry_msgs.msg import Pose

from ligature.client.base_object import BaseObject


class _Sensing(BaseObject):
    def get_pose(self) -> Pose:
        """The pose, as a message."""
        return self._state.pose

    def _entry(self, values: Sequence[Any], index: int, what: str) -> Any:
        if 0 <= index < len(values):
            return values[index]
        rospy.logwarn(f"{self._name}: no {what} {index}; there are {len(values)}")
        return None


class Sensor(_Sensing):
    """Rays of a proximity or resistance sensor. An index beyond the last ray gives None, with a message."""

    State = SensorState
    Command = SensorCmd

    def get_count(self) -> int:
        """How many rays there are."""
        return self._state.count

    def is_triggered(self, idx: int) -> bool | None:
        """Whether a ray hits."""
        return self._entry(self._state.triggered, idx, "ray")

    def get_range(self, idx: int) -> float | None:
        """Length of a ray; messages hold one for all."""
        ranges = self._state.range
        return self._entry(ranges, 0 if len(ranges) == 1 and 0 <= idx < self.get_count() else idx, "range")

    def get_measurement(self, idx: int) -> float | None:
        """What a ray measures: 1 at its start, 0 at its end."""
        return self._entry(self._state.measurement, idx, "measurement")

    def get_all_measurements(self) -> list[float]:
        """What all rays measure."""
        return list(self._state.measurement)

    def get_sensed_object(self, idx: int) -> str | None:
        """Name of the body that a ray hits; empty for none."""
        sensed = self._entry(self._state.sensed_objects, idx, "ray")
        return None if sensed is None else sensed.data

    def get_parent(self) -> str:
        """The body that carries the sensor."""
        return self.get_parent_name()


class GhostObject(_Sensing):
    """A volume that names the bodies inside it."""

    State = GhostObjectState
    Command = GhostObjectCmd

    def get_sensed_obj_name(self, idx: int) -> str | None:
        """Identifier of one body inside; None, with a message, beyond the last."""
        sensed = self._entry(self._state.sensed_objects, idx, "sensed body")
        return None if sensed is None else sensed.data

    def get_all_sensed_obj_names(self) -> list[str]:
        """Identifiers of all bodies inside."""
        return [sensed.data for sensed in self._state.sensed_objects]


class ContactSensor(BaseObject):
    """Contacts of a body, one event for each body that touches it; points and normals in the world."""

    State = ContactSensorState
    Command = ContactSensorCmd

    def get_num_contact_events(self) -> int:
        """How many bodies touch."""
        return len(self._state.contact_events)

    def get_contact_event(self, idx: int) -> ContactEvent | None:
        """One touching body with its contacts; None beyond the last."""
        events = self._state.contact_events
        return events[idx] if 0 <= idx < len(events) else None

    def get_all_contact_event(self) -> list[ContactEvent]:
        """All touching bodies with their contacts."""
        return list(self._state.contact_events)

    def get_contact_object_name(self, idx: int) -> str | None:
        """Identifier of one touching body; None beyond the last."""
        event = self.get_contact_event(idx)
        return None if event is None else event.object_name.data

    def get_all_contact_object_names(self) -> list[str]:
        """Identifiers of all touching bodies."""
        return [event.object_name.data for event in self._state.contact_events]
