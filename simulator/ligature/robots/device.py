"""A CRTK device: operating states, homing, busy flags, events and the groups of joints it drives.

Seconds of simulated time. A command that is not carried out raises `Rejected` and changes nothing.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ligature.robots.axes import Axes, Mode
from ligature.robots.operating_state import Action, OperatingState, Rejected, State, action, towards_enabled

Array = NDArray[np.float64]

POWER_UP_SECONDS = 0.2
SHORTEST_BUSY = 0.05
"""Seconds that a move is busy at least, so that clients see it begin."""

FOLLOWING_TIMEOUT = 1.0
"""Seconds for which a following error may exceed its bound before the arm stops with a fault."""


MOST_CHARACTERS = 300
"""Most characters of the reason of a fault."""

MOST_EVENTS = 500
"""Most events that are kept for a front end to fetch; the oldest go first."""


@dataclass(frozen=True)
class Event:
    """Something that happened to a device; ``name`` is the topic that reports it, ``value`` its content."""

    device: str
    name: str
    value: Any


class Device:
    """The operating state of an arm and what switches its joints on and off.

    Parameters
    ----------
    name
        ``PSM1`` and the like.
    axes
        Its joints.
    home
        Joint values (n,) of the home pose.
    following_bound
        Following errors (n,) beyond which the arm stops with a fault, when they last.
    """

    def __init__(self, name: str, axes: Axes, home: Array, following_bound: ArrayLike) -> None:
        self.name = name
        self.joints = axes
        self.time = 0.0
        self.events: deque[Event] = deque(maxlen=MOST_EVENTS)
        self._home = home
        self._following_bounds: list[float] = np.asarray(following_bound, dtype=float).tolist()
        self._state, self._homed, self._busy = State.DISABLED, False, False
        self._emitted: OperatingState | None = None
        self._pending: Action | None = None
        self._due = 0.0
        self._busy_until = 0.0
        self._homing = self._taken_over = False
        self._astray = 0.0
        self._ended = False
        self._emit_state()

    # --- operating state --------------------------------------------------------------------

    @property
    def operating_state(self) -> OperatingState:
        """State, whether homed, whether busy."""
        return OperatingState(self._state, self.is_homed, self._busy)

    @property
    def is_enabled(self) -> bool:
        """Whether the drives are on."""
        return self._state is State.ENABLED

    @property
    def is_homed(self) -> bool:
        """Whether joint values are known; an arm without power does not count as homed (as in the dVRK)."""
        return self._homed and self._state in (State.ENABLED, State.PAUSED)

    @property
    def is_busy(self) -> bool:
        """Whether a move, homing or powering up is under way."""
        return self._busy

    def enable(self) -> None:
        """Switch the drives on; takes `POWER_UP_SECONDS`."""
        self.state_command("enable")

    def disable(self) -> None:
        """Switch the drives off; the arm goes limp."""
        self.state_command("disable")

    def pause(self) -> None:
        """Hold still and take no motion until `resume`."""
        self.state_command("pause")

    def resume(self) -> None:
        """Take motion again."""
        self.state_command("resume")

    def home(self) -> None:
        """Go to the home pose, switching the drives on first where necessary; nothing when homed already."""
        self.state_command("home")

    def unhome(self) -> None:
        """Forget that the arm is homed."""
        self.state_command("unhome")

    def state_command(self, command: str) -> None:
        """Carry out one of the commands of CRTK's state machine; raises RuntimeError after `end`."""
        self._check_running()
        step = action(command, self._state)
        if step is Action.POWER_UP:
            self._power_up(step)
        elif step is Action.DISABLE:
            self._switch_off(State.DISABLED)
        elif step is Action.PAUSE:
            self._stop_moves()
            self._state, self._pending = State.PAUSED, None
        elif step is Action.RESUME:
            self._state = State.ENABLED
            self._hold_all()
        elif step is Action.HOME:
            self._begin_home()
        elif step is Action.UNHOME:
            self._homed = False
        self._emit_state(again=True)

    @property
    def is_taken_over(self) -> bool:
        """Whether a client that knows no states drives the arm, which is enabled but need not be homed."""
        return self._taken_over and self._state is State.ENABLED

    def take_over(self) -> None:
        """Be enabled at once for a client that knows no states; whether the arm is homed stays as it was.

        Raises `Rejected` in FAULT.
        """
        self._check_running()
        if self._state is State.FAULT:
            raise Rejected(f"{self.name} is in FAULT; {towards_enabled(self._state)}")
        if self._state is State.ENABLED and not self._homing and (self._homed or self._taken_over):
            return
        self._state, self._taken_over, self._pending = State.ENABLED, True, None
        self._stop_moves()
        self._hold_all()
        self._emit_state()

    def adopt(self) -> None:
        """Be enabled and homed at once, where the arm stands: for clients that know no states.

        Raises `Rejected` in FAULT.
        """
        self._check_running()
        if self._state is State.FAULT:
            raise Rejected(f"{self.name} is in FAULT; {towards_enabled(self._state)}")
        self._state, self._homed, self._pending = State.ENABLED, True, None
        self._busy = self._homing = False
        self._hold_all()
        self._emit_state()

    def end(self) -> None:
        """The simulation is closed: every command raises RuntimeError from now on, for nothing would carry it out."""
        self._ended = True

    def _check_running(self) -> None:
        if self._ended:
            raise RuntimeError(f"the simulation of {self.name} is closed; make a new one")

    def _power_up(self, then: Action) -> None:
        """Begin to switch the drives on, or continue: clients repeat a command until it takes effect."""
        if self._pending is None:
            self._due, self._busy = self.time + POWER_UP_SECONDS, True
        if self._pending is not Action.HOME:
            self._pending = then
        self.emit("desired_state", "ENABLED" if self._pending is Action.POWER_UP else "HOMED")

    def _begin_home(self) -> None:
        if self._state is State.ENABLED and self._homed:
            return
        if self._state is State.DISABLED:
            self._power_up(Action.HOME)
        elif not self._homing:
            self._move_home()

    def _move_home(self) -> None:
        self._taken_over = False
        self.joints.move(self._home)
        self.emit("desired_state", "HOMED")
        self._homing = True
        self._begin_busy()

    def _powered(self) -> None:
        """The drives are on: hold the joints, and continue with the requested command."""
        then, self._pending = self._pending, None
        self._state, self._busy = State.ENABLED, False
        self._hold_all()
        self.emit("status", f"{self.name} is powered")
        if then is Action.HOME:
            self._move_home()

    def _switch_off(self, state: State) -> None:
        self._stop_moves()
        self._state, self._pending, self._taken_over = state, None, False
        self._off_all()

    def fault(self, why: str) -> None:
        """Stop with a fault; ``disable`` ends it. A present fault is not reported again."""
        if self._state is not State.FAULT:
            self.emit("error", f"{self.name}: {why[:MOST_CHARACTERS]}")
        self._switch_off(State.FAULT)
        self._emit_state()

    def _emit_state(self, again: bool = False) -> None:
        state = self.operating_state
        if again or state != self._emitted:
            self._emitted = state
            self.emit("operating_state", [int(state.state), state.is_homed, state.is_busy])

    def emit(self, name: str, value: Any) -> None:
        """Store an event for the publisher of this arm."""
        self.events.append(Event(self.name, name, value))

    # --- groups of joints -------------------------------------------------------------------

    def _groups(self) -> tuple[Axes, ...]:
        return (self.joints,)

    def _hold_all(self) -> None:
        for axes in self._groups():
            axes.hold()

    def _off_all(self) -> None:
        for axes in self._groups():
            axes.off()

    def _stop_moves(self) -> None:
        """End moves where they are; the goal is not reached."""
        moving = [axes for axes in self._groups() if axes.moving]
        for axes in moving:
            axes.hold()
        if moving:
            self.emit("goal_reached", False)
        self._busy = self._homing = False

    def settle(self) -> None:
        """The joints were put elsewhere: moves end and the arm stays where it is now."""
        self._stop_moves()
        for axes in self._groups():
            axes.settle()
        self._emit_state()

    def _begin_busy(self) -> None:
        self._busy_until = self.time + SHORTEST_BUSY
        self._busy = True
        self._emit_state(again=True)

    # --- time -------------------------------------------------------------------------------

    def tick(self, dt: float) -> None:
        """Advance by ``dt`` seconds: moves, streams, powering up."""
        self.time += dt
        if self._pending is not None and self.time >= self._due:
            self._powered()
            self._emit_state()
        if self._state is State.ENABLED:
            self._advance(dt)

    @property
    def is_idle(self) -> bool:
        """Whether `tick` only counts time until the next command."""
        return (
            self._pending is None
            and not self._busy
            and (self._state is not State.ENABLED or all(axes.is_idle for axes in self._groups()))
        )

    def pass_idle(self, ticks: int, dt: float) -> None:
        """Count the time of ``ticks`` in which the device is idle, with the bits of as many calls of `tick`."""
        time = self.time
        for _ in range(ticks):
            time += dt
        self.time = time

    def _advance(self, dt: float) -> None:
        for axes in self._groups():
            axes.tick(dt)
        if self._busy and self.time >= self._busy_until and not any(axes.moving for axes in self._groups()):
            self._arrive()

    def _arrive(self) -> None:
        self._busy = False
        if self._homing:
            self._homing = False
            self._finish_home()
        self.emit("goal_reached", True)
        self._emit_state()

    def _finish_home(self) -> None:
        self._homed = True

    def watch(self, seconds: float) -> None:
        """Look after following errors; called every ``seconds``, seldom."""
        followed = self._followed()
        if followed is None:
            self._astray = 0.0
            return
        q, errors = followed
        if not all(map(math.isfinite, q)):
            self.fault("a joint value is not finite")
            return
        bounds = self._following_bounds
        shares = [error / bound for error, bound in zip(errors, bounds, strict=True)]
        worst = shares.index(max(shares))
        self._astray = self._astray + seconds if errors[worst] > bounds[worst] else 0.0
        if self._astray > FOLLOWING_TIMEOUT:
            self.fault(f"joint {self.joints.names[worst]} is {errors[worst]:.3g} away from its set-point")

    @property
    def is_watched(self) -> bool:
        """Whether `watch` may do something until the next command."""
        return bool(self._astray) or self._follows()

    @property
    def is_astray(self) -> bool:
        """Whether a following error was beyond its bound at the last check."""
        return bool(self._astray)

    @property
    def following_bounds(self) -> list[float]:
        """Following errors (n,) beyond which the device stops with a fault, when they last."""
        return self._following_bounds

    def _follows(self) -> bool:
        """Whether joints have a set-point to follow."""
        return self._state is State.ENABLED and self.joints.mode not in (Mode.OFF, Mode.EFFORT)

    def _followed(self) -> tuple[list[float], list[float]] | None:
        """Joint values and following errors, None where there is no set-point to follow."""
        if not self._follows():
            return None
        q = self.joints.measured()[0].tolist()  # numbers: arrays of six take longer
        return q, [abs(now - wanted) for now, wanted in zip(q, self.joints.setpoint[0].tolist(), strict=True)]

    # --- snapshots --------------------------------------------------------------------------

    _KEPT: tuple[str, ...] = (
        "time", "_state", "_homed", "_busy", "_emitted", "_pending", "_due", "_busy_until", "_homing", "_astray",
        "_taken_over",
    )  # fmt: skip

    def snapshot(self) -> dict[str, Any]:
        """Everything that lasts from tick to tick, for snapshots."""
        kept = {name: getattr(self, name) for name in self._KEPT}
        return {**kept, "groups": [axes.snapshot() for axes in self._groups()]}

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`."""
        for name in self._KEPT:
            setattr(self, name, snapshot[name])
        for axes, kept in zip(self._groups(), snapshot["groups"], strict=True):
            axes.restore(kept)
