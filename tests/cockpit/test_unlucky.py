"""What befalls a page: frozen processes, and a network that is late and loses packets. The simulation goes on."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from ligature.cockpit.pursuit import LINEAR

from tests.cockpit.conftest import Served, tip, until
from tests.cockpit.wired import Wired
from tests.network import THERE, bad_network
from tests.waiting import stays, steady

pytestmark = pytest.mark.timeout(300)

ARM = "PSM1"
UP = 1
TOKEN = "a token of a test, long enough"


@pytest.fixture(scope="module")
def running() -> Iterator[Served]:
    found = Served()
    yield found
    found.end()


@pytest.fixture(scope="module")
def operator(running: Served) -> Iterator[Wired]:
    found = Wired(running.url)
    found.starts()
    steady(lambda: tip(running, ARM).copy(), 0.5, 1e-6, "the arm stands")
    yield found
    found.goes()


def children() -> list[list[str]]:
    """All processes: number, parent's number, command."""
    listing = subprocess.run(["ps", "-wweo", "pid,ppid,args"], capture_output=True, text=True, check=True).stdout
    return [line.split(None, 2) for line in listing.splitlines()[1:]]


def physics_process(running: Served) -> int:
    """Physics."""
    ours = [(int(pid), words) for pid, parent, words in children() if int(parent) == running.process.pid]
    return next(pid for pid, words in ours if "ligature.cli.physics" in words)


def page_processes(running: Served) -> tuple[int, int]:
    """The page's process, and the one that draws its pictures."""
    rows = children()
    page = next(
        int(pid) for pid, parent, words in rows if int(parent) == running.process.pid and "cockpit_process" in words
    )
    return page, next(int(pid) for pid, parent, _ in rows if int(parent) == page)


@contextmanager
def stopped(pid: int) -> Iterator[None]:
    os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(pid, signal.SIGCONT)


def test_physics_goes_on_and_the_arm_stands_while_the_page_is_frozen(running: Served, operator: Wired) -> None:
    page, _ = page_processes(running)
    begin = tip(running, ARM)
    operator.holds(UP, 1.0)
    until(lambda: np.linalg.norm((tip(running, ARM) - begin)[:3, 3]) > 0.003, "the tip moves")
    with stopped(page):
        stood = steady(lambda: tip(running, ARM).copy(), 0.5, 1e-6, "the arm stands")
        before = float(running.state["sim_time"])
        until(lambda: float(running.state["sim_time"]) > before + 2.0, "time goes on", 60.0)
        assert np.abs(tip(running, ARM) - stood).max() < 1e-6
    operator.holds(UP, 0.0)
    after = steady(lambda: tip(running, ARM).copy(), 0.5, 1e-6, "it stands when the key is up")
    # what was held while the page was frozen, and what had been sent meanwhile, does not add up to a leap
    assert np.linalg.norm((after - stood)[:3, 3]) < 0.02
    operator.holds(UP, -1.0)
    until(lambda: np.linalg.norm((tip(running, ARM) - after)[:3, 3]) > 0.003, "the page hears its operator again")
    operator.holds(UP, 0.0)


def test_an_arm_keeps_its_speed_while_physics_is_held_up(running: Served, operator: Wired) -> None:
    """Goals move in simulated time: what physics missed does not wait for it as a leap."""
    operator.orders("speed", "fast")
    operator.holds(UP, 1.0)
    begin = tip(running, ARM)
    until(lambda: np.linalg.norm((tip(running, ARM) - begin)[:3, 3]) > 0.003, "the tip moves")
    samples: list[np.ndarray] = []
    way = 1.0
    for _ in range(4):
        with stopped(physics_process(running)):
            time.sleep(0.4)
        deadline = time.monotonic() + 0.4
        while time.monotonic() < deadline:
            samples.append(np.append(tip(running, ARM)[:3, 3], float(running.state["sim_time"])))
            time.sleep(0.005)
        way = -way
        operator.holds(UP, way)
    operator.holds(UP, 0.0)
    operator.orders("speed", "normal")
    found = np.array(samples)
    later = np.searchsorted(found[:, 3], found[:, 3] + 0.1)
    pairs = np.flatnonzero(later < len(found))
    assert len(pairs) > 20
    away = np.linalg.norm(found[later[pairs], :3] - found[pairs, :3], axis=1)
    speed = away / (found[later[pairs], 3] - found[pairs, 3])
    assert 0.5 * LINEAR < speed.max() < 1.6 * LINEAR, "goals come at turns of the page's loop"


def test_hands_work_while_the_drawing_of_pictures_is_frozen(running: Served, operator: Wired) -> None:
    _, pictures = page_processes(running)
    until(lambda: operator.pictures > 3, "pictures come")
    with stopped(pictures):
        before, begin = int(steady(lambda: operator.pictures, 1.0, what="pictures on the way")), tip(running, ARM)
        operator.holds(UP, -1.0)
        until(lambda: np.linalg.norm((tip(running, ARM) - begin)[:3, 3]) > 0.003, "the tip moves")
        operator.holds(UP, 0.0)
        stays(lambda: operator.pictures <= before + 1, "there are no pictures", 1.0)
    until(lambda: operator.pictures > before + 3, "pictures come again")


def test_nothing_is_drawn_for_a_browser_that_nobody_sees(running: Served, operator: Wired) -> None:
    until(lambda: operator.pictures > 0, "pictures come")
    operator.orders("view", [False, 0, False])
    before = int(steady(lambda: operator.pictures, 1.0, what="pictures on the way"))
    stays(lambda: operator.pictures == before, "no pictures", 1.5)
    operator.orders("view", [False, 240, False])
    until(lambda: operator.pictures > before + 2, "pictures come again")


def test_a_page_over_a_bad_network_is_slower_and_safe(monkeypatch: pytest.MonkeyPatch) -> None:
    """50 ms each way and 2 % loss: the arm follows, and stands when the network is gone."""
    monkeypatch.setenv("LIGATURE_COCKPIT_TOKEN", TOKEN)
    with bad_network(0.05, 0.02) as far:
        served = Served("--at", f"{THERE}:8080", prefix=far.prefix)
        try:
            operator = Wired(f"http://{THERE}:8080", TOKEN)
            operator.starts(120.0)
            begin = np.asarray(steady(lambda: tip(served, ARM).copy(), 0.5, 1e-6, "the arm stands"))
            operator.holds(UP, 1.0)
            until(lambda: np.linalg.norm((tip(served, ARM) - begin)[:3, 3]) > 0.01, "the tip moves")
            moved = tip(served, ARM) - begin
            operator.holds(UP, 0.0)
            stood = np.asarray(steady(lambda: tip(served, ARM).copy(), 1.0, 1e-6, "it stands when the key is up"))
            assert np.linalg.norm((stood - begin - moved)[:3, 3]) < 0.04, "soon"
            until(lambda: operator.pictures > 3, "pictures come")
            operator.holds(UP, -1.0)
            until(lambda: np.linalg.norm((tip(served, ARM) - stood)[:3, 3]) > 0.003, "it moves again")
            os.kill(far.link, signal.SIGSTOP)  # the network is gone
            steady(lambda: tip(served, ARM).copy(), 0.5, 1e-6, "the arm stands without its operator")
            assert served.arm(ARM)["operating"] == 1
        finally:
            served.end()
