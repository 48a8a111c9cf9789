"""The page in a real browser, used as a person uses it: what is done on it happens in the simulation."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from ligature.bus.record import Record
from ligature.cli.resimulation import resimulate
from ligature.model.commands import MarkPhase

from tests.cockpit.conftest import TIMEOUT, Person, Served, projected, tip, until
from tests.waiting import stays, steady

pytestmark = pytest.mark.timeout(600)


@pytest.fixture
def operator(served: Served, person: Person) -> Person:
    """Somebody who operates PSM1, which is enabled and homed."""
    if not person.driver.current_url.startswith(served.url) or "Give up control" not in person.text:
        person.operates_arm(served, "PSM1")
    return person


def soon(condition: Callable[[], bool], seconds: float = 2.0) -> bool:
    """Whether ``condition`` holds within some seconds."""
    with suppress(AssertionError):
        return bool(until(condition, "it holds", seconds))
    return False


def rest(served: Served) -> None:
    """Wait until PSM1 is where its last goal is."""

    goal = steady(lambda: served.arm("PSM1")["setpoint_js"][0].copy(), 0.3, 1e-6, "the goal stands", TIMEOUT)
    until(lambda: np.abs(served.arm("PSM1")["measured_js"][0] - goal).max() < 1e-4, "the arm stands", TIMEOUT)


def test_the_page_shows_scene_figures_and_cameras(served: Served, person: Person) -> None:
    person.opens(served.url)
    for text in ("suturing_small", "running", "no operator", "PSM1", "PSM2", "ECM", "DISABLED", "commands"):
        person.sees(text)
    shown = "return [...document.querySelectorAll('img')].some(i => i.naturalWidth > 400)"
    until(lambda: person.driver.execute_script(shown), "pictures of both eyes are shown")
    assert person.driver.execute_script("return document.querySelectorAll('canvas').length") >= 1
    assert not person.driver.find_elements("css selector", "[role=slider]"), "who watches has no controls"


def test_enable_and_home_work(served: Served, operator: Person) -> None:
    assert served.arm("PSM1")["operating"] == 1
    assert served.arm("PSM1")["measured_js"][0, 2] == pytest.approx(0.12, abs=2e-3)
    operator.sees("HOMED")


def test_what_the_page_records_is_simulated_again_bit_for_bit(served: Served, operator: Person, folder: Path) -> None:
    def reported(name: str, answer: str) -> bool:
        """Whether the page answers so to that name; a busy browser may lose a click, and one clicks again."""
        operator.writes("Record as", name)
        until(lambda: not operator.ticked("Record"), "the page shows that nothing is recorded")
        operator.clicks("Record")
        with suppress(AssertionError):
            until(lambda: answer in operator.text, answer, 10.0)
        return answer in operator.text

    until(lambda: reported("../mine", "'../mine' is not a valid name of a recording"), "a bad name is rejected")
    until(lambda: reported("mine", "recording to 'recordings/mine.record' from"), "what happens is recorded")
    before = served.arm("PSM1")["measured_js"][0, 0]
    operator.drags(operator.slider("yaw °"), 8)
    until(lambda: abs(served.arm("PSM1")["measured_js"][0, 0] - before) > np.deg2rad(1.0), "the arm has moved")
    until(lambda: marked(operator, "G3 push", "phase: G3 push"), "the page shows the phase")
    operator.clicks("Record")
    operator.sees("s to 'recordings/mine.record'")
    until(lambda: not operator.ticked("Record"), "the page shows that the recording has ended")
    record = Record.read(folder / "recordings" / "mine.record")
    assert "G3 push" in [command.phase for _, command in record.commands if isinstance(command, MarkPhase)]
    again = resimulate(record, None)
    assert again.state_hash() == record.end
    assert again.state["arm"][0][served.names.index("PSM1")]["homed"]
    again.close()
    operator.clicks("Record")
    operator.sees("cannot record: 'recordings/mine.record' exists already; choose another name")
    assert [path.name for path in folder.rglob("*.*")] == ["mine.record"]


def marked(operator: Person, phase: str, answer: str) -> bool:
    """Whether the page answers so when that phase is marked."""
    operator.writes("Phase", phase)
    operator.clicks("Mark the phase")
    with suppress(AssertionError):
        until(lambda: answer in operator.text, answer, 10.0)
    return answer in operator.text


def test_the_gizmo_moves_the_tip(served: Served, operator: Person) -> None:
    operator.clicks("Gizmo")
    rest(served)

    def moved() -> bool:
        """Drag along that arrow of the gizmo that is seen longest; see the slider's test for why one may drag again."""
        before = tip(served, "PSM1")
        ends = before[:3, 3] + 0.035 * before[:3, :3].T
        places = projected(served, operator, np.vstack([before[:3, 3], ends]))
        arrows = places[1:] - places[0]
        axis = int(np.argmax(np.linalg.norm(arrows, axis=1)))
        way = 40.0 * arrows[axis] / np.linalg.norm(arrows[axis])
        x, y = places[0] + 0.9 * arrows[axis]
        operator.holds_at(x, y, [tuple(way / 4)] * 4)
        operator.lets_go()
        rest(served)
        shift, along = tip(served, "PSM1")[:3, 3] - before[:3, 3], before[:3, axis]
        assert np.linalg.norm(shift - (shift @ along) * along) < 2e-3, "not aside"
        return bool(shift @ along > 0.005)

    until(moved, "the tip has moved along the arrow")


