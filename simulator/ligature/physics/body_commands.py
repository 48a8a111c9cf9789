"""Cartesian commands of bodies: which there are, and which bodies they move against all forces.

World axes, SI units.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.model.commands import CommandType
from ligature.physics.bodies import BodyControl
from ligature.physics.engine import Engine

Array = NDArray[np.float64]


class BodyCommands:
    """The commands of the bodies of an engine, and the fingers that are stopped on a thread.

    Attributes
    ----------
    drives
        (bodies,) what `driven` says of each body.
    """

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._controls: dict[int, BodyControl] = {}
        self._stopped: set[int] = set()
        self.drives, self._pushable = (np.full(len(engine.scene.bodies), value) for value in (False, True))

    def take(self, body: int, type_: CommandType, target: Array) -> None:
        """Take a command; it holds until the next one or `clear`."""
        control = self._controls.get(body)
        if control is None:
            control = self._controls[body] = BodyControl(self._engine.place_of[body], self._engine.dt)
        control.set(type_, target)
        self._sort(body)

    def clear(self, body: int) -> None:
        """Forget the command of a body."""
        self._controls.pop(body, None)
        self._sort(body)

    @property
    def all(self) -> list[tuple[int, BodyControl]]:
        """Bodies with a command, and the controllers that follow it."""
        return list(self._controls.items())

    def set_stopped(self, fingers: Collection[int], stopped: bool) -> None:
        """Record that ``fingers`` are stopped on a thread, which cannot move them, or no longer."""
        self._stopped = self._stopped | set(fingers) if stopped else self._stopped - set(fingers)
        for finger in fingers:
            self._sort(finger)

    def driven(self, body: int) -> bool:
        """Whether a command sets the velocity of a body, so that a thread, however light the body, does not."""
        return bool(self.drives[body])

    def pushable(self, body: int) -> bool:
        """Whether an impulse moves a body: the joint of a stopped finger bears it."""
        return bool(self._pushable[body])

    def _sort(self, body: int) -> None:
        """Note what `driven` and `pushable` say of a body: they are asked in every tick."""
        control, stopped = self._controls.get(body), body in self._stopped
        moved = control is not None and control.sets_velocity
        self.drives[body], self._pushable[body] = stopped or moved, stopped or not moved

    def _sort_all(self) -> None:
        """The same of all bodies."""
        self.drives[:], self._pushable[:] = False, True
        for body in {*self._controls, *self._stopped}:
            self._sort(body)

    def wrench(self, body: int) -> Array:
        """The wrench (6,) that a command applies to a body; zero for any other command."""
        control = self._controls.get(body)
        forced = control is not None and control.type is CommandType.FORCE
        return control.target.copy() if control is not None and forced else np.zeros(6)

    def act(self, bodies: set[int]) -> bool:
        """Whether a command does anything to one of ``bodies``."""
        controls = (self._controls.get(body) for body in bodies)
        return any(control is not None and control.acts for control in controls)

    def restart(self) -> None:
        """Take all commands as if they came now; no finger is stopped."""
        before, self._controls, self._stopped = self._controls, {}, set()
        self._sort_all()
        for body, command in before.items():
            self.take(body, command.type, command.target.copy())

    def snapshot(self) -> dict[str, Any]:
        """What lasts from tick to tick."""
        controls = {body: control.snapshot() for body, control in self._controls.items()}
        return {"controls": controls, "stopped": self._stopped}

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`."""
        self._controls, self._stopped = {}, snapshot["stopped"]
        for body, state in snapshot["controls"].items():
            control = self._controls[body] = BodyControl(self._engine.place_of[body], self._engine.dt)
            control.restore(state)
        self._sort_all()
