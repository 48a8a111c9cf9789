"""Handles of vehicles: power, steering (radians) and brake of their wheels; poses in the world."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from ambf_msgs.msg import VehicleCmd, VehicleState
from geometry_msgs.msg import Point

from ligature.client.base_object import BaseObject
from ligature.client.joints import grown


class Vehicle(BaseObject):
    """A chassis with wheels, of which all are powered and steered unless set otherwise.

    ``arguments`` and ``named`` are those of `BaseObject`.
    """

    State = VehicleState
    Command = VehicleCmd

    def __init__(self, *arguments: object, **named: object) -> None:
        super().__init__(*arguments, **named)  # type: ignore[arg-type]
        self._powered: Sequence[int] | None = None
        self._steered: Sequence[int] | None = None

    def get_wheel_count(self) -> int:
        """How many wheels there are."""
        return self._state.wheel_count

    def set_powered_wheel_indices(self, indices: Sequence[int]) -> None:
        """Which wheels `set_vehicle_power` drives."""
        self._powered = tuple(indices)

    def set_steered_wheel_indices(self, indices: Sequence[int]) -> None:
        """Which wheels are turned to steer."""
        self._steered = tuple(indices)

    def set_vehicle_power(self, value: float) -> None:
        """Power of every powered wheel."""
        self._set_all("wheel_power", self._powered, lambda _: value)

    def set_vehicle_steering(self, value: float) -> None:
        """Angle of every steered wheel."""
        self._set_all("wheel_steering", self._steered, lambda _: value)

    def set_vehicle_brake(self, value: float) -> None:
        """Brake of every wheel; the flag for all wheels is set when it is not zero."""
        self._set_all("wheel_brake", None, lambda _: value)
        self._cmd.brake = bool(value)

    def set_vehicle_steering_ackerman(self, value: float) -> None:
        """Turn each steered wheel so that all axes meet where a wheel at the middle, turned by ``value``, points.

        The vehicle's x is forwards and y to the left; the fixed wheels' mean position is the rear axle.
        """
        self._set_all("wheel_steering", self._steered, lambda wheel: self._ackermann(wheel, value))

    def set_wheel_power(self, idx: int, value: float) -> None:
        """Power ``value`` of the wheel ``idx``."""
        self._set("wheel_power", idx, value)

    def set_wheel_steering(self, idx: int, value: float) -> None:
        """Angle ``value`` (rad) of the wheel ``idx``."""
        self._set("wheel_steering", idx, value)

    def set_wheel_brake(self, idx: int, value: float) -> None:
        """Brake ``value`` of the wheel ``idx``."""
        self._set("wheel_brake", idx, value)

    def _ackermann(self, wheel: int, angle: float) -> float:
        if math.tan(angle) == 0.0:
            return 0.0
        wheels = [pose.position for pose in self._state.wheel_offsets]
        steered = range(len(wheels)) if self._steered is None else self._steered
        fixed = [p for index, p in enumerate(wheels) if index not in steered]
        rear = sum(p.x for p in fixed) / len(fixed) if fixed else 0.0
        place: Point = wheels[wheel]
        front = sum(wheels[index].x for index in steered) / len(steered)
        radius = (front - rear) / math.tan(angle)
        return math.atan2(math.copysign(place.x - rear, angle * (front - rear)), abs(radius) - _inside(place, angle))

    def _set_all(self, field: str, wheels: Sequence[int] | None, value: Callable[[int], float]) -> None:
        with self._lock:
            for wheel in range(self.get_wheel_count()) if wheels is None else wheels:
                self._set(field, wheel, value(wheel))

    def _set(self, field: str, wheel: int, value: float) -> None:
        value = float(value)
        if not self._takes(value):
            return
        with self._lock:
            values = grown(getattr(self._cmd, field), max(wheel + 1, self.get_wheel_count()), 0.0)
            values[wheel] = value
            setattr(self._cmd, field, values)


def _inside(place: Point, angle: float) -> float:
    """Offset of a wheel towards the centre of the turn, m."""
    return math.copysign(1.0, angle) * place.y
