"""The arms of a running scene by name: commands, ticks, states and events."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.adf import Diagnostic
from ligature.arms.courses import WATCH_PERIOD, Courses
from ligature.arms.ecm import build_ecm
from ligature.arms.mtm import build_mtm
from ligature.arms.psm import build_psm
from ligature.arms.records import ArmRecords
from ligature.model.lookup import UnknownNameError
from ligature.model.scene import ArmKind, Scene
from ligature.model.state import StateRecord
from ligature.model.subsystem import ALWAYS, Subsystem
from ligature.physics import World
from ligature.robots.arm import Arm
from ligature.robots.commands import ArmCommand
from ligature.robots.mtm_arm import MtmArm
from ligature.robots.operating_state import Rejected

Integers = NDArray[np.int64]

_BUILDERS = {ArmKind.PSM: build_psm, ArmKind.ECM: build_ecm, ArmKind.MTM: build_mtm}


class ArmSet(Subsystem, Mapping[str, Arm]):
    """The arms of a running scene by name.

    Parameters
    ----------
    scene
        The scene with the arms.
    world
        The rigid bodies whose joints the arms drive.
    dt
        Length of a tick in seconds.

    Raises
    ------
    UnknownNameError
        If an arm is asked for that the scene does not have; the message lists the arms.
    """

    def __init__(self, scene: Scene, world: World, dt: float = 1e-3) -> None:
        self._world, self._dt = world, dt
        self.problems: list[Diagnostic] = []
        self._arms: list[Arm] = []
        for description in scene.arms:
            self._arms.append(_BUILDERS[description.kind](scene, world, description, self.problems))
        self._by_name = {arm.name: arm for arm in self._arms}
        self._masters = [(m, arm) for m, arm in enumerate(self._arms) if isinstance(arm, MtmArm)]
        self._records, self._courses = ArmRecords(self._arms), Courses(self._arms)

    def __getitem__(self, name: str) -> Arm:
        if name not in self._by_name:
            known = ", ".join(self._by_name) or "none"
            raise UnknownNameError(f"unknown arm '{name}'; choose one of {known}")
        return self._by_name[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._by_name)

    def __len__(self) -> int:
        return len(self._arms)

    def apply(self, command: ArmCommand) -> None:
        """Carry out a command; what the arm rejects becomes its warning, whatever else it raises its FAULT."""
        arm = self._arms[command.arm]
        try:
            command.carry_out(arm)
        except Rejected as error:
            arm.emit("warning", str(error))
            if command.moves:
                arm.emit("goal_reached", False)
        except Exception as error:  # no command ends a run
            arm.fault(f"{command.verb} failed: {_words(error)}")

    def _guarded(self, what: str, arm: Arm, act: Callable[..., None], *arguments: Any) -> None:
        """Call a method of an arm; an exception puts the arm in FAULT, and the other arms continue."""
        try:
            act(*arguments)
        except Exception as error:
            self._fault(what, arm, error)

    def _fault(self, what: str, arm: Arm, error: Exception) -> None:
        arm.fault(f"{what} failed: {_words(error)}")

    def end(self) -> None:
        """The simulation is closed: the arms take no more commands."""
        for arm in self._arms:
            arm.end()

    def release(self, index: int) -> None:
        """The client that commanded an arm is gone: the arm holds its position."""
        arm = self._arms[index]
        if arm.is_taken_over:
            self._guarded("hold", arm, arm.direct, "hold")
        elif arm.is_enabled and arm.is_homed:
            self._guarded("hold", arm, arm.hold)

    def step(self, tick: int) -> None:
        """Advance all arms by a tick."""
        for arm in self._arms:
            try:  # here and not in `_guarded`: it is done every tick
                arm.tick(self._dt)
            except Exception as error:
                self._fault("motion", arm, error)
        if (tick + 1) % WATCH_PERIOD == 0:
            for arm in self._arms:
                self._guarded("following-error check", arm, arm.watch, WATCH_PERIOD * self._dt)

    def idle_ticks(self, tick: int) -> int:
        """Always while all arms stay at their set-points, as long as compiled code finds that none `strays`.

        While an arm is away from its set-point, the ticks until it is checked.
        """
        if not all(arm.is_idle for arm in self._arms):
            return 0
        left = WATCH_PERIOD - 1 - tick % WATCH_PERIOD
        return ALWAYS if self._courses.watch(left) else left

    @property
    def course_table(self) -> Integers:
        """What `strays` takes; empty without arms."""
        return self._courses.table

    def pass_idle(self, ticks: int) -> None:
        """Count the time of all arms."""
        for arm in self._arms:
            arm.pass_idle(ticks, self._dt)

    def write_state(self, state: StateRecord) -> None:
        """Write the state of all arms."""
        if self._arms:
            felt = self._world.wrenches.felt()
            for m in self._records.stale(state, felt):
                try:
                    self._records.look(m, felt)
                except Exception as error:
                    self._fault("write_state", self._arms[m], error)
            motions = self._world.engine.motions
            motions.prepare()
            if self._records.write(motions.handle, motions.table):
                for m, master in self._masters:
                    state["arm"]["gravity_jf"][0, m] = master.gravity_jf()

    def take_problems(self) -> list[Diagnostic]:
        """What was found since the last call."""
        found, self.problems = self.problems, []
        return found

    def events(self) -> list[tuple[int, str, Any]]:
        """What happened since the last call: number of the arm, name and value."""
        found = []
        for index, arm in enumerate(self._arms):
            found += [(index, event.name, event.value) for event in arm.events]
            arm.events.clear()
        return found

    def reset(self) -> None:
        """The scene was reset: moves end, and arms hold their present positions."""
        for arm in self._arms:
            self._guarded("reset", arm, arm.settle)

    def snapshot(self) -> list[dict[str, Any]]:
        """Everything that lasts from tick to tick."""
        return [arm.snapshot() for arm in self._arms]

    def restore(self, snapshot: Sequence[dict[str, Any]]) -> None:
        """Continue from `snapshot`."""
        for arm, state in zip(self._arms, snapshot, strict=True):
            arm.restore(state)
        self._records, self._courses = ArmRecords(self._arms), Courses(self._arms)


def _words(error: Exception) -> str:
    """The message of an exception, with its type unless the arm itself raised it."""
    return str(error) if isinstance(error, Rejected) else f"{type(error).__name__}: {error}"