def test_a_slider_moves_the_joint(served: Served, operator: Person) -> None:
    rest(served)
    before = served.arm("PSM1")["measured_js"][0].copy()

    def moved() -> bool:
        # a browser that draws in software on a busy machine may answer too late: the arm holds, and one drags again
        operator.drags(operator.slider("yaw °"), 25)
        return soon(lambda: served.arm("PSM1")["measured_js"][0, 0] - before[0] > np.deg2rad(5.0))

    until(moved, "the joint has moved")

    def apart() -> float:
        shown = float(operator.slider("yaw °").get_attribute("aria-valuenow"))
        return abs(float(np.rad2deg(served.arm("PSM1")["measured_js"][0, 0])) - shown)

    until(lambda: apart() < 0.5, "it is where the slider is")
    assert served.arm("PSM1")["measured_js"][0, 0] - before[0] > np.deg2rad(5.0)
    assert np.abs(served.arm("PSM1")["measured_js"][0, 1:6] - before[1:6]).max() < 2e-3, "other joints stay"


def test_the_jaw_opens(served: Served, operator: Person) -> None:
    def opened() -> bool:
        operator.drags(operator.slider("jaw °"), 30)
        return soon(lambda: served.arm("PSM1")["jaw_measured_js"][0] > np.deg2rad(5.0))

    until(opened, "the jaw has opened")


def test_pause_step_and_run(served: Served, operator: Person) -> None:
    operator.clicks("Paused")
    operator.sees("paused")
    before = int(steady(lambda: served.state["update"], what="time stands"))
    operator.clicks("Step 10")
    until(lambda: int(served.state["update"]) == before + 10, "ten updates were run")
    stays(lambda: int(served.state["update"]) == before + 10, "ten updates and no more")
    operator.clicks("Paused")
    until(lambda: int(served.state["update"]) > before + 20, "time goes on")


def test_who_watches_cannot_command(served: Served, operator: Person) -> None:
    """Somebody else's browser, which does not have the operator's key; here it is another tab without it."""
    driver, first = operator.driver, operator.driver.current_window_handle
    key = driver.execute_script("const kept = {...localStorage}; localStorage.clear(); return kept")
    driver.switch_to.new_window("tab")
    try:
        operator.opens(served.url)
        operator.sees("operated")
        operator.clicks("Operate")
        operator.sees("Another browser has control")
        assert not driver.find_elements("css selector", "[role=slider]")
        assert "Give up control" not in operator.text
    finally:
        driver.execute_script("Object.assign(localStorage, arguments[0])", key)
        driver.close()
        driver.switch_to.window(first)
    assert "Give up control" in operator.text


def test_a_reload_keeps_state_and_operator(served: Served, operator: Person) -> None:
    operator.clicks("Give up control")
    operator.clicks("Operate")  # with a fresh key
    operator.sees("Give up control")
    before = served.arm("PSM1")["setpoint_js"][0].copy()
    operator.driver.refresh()
    operator.sees("Give up control")
    shown = until(lambda: operator.slider("yaw °").get_attribute("aria-valuenow"), "the slider is shown")
    assert float(shown) == pytest.approx(np.rad2deg(before[0]), abs=0.1)
    assert served.arm("PSM1")["setpoint_js"][0] == pytest.approx(before, abs=1e-4)
    assert served.arm("PSM1")["homed"]


def test_a_reset_puts_the_scene_back(served: Served, operator: Person) -> None:
    before = int(served.state["resets"])
    operator.clicks("Reset the scene")
    until(lambda: int(served.state["resets"]) == before + 1, "the scene is reset")
