"""The loop of the physics process: runs the simulation against the wall clock, writes every update to the bus."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import math
import time
from collections import Counter
from collections.abc import Callable, Iterable
from itertools import islice
from typing import Any

import numpy as np

from ligature.adf import Severity
from ligature.bus import Block, Mailbox, Pace, Pacer, Recording, Throttle
from ligature.bus.events import PHASE, RUN
from ligature.cli.options import RunOptions
from ligature.cli.process import Run
from ligature.cli.recorder import Recorder
from ligature.model.commands import Command, MarkPhase
from ligature.model.messages import Message, handle
from ligature.paths import printable
from ligature.process import Reported, report
from ligature.simulation import Simulation

TICK = 1e-3
LONGEST_NAP = 0.01
"""Maximum sleep in seconds between two checks for commands and signals."""

CLOCK_NAP = 1e-3
"""Sleep in seconds while the clock of a client rests: its next edge is answered that soon."""

_EVENTS = {Severity.INFO: "finding", Severity.WARNING: "warning", Severity.ERROR: "problem"}

ALARMS = ("speed", "diverged")
"""Codes of findings that `/diagnostics` repeats."""

ALARM_BYTES = 240

MOST_NOTED = 8
"""Findings a second that `/diagnostics` gets, the worst ones."""

MOST_PRINTED = 5
"""Findings a second that are printed, the worst ones."""

WINDOW = 1000
"""Updates over which the loop's figures are taken."""


def simulate(run: Run) -> None:
    """Simulate the run's scene until a signal asks for the end."""
    gc.freeze()  # what imports have made stays
    options, scene, block = run.options, run.scene, run.block
    for diagnostic in scene.diagnostics:
        if diagnostic.severity >= Severity.INFO:
            report(_EVENTS[diagnostic.severity], str(diagnostic))
    try:
        simulation = Simulation(scene, TICK, 1.0 / options.rate, options.allow_plugins)
        simulation.step(simulation.ticks_per_update)
        loop = Loop(simulation, block, options)
        loop.publish()
        if options.shown_cameras(scene):
            report("cameras")
        gc.collect()
        gc.freeze()
        gc.disable()
        _trim_memory()
        report("ready", f"{len(scene.bodies)} bodies, {len(scene.joints)} joints, {len(scene.rods)} rods")
        while not run.stop.is_set():
            loop.turn()
        loop.end()
    finally:
        block.close()


def _trim_memory() -> None:
    """Return the memory that only the start needed to the system: 12 MB, which the GNU C library would keep."""
    with contextlib.suppress(AttributeError):
        ctypes.CDLL(None).malloc_trim(0)


class Loop:
    """One turn takes commands, waits for its time, and advances one update."""

    def __init__(self, simulation: Simulation, block: Block, options: RunOptions) -> None:
        self._simulation, self._block = simulation, block
        self._recorder = Recorder(options, simulation, block)
        self._ticks = simulation.ticks_per_update
        self._period = self._ticks * TICK
        self._mailbox = Mailbox(simulation.scene, block.rings)
        self._pacer = Pacer(self._period, options.speed)
        self._handlers: dict[type[Message], Callable[[Any], None]] = {
            Throttle: self._pacer.throttle,
            Pace: self._pacer.pace,
            Recording: self._record,
            MarkPhase: self._mark_phase,
            Command: self._simulate,
        }
        self._start = self._mark = time.monotonic()
        self._durations = np.zeros(WINDOW)
        self._updates = 0
        self._mark_updates = 0
        self._warned = 0
        self._printed = Reported()

    def end(self) -> None:
        """The run is over."""
        self._recorder.end(self._updates + 1)
        self._simulation.close()

    def turn(self) -> None:
        """Sleep, take commands, and run an update when it is due; a command may pause it."""
        self._block.beat()
        nap = self._pacer.wait(time.monotonic())
        if nap > 0.0:
            time.sleep(min(nap, CLOCK_NAP if math.isinf(nap) else LONGEST_NAP))
        self._obey(self._mailbox.take())
        if self._pacer.wait(time.monotonic()) <= 0.0:
            self._update()
        self._figures()

    def _update(self) -> None:
        before = time.perf_counter()
        self._simulation.step(self._ticks)
        self.publish()
        self._durations[self._updates % WINDOW] = time.perf_counter() - before
        self._updates += 1
        self._pacer.done(time.monotonic())
        if self._updates % WINDOW == 0:
            gc.collect(0)

    def publish(self) -> None:
        """Write the newest state to the bus, with a sign of life."""
        self._block.beat()
        state = self._simulation.state
        state["wall_time"] = time.monotonic() - self._start
        state["stamp"] = time.time()
        self._block.write(state)
        for event in self._simulation.arms.events():
            self._block.events.write(*event)

    def _obey(self, messages: Iterable[Message]) -> None:
        for message in messages:
            handle(self._handlers, message)

    def _record(self, message: Recording) -> None:
        self._recorder.obey(self._updates + 1, message)

    def _mark_phase(self, mark: MarkPhase) -> None:
        self._simulate(mark)
        self._block.events.write(RUN, PHASE, mark.phase)

    def _simulate(self, command: Command) -> None:
        try:
            self._simulation.apply(command)
        except ValueError as error:
            self._mailbox.reject(error)
        else:
            self._recorder.note(self._updates + 1, command)

    def _figures(self) -> None:
        """Once a second: rates, times and counts of the loop, and what went wrong."""
        now = time.monotonic()
        span = now - self._mark
        if span < 1.0:
            return
        figures, done = self._block.figures, self._updates - self._mark_updates
        figures["loop_hz"] = done / span
        figures["real_time_factor"] = done * self._period / span
        seen = self._durations[: min(self._updates, WINDOW)]
        if len(seen):
            figures["tick_p50"], figures["tick_p99"] = np.percentile(seen, [50, 99])
            figures["tick_max"] = seen.max()
        figures["behind"] = self._pacer.lost
        for name in ("received", "coalesced", "rejected"):
            figures[name] = getattr(self._mailbox, name)
        self._mark, self._mark_updates = now, self._updates
        self._recorder.flush()
        if self._mailbox.rejected > self._warned:
            report(
                "warning",
                f"{self._mailbox.rejected - self._warned} commands rejected: {self._mailbox.last_rejection}",
            )
            self._warned = self._mailbox.rejected
        for problem in self._simulation.problems:
            if problem.code in ALARMS:
                figures["alarms"] += 1
                figures["alarm"] = printable(problem).encode("utf-8")[:ALARM_BYTES]
        self._report(now)
        self._simulation.problems.clear()

    def _report(self, now: float) -> None:
        """Note and print what went wrong, the worst first: a client may repeat what fails a thousand times a second."""
        worst = sorted(self._simulation.problems, key=lambda problem: -problem.severity)
        severities = {str(problem): problem.severity for problem in worst}
        times = Counter(map(str, worst))
        for text in reversed(list(severities)[:MOST_NOTED]):
            self._block.note(severities[text], text)
        for text in islice((text for text in severities if self._printed.is_new(text, now)), MOST_PRINTED):
            report("warning", text if times[text] == 1 else f"{text} ({times[text]} times)")
