"""Constraint actuators: attach or grasp a body by name, by sensor or with an offset, and release it.

As in AMBF, the body is held wherever it is, without tolerance; a request while something is held changes nothing.
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
from ligature.model.state import FieldViews, StateRecord
from ligature.model.subsystem import Subsystem
from ligature.sensing.queries import Attachable
from ligature.sensing.rays import Rays

Array = NDArray[np.float64]


@dataclass
class _Attached:
    """The body that an actuator holds, and the handle of its attachment or grasp."""

    body: int
    handle: Any


class Actuators(Subsystem):
    """The actuators of a scene and what each of them holds."""

    def __init__(self, scene: Scene, bodies: Attachable, rays: Rays) -> None:
        self._scene = scene
        self._bodies = bodies
        self._rays = rays
        self._attached: list[_Attached | None] = [None] * len(scene.actuators)
        self._fields, self._written = FieldViews("actuator_body", "actuator_active"), list[int]()
        self._identifiers = [body.identity.identifier for body in scene.bodies]

    @property
    def held(self) -> list[int]:
        """Body held by each actuator, -1 for none."""
        return [-1 if attached is None or not self._lasts(attached) else attached.body for attached in self._attached]

    def _lasts(self, attached: _Attached) -> bool:
        return self._bodies.holds(attached.handle)

    def apply(self, command: ActuatorCommand, body_pose: Array) -> Diagnostic | None:
        """Carry out ``command`` with bodies at ``body_pose`` (bodies, 7); returns what went wrong."""
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
            self._hold(command, body, body_pose)
        except ValueError as error:
            return Diagnostic(Severity.WARNING, f"{self._name(command.actuator)}: {error}")
        return None

    def release(self, actuator: int) -> None:
        """Release the body that ``actuator`` holds."""
        attached = self._attached[actuator]
        if attached is not None:
            self._bodies.release(attached.handle)
            self._attached[actuator] = None

    def write_state(self, state: StateRecord) -> None:
        """Write the body that every actuator holds."""
        held, (bodies, active) = self.held, self._fields.of(state)
        if held != self._written or self._fields.fresh:
            self._written = held
            bodies[:] = held
            active[:] = bodies >= 0

    def reset(self) -> None:
        """Keep welded bodies; threads and grasped bodies were released."""
        self._attached = [attached if attached and self._lasts(attached) else None for attached in self._attached]

    def recover(self) -> None:
        """Release everything."""
        for actuator in range(len(self._attached)):
            self.release(actuator)

    def snapshot(self) -> list[_Attached | None]:
        """The body of every actuator; its attachment or grasp is part of the physics."""
        return self._attached

    def restore(self, snapshot: list[_Attached | None]) -> None:
        """Continue from `snapshot`."""
        self._attached, self._written = snapshot, []

    def _name(self, actuator: int) -> str:
        return self._scene.actuators[actuator].identity.identifier

    def _body_of(self, command: ActuatorCommand) -> int:
        """The body that a command names; raises LookupError with the name that was not found."""
        name = self._name(command.actuator)
        if command.sensor is not None:
            return self._sensed(command.sensor, name)
        found = find_by_text(self._identifiers, command.body)
        if found is None:
            raise LookupError(
                f"actuator {name}: '{command.body}' does not name exactly one body; "
                "give the identifier or a part of it that only one body has"
            )
        return found

    def _sensed(self, text: str, actuator: str) -> int:
        """The body that the last triggered ray of a proximity sensor hits."""
        names: Sequence[str] = [sensor.identity.identifier for sensor in self._rays.sensors]
        found = find_by_text(names, text)
        if found is None or self._rays.sensors[found].type is not SensorType.PROXIMITY:
            known = [n for n, s in zip(names, self._rays.sensors, strict=True) if s.type is SensorType.PROXIMITY]
            raise LookupError(
                f"actuator {actuator}: no proximity sensor is called '{text}'; "
                f"the scene has {', '.join(known) or 'none'}"
            )
        bodies = self._rays.hits.body[self._rays.slices[found]]
        triggered = bodies[bodies >= 0]
        if not len(triggered):
            raise LookupError(f"actuator {actuator}: sensor '{text}' detects nothing; bring it nearer to a body")
        return int(triggered[-1])

    def _hold(self, command: ActuatorCommand, body: int, body_pose: Array) -> None:
        actuator = self._scene.actuators[command.actuator]
        T_parent_frame = actuator.T_body_actuator
        if command.offset is None:
            T_world_frame = pose7_matrix(body_pose[actuator.parent]) @ T_parent_frame
            T_child_frame = np.linalg.inv(pose7_matrix(body_pose[body])) @ T_world_frame
        else:
            T_child_frame = self._scene.bodies[body].T_body_inertial @ pose7_matrix(np.array(command.offset))
        if actuator.slip is None:
            handle = self._bodies.attach(actuator.parent, body, T_parent_frame, T_child_frame)
        else:
            handle = self._bodies.grasp(actuator.slip, actuator.parent, body, T_parent_frame, T_child_frame)
        self._attached[command.actuator] = _Attached(body, handle)
