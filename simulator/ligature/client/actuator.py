"""Handles of constraint actuators, which hold bodies; poses in the parent's frame."""

from __future__ import annotations

from ambf_msgs.msg import ActuatorCmd, ActuatorState

from ligature.client.base_object import BaseObject


class Actuator(BaseObject):
    """A constraint actuator. A hold is released when the client ends or `deactuate` is called."""

    State = ActuatorState
    Command = ActuatorCmd

    def actuate(self, body_name: str) -> None:
        """Hold a body, given by its identifier or a part of that, where it is now."""
        self._hold(body_name, sensor="")

    def actuate_from_sensor_data(self, sensor_identifier: str) -> None:
        """Hold the body that a sensor, given by its identifier, senses now."""
        self._hold("", sensor_identifier)

    def deactuate(self) -> None:
        """Let go."""
        with self._lock:
            self._cmd = ActuatorCmd()

    def _hold(self, body_name: str, sensor: str) -> None:
        command = ActuatorCmd(actuate=True, use_sensor_data=bool(sensor))
        command.body_name.data, command.sensor_identifier.data = str(body_name), str(sensor)
        with self._lock:
            self._cmd = command
