"""Starts every process of a run, and ends it with a message if it cannot take part.

The arguments of a process are the run's options as text and the descriptor of the memory that holds the scene; it
reports to the supervisor by lines (`ligature.process`).
"""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import NoReturn

import ligature
from ligature.bus import Block, BusError
from ligature.bus.shared_scene import share_scene, shared_scene
from ligature.bus.stop import Stop, stop_on_signal
from ligature.cli.options import RunOptions
from ligature.limits import shortage
from ligature.model.scene import Scene
from ligature.model.state import state_dtype
from ligature.process import end_with_parent, report

STATE_NAP = 0.005
"""Seconds between two looks for the first state."""

END_TIMEOUT = 10.0
"""Seconds that a process which cannot continue waits for the end of the run, before it is restarted."""


@dataclass(frozen=True)
class Run:
    """The run that a process is part of: its options, its scene, its stop signal and its shared memory."""

    options: RunOptions
    scene: Scene
    stop: Stop
    block: Block

    @property
    def active(self) -> bool:
        """Whether no signal has asked for the end, and the physics process lives."""
        return not self.stop.is_set() and self.block.active

    def await_state(self) -> None:
        """Wait until the physics process has written the first state; a process that is asked to end does so."""
        while not self.block.filled:
            if self.stop.wait(STATE_NAP):
                sys.exit(0)

    def fail(self, error: Exception) -> NoReturn:
        """End the run for a reason that its user has to put right."""
        report("fatal", str(error))
        self.stop.wait(END_TIMEOUT)
        sys.exit(2)

    def decline(self, what: str, error: Exception) -> NoReturn:
        """End this process; the run continues without ``what``."""
        report("warning", f"no {what}: {error}")
        sys.exit(0)


def run_process(work: Callable[[Run], None], owner: bool = False, early: bool = False) -> None:
    """Be a process of a run: end with the parent, stop on signals, get the scene, map the shared memory, do ``work``.

    The ``owner``, which simulates, loads the scene, reports what is wrong with it and creates the shared memory; all
    others take the scene from there and wait until the first state has been written, unless they are ``early`` and
    call `Run.await_state` themselves. A process that cannot join ends with a status other than 0.
    """
    end_with_parent()
    stop = stop_on_signal()
    try:
        _join(work, stop, owner, early)
    except Exception as error:
        if not (text := shortage(error)):
            raise
        report("fatal", text)
        stop.wait(END_TIMEOUT)
        sys.exit(2)


def _join(work: Callable[[Run], None], stop: Stop, owner: bool, early: bool) -> None:
    gc.disable()  # nothing that a start makes is garbage: looking for it takes a fifth of the time
    options = RunOptions.from_text(sys.argv[1])
    try:
        run = _own(options, stop) if owner else _attached(options, stop, early)
    except ligature.SceneError as error:
        _leave(stop, owner, [str(diagnostic) for diagnostic in error.diagnostics], 2)
    except BusError as error:
        _leave(stop, owner, [str(error)], 1)
    gc.freeze()
    if not owner:
        gc.enable()
    work(run)


def _own(options: RunOptions, stop: Stop) -> Run:
    """The run of the physics process, which hands the scene to the others."""
    scene = options.load()
    run = Run(options, scene, stop, Block.create(options.bus, state_dtype(scene)))
    share_scene(int(sys.argv[2]), scene)
    return run


def _attached(options: RunOptions, stop: Stop, early: bool) -> Run:
    """The run of any other process."""
    scene = shared_scene(int(sys.argv[2]), stop.is_set)
    return Run(options, scene, stop, Block.attach(options.bus, state_dtype(scene), cancelled=stop.is_set, empty=early))


def _leave(stop: Stop, owner: bool, problems: list[str], status: int) -> NoReturn:
    """Report why this process cannot take part in the run, and end it.

    When the owner has the same problem it reports it and the run ends; others repeat it only when the run continues.
    """
    if not owner and stop.wait(END_TIMEOUT):
        sys.exit(0)
    for problem in problems:
        report("error" if owner else "warning", problem)
    sys.exit(status)
