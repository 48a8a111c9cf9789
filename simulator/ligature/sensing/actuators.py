"""Constraint actuators: hold a body, rigidly or until it slips, by name, by sensor or with an offset, and let it go.

Semantics of the reference (interface reference §3.4, ADF specification §17.5): the body is held
wherever it is, without tolerance; a request while something is held changes nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.adf import Diagnostic, Severity
from ligature.model.commands import ActuatorCommand
from ligature.model.frames import pose7_matrix
from ligature.model.lookup import find_by_text
from ligature.model.scene import Scene, SensorType
from ligature.model.state import StateRecord
from ligature.model.subsystem import Subsystem
from ligature.sensing.queries import Holds
from ligature.sensing.rays import Rays

Array = NDArray[np.float64]


@dataclass
class _Hold:
    """What an actuator holds: the body and the constraint that does it."""

    body: int
    handle: Any


class Actuators(Subsystem):
    """The actuators of a scene and what each of them holds."""

    def __init__(self, scene: Scene, holds: Holds, rays: Rays) -> None:
        self._scene = scene
        self._holder = holds
        self._rays = rays
        self._holds: list[_Hold | None] = [None] * len(scene.actuators)
        self._identifiers = [body.identity.identifier for body in scene.bodies]

    @property
    def held(self) -> list[int]:
        """Body held by each actuator, -1 for none."""
        return [-1 if hold is None or not self._holder.holds(hold.handle) else hold.body for hold in self._holds]

    def apply(self, command: ActuatorCommand, body_pose: Array) -> Diagnostic | None:
        """Carry out ``command`` with bodies at ``body_pose`` (bodies, 7); what it could not do is returned."""
        if not command.actuate:
            self.release(command.actuator)
            return None
        if self.held[command.actuator] >= 0:
            return None
        try:
            body = self._body_of(command)
        except LookupError as error:
            return Diagnostic(Severity.WARNING, str(error))
        try:
            self._grasp(command, body, body_pose)
        except ValueError as error:
            return Diagnostic(Severity.WARNING, f"{self._name(command.actuator)}: {error}")
        return None

    def release(self, actuator: int) -> None:
        """Let go whatever ``actuator`` holds."""
        hold = self._holds[actuator]
        if hold is not None:
            self._holder.remove_fixed(hold.handle)
            self._holds[actuator] = None

    def write_state(self, state: StateRecord) -> None:
        """Write what every actuator holds."""
        held = np.array(self.held, dtype=np.int32)
        state["actuator_body"][0], state["actuator_active"][0] = held, held >= 0

    def reset(self) -> None:
        """Go on holding what constraints hold; threads and what pads hold were let go."""
        self._holds = [hold if hold is not None and self._holder.holds(hold.handle) else None for hold in self._holds]

    def recover(self) -> None:
        """Let go of everything."""
        for actuator in range(len(self._holds)):
            self.release(actuator)

    def snapshot(self) -> list[_Hold | None]:
        """What every actuator holds; the constraints themselves are part of the physics."""
        return self._holds

    def restore(self, snapshot: list[_Hold | None]) -> None:
        """Continue from `snapshot`."""
        self._holds = snapshot

    def _name(self, actuator: int) -> str:
        return self._scene.actuators[actuator].identity.identifier

    def _body_of(self, command: ActuatorCommand) -> int:
        """The body that a command means; raises LookupError naming what was not found."""
        name = self._name(command.actuator)
        if command.sensor is not None:
            return self._sensed(command.sensor, name)
        found = find_by_text(self._identifiers, command.body)
        if found is None:
            raise LookupError(
                f"actuator {name}: no body is called '{command.body}', or several are; "
                "give the identifier or a part of it that only one body has"
            )
        return found

    def _sensed(self, text: str, actuator: str) -> int:
        """The body that the last triggered ray of a proximity sensor hits."""
        names: Sequence[str] = [sensor.identity.identifier for sensor in self._rays.sensors]
        found = find_by_text(names, text)
        if found is None or self._rays.sensors[found].type is not SensorType.PROXIMITY:
            raise LookupError(f"actuator {actuator}: no proximity sensor is called '{text}'")
        bodies = self._rays.hits.body[self._rays.slices[found]]
        triggered = bodies[bodies >= 0]
        if not len(triggered):
            raise LookupError(f"actuator {actuator}: sensor '{text}' senses nothing")
        return int(triggered[-1])

    def _grasp(self, command: ActuatorCommand, body: int, body_pose: Array) -> None:
        actuator = self._scene.actuators[command.actuator]
        T_parent_frame = actuator.T_body_actuator
        if command.offset is None:
            T_world_frame = pose7_matrix(body_pose[actuator.parent]) @ T_parent_frame
            T_child_frame = np.linalg.inv(pose7_matrix(body_pose[body])) @ T_world_frame
        else:
            T_child_frame = self._scene.bodies[body].T_body_inertial @ pose7_matrix(np.array(command.offset))
        if actuator.slip is None:
            handle = self._holder.add_fixed(actuator.parent, body, T_parent_frame, T_child_frame)
        else:
            handle = self._holder.add_yielding(actuator.slip, actuator.parent, body, T_parent_frame, T_child_frame)
        self._holds[command.actuator] = _Hold(body, handle)
