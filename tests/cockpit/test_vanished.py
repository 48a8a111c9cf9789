"""A browser that is gone in the middle of a drag: the arm holds and reports the reason, and nothing else stops.

How soon is measured by `tests.bench.cockpit` and, on a quiet machine, by the slow test.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress

import numpy as np
import pytest

from tests.cockpit.conftest import Person, Served, somebody, until
from tests.waiting import stays

pytestmark = pytest.mark.timeout(600)

ARM = "PSM1"
REACH = 1.5
"""Radians from home to the end of the yaw slider, about: a goal gets there in as many seconds."""


class Drag(threading.Thread):
    """A drag of the yaw slider to its end, during which something happens to the browser as soon as the arm moves."""

    def __init__(self, served: Served, person: Person, happens: Callable[[list[int]], None]) -> None:
        super().__init__(daemon=True)
        self._served, self._person = served, person
        self._happens, self._processes = happens, person.processes()
        self.times: list[float] = []
        self.goals: list[float] = []
        self.happened = 0.0

    def goal(self) -> float:
        return float(self._served.arm(ARM)["setpoint_js"][0, 0])

    def run(self) -> None:
        begin, deadline = self.goal(), time.monotonic() + 60.0
        while time.monotonic() < (self.happened + 1.5 if self.happened else deadline):
            self.times.append(time.monotonic())
            self.goals.append(self.goal())
            if not self.happened and abs(self.goals[-1] - begin) > 0.05:
                self._happens(self._processes)
                self.happened = time.monotonic()
            time.sleep(0.001)

    def perform(self) -> None:
        self.start()
        slider = self._person.slider("yaw °")
        with suppress(Exception):  # the driver loses its browser, in whatever way it notices
            self._person.presses(slider, 60)
        self.join()
        assert self.happened, "the arm never moved"

    @property
    def held_after(self) -> float:
        """Seconds from what happened to the last change of the goal."""
        changed = np.flatnonzero(np.abs(np.diff(self.goals)) > 1e-9)
        return max(self.times[int(changed[-1]) + 1] - self.happened, 0.0)


def killed(processes: list[int]) -> None:
    for pid in reversed(processes):
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)


def frozen(processes: list[int]) -> None:
    for pid in processes:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGSTOP)


@pytest.fixture(scope="module")
def running() -> Iterator[Served]:
    found = Served()
    yield found
    found.end()


@pytest.fixture
def operator(running: Served) -> Iterator[Person]:
    with somebody() as person:
        person.operates_arm(running, ARM)
        yield person


def vanish(running: Served, operator: Person, happens: Callable[[list[int]], None], why: str) -> float:
    """Seconds after which the arm held."""
    drag = Drag(running, operator, happens)
    ticks = int(running.state["tick"])
    drag.perform()
    until(lambda: any(f"{ARM} holds: {why}" in line for line in running.lines), "the reason is printed")
    before = drag.goal()
    assert abs(before) < REACH - 0.2, "it did not go on to where the slider was dragged"
    stays(lambda: drag.goal() == before, "the arm holds", 0.3)
    assert int(running.state["tick"]) > ticks, "the simulation goes on"
    assert running.arm(ARM)["operating"] == 1
    return drag.held_after


def test_an_arm_holds_when_the_browser_is_killed_in_a_drag(running: Served, operator: Person) -> None:
    vanish(running, operator, killed, "the operator's browser is gone")
    with somebody() as next_:  # later viewers see it too
        next_.opens(running.url)
        next_.sees("hold: the operator's browser is gone")


@pytest.mark.slow
def test_an_arm_holds_within_a_tenth_of_a_second(running: Served, operator: Person) -> None:
    assert vanish(running, operator, killed, "the operator's browser is gone") <= 0.1


@pytest.mark.slow
def test_an_arm_holds_when_the_browser_freezes(running: Served, operator: Person) -> None:
    try:
        assert vanish(running, operator, frozen, "the operator's browser has not answered") <= 0.1
    finally:
        for pid in operator.processes():
            os.kill(pid, signal.SIGCONT)
