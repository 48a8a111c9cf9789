"""The first minute and the hands of a person with a real browser: one button, keys, a game pad, drags, hints, help."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from ligature.cockpit.hands import Sightline
from PIL import Image
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.keys import Keys

from tests.cockpit.conftest import Person, Served, tip, until
from tests.waiting import stays, steady

pytestmark = pytest.mark.timeout(600)

ARMS = ("PSM1", "PSM2")
SIZE = (
    "const i = document.getElementById('lig-image'); return i.naturalHeight ? [i.naturalWidth, i.naturalHeight] : null"
)


def sight(served: Served) -> Sightline:
    """How the endoscope looks."""
    return Sightline.of(served.scene.cameras[0], served.state["camera_world"][0])


def ready(served: Served) -> bool:
    return all(served.arm(name)["homed"] and not served.arm(name)["busy"] for name in ARMS)


def element(person: Person, identity: str) -> Any:
    return until(lambda: next(iter(person.driver.find_elements("id", identity)), None), identity)


def shown(person: Person, identity: str) -> bool:
    return any(one.is_displayed() for one in person.driver.find_elements("id", identity))


def presses(person: Person, identity: str) -> None:
    until(lambda: shown(person, identity), f"{identity} is shown")
    person.driver.execute_script("arguments[0].click()", element(person, identity))


def standing(served: Served, name: str = "PSM1") -> np.ndarray:
    return np.asarray(steady(lambda: tip(served, name).copy(), 0.5, 1e-6, "the arm stands"))


def held(
    press: Callable[[], Any], release: Callable[[], Any], happens: Callable[[], Any], what: str | Callable[[], str]
) -> None:
    """Press, wait until something has happened, let go.

    On a slow machine the page may let the arm go before, because the browser was silent; a person then presses again.
    """
    for left in reversed(range(4)):
        press()
        try:
            until(happens, what, 25.0)
            return
        except AssertionError:
            if not left:
                raise
        finally:
            release()


def holds(person: Person, key: str, happens: Callable[[], Any], what: str, shift: bool = False) -> None:
    """Hold a key until something has happened."""

    def press() -> None:
        chain = ActionChains(person.driver)
        (chain.key_down(Keys.SHIFT) if shift else chain).key_down(key).perform()

    def release() -> None:
        chain = ActionChains(person.driver).key_up(key)
        (chain.key_up(Keys.SHIFT) if shift else chain).perform()

    held(press, release, happens, what)


@pytest.fixture
def operator(served: Served, person: Person) -> Person:
    """Somebody who has pressed Start; the camera's picture is small."""
    if not person.driver.current_url.startswith(served.url):
        person.opens(served.url)
        presses(person, "lig-start")
    until(lambda: ready(served), "instruments are ready")
    until(lambda: shown(person, "lig-arm"), "hands are free")
    standing(served)
    return person


@pytest.fixture
def in_view(served: Served, operator: Person) -> Person:
    """The operator, with tips in the picture: on a slow machine a key or a stick that is let go late moves them out."""

    def seen() -> bool:
        return all(np.abs(sight(served).place(tip(served, name)[:3, 3])).max() < 0.5 for name in ARMS)

    if not seen():
        operator.clicks("Give up control")
        presses(operator, "lig-start")
        until(seen, "tips are in the picture")
        standing(served)
    return operator


def test_one_button_takes_control_powers_homes_and_brings_into_view(served: Served, person: Person) -> None:
    person.opens(served.url)
    until(lambda: shown(person, "lig-welcome"), "there is one thing to do")
    presses(person, "lig-start")
    person.sees("Give up control")
    until(lambda: ready(served), "instruments are powered and homed")
    until(lambda: not shown(person, "lig-welcome"), "the question goes away")
    for name in ARMS:
        until(lambda name=name: np.abs(sight(served).place(tip(served, name)[:3, 3])).max() < 0.5, f"{name} is seen")
    until(lambda: "hold W A S D" in element(person, "lig-hint").text, "a hint says what to do next")


def test_a_key_moves_the_tip_as_long_as_it_is_held(served: Served, operator: Person) -> None:
    begin = standing(served)
    holds(operator, "d", lambda: np.linalg.norm((tip(served, "PSM1") - begin)[:3, 3]) > 0.004, "the tip moves")
    end = standing(served)
    stays(lambda: np.abs(tip(served, "PSM1") - end).max() < 1e-6, "it stands when the key is up", 0.5)
    holds(operator, "a", lambda: np.linalg.norm((tip(served, "PSM1") - end)[:3, 3]) > 0.004, "it goes back")
    way, back = (end - begin)[:3, 3], (standing(served) - end)[:3, 3]
    assert way @ back < -0.95 * np.linalg.norm(way) * np.linalg.norm(back)
    assert end[:3, :3] == pytest.approx(begin[:3, :3], abs=2e-3), "it does not turn"


def test_shift_turns_the_tip_and_x_opens_the_jaw(served: Served, operator: Person) -> None:
    begin = standing(served)
    holds(operator, "e", lambda: bool(np.trace(tip(served, "PSM1")[:3, :3].T @ begin[:3, :3]) < 2.98), "it turns", True)
    assert standing(served)[:3, 3] == pytest.approx(begin[:3, 3], abs=1e-3), "where it is"
    before = float(served.arm("PSM1")["jaw_setpoint_js"][0])
    holds(operator, "x", lambda: served.arm("PSM1")["jaw_setpoint_js"][0] > before + 0.1, "the jaw opens")
    jaw = float(steady(lambda: np.array(served.arm("PSM1")["jaw_setpoint_js"][0]), 0.5, 1e-6, "the jaw stands"))
    assert jaw < 1.3, "it does not go on to its end"


def test_keys_in_a_field_are_text(served: Served, operator: Person) -> None:
    begin = standing(served)
    operator.writes("Record as", "wasd")
    stays(lambda: np.abs(tip(served, "PSM1") - begin).max() < 1e-6, "nothing moves", 0.5)


def test_arrow_keys_step_a_slider_by_a_degree(served: Served, operator: Person) -> None:
    slider = operator.slider("roll °")
    until(lambda: slider.is_displayed() and slider.get_attribute("aria-disabled") != "true", "the slider can be moved")
    before = float(served.arm("PSM1")["setpoint_js"][0, 3])
    for _ in range(5):
        slider.send_keys(Keys.ARROW_RIGHT)
    until(lambda: served.arm("PSM1")["setpoint_js"][0, 3] - before > np.deg2rad(3.0), "the joint moves")
    standing(served)
    assert 3.5 < np.rad2deg(served.arm("PSM1")["setpoint_js"][0, 3] - before) < 6.5


def test_n_takes_the_next_arm(served: Served, operator: Person) -> None:
    before = element(operator, "lig-arm").text
    ActionChains(operator.driver).send_keys("n").perform()
    until(lambda: element(operator, "lig-arm").text not in ("", before), "another arm is selected")
    ActionChains(operator.driver).send_keys("n").perform()
    until(lambda: element(operator, "lig-arm").text == before, "and the first again")


def test_a_finger_on_the_buttons_moves_the_tip_until_it_is_lifted(served: Served, operator: Person) -> None:
    presses(operator, "lig-pad-button")
    begin = standing(served)
    until(lambda: shown(operator, "lig-pad"), "the buttons are shown")
    box = operator.driver.execute_script(
        "const r = document.querySelector('#lig-pad [aria-label=\"up\"]').getBoundingClientRect();"
        "return {x: r.x + r.width / 2, y: r.y + r.height / 2}"
    )

    def touch(kind: str, *places: Any) -> None:
        operator.driver.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": kind, "touchPoints": list(places)})

    try:
        held(
            lambda: touch("touchStart", box), lambda: touch("touchEnd"),
            lambda: np.linalg.norm((tip(served, "PSM1") - begin)[:3, 3]) > 0.004, "the tip moves",
        )  # fmt: skip
    finally:
        presses(operator, "lig-pad-button")
    end = standing(served)
    assert end[:3, :3] == pytest.approx(begin[:3, :3], abs=2e-3), "it does not turn"


def test_both_eyes_stand_side_by_side(operator: Person) -> None:
    shape = "const i = document.getElementById('lig-image'); return i && i.naturalHeight ? i.naturalWidth / i.naturalHeight : 0"
    presses(operator, "lig-swap")
    try:
        until(lambda: 0.0 < float(operator.driver.execute_script(shape)) < 2.0, "one eye")
        alone = float(operator.driver.execute_script(shape))
        presses(operator, "lig-eyes")
        until(lambda: operator.driver.execute_script(shape) > 1.9 * alone, "both eyes are twice as wide")
        presses(operator, "lig-eyes")
        until(lambda: operator.driver.execute_script(shape) < 1.1 * alone, "one again")
    finally:
        presses(operator, "lig-swap")


def test_what_is_near_can_be_cut_away(operator: Person) -> None:
    """Cut as far as the slider goes, the 3D view shows less of the scene than before, and all of it again after."""

    def seen() -> np.ndarray:
        box = operator.driver.find_element("css selector", "canvas[data-engine]")
        return np.asarray(Image.open(io.BytesIO(box.screenshot_as_png)).convert("RGB"), dtype=float)

    whole = seen()
    thumb = operator.slider("Cut away mm")
    thumb.send_keys(Keys.END)
    until(lambda: np.abs(seen() - whole).mean() > 3.0, "something is cut away", every=1.0)
    thumb.send_keys(Keys.HOME)
    until(lambda: np.abs(seen() - whole).mean() < 1.0, "it is whole again", every=1.0)


def test_a_game_pad_moves_the_tip(served: Served, operator: Person) -> None:
    begin = standing(served)
    operator.driver.execute_script(
        "const b = Array.from({length: 16}, () => ({value: 0, pressed: false}));"
        "window.stick = [0, 0, 0, 0]; navigator.getGamepads = () => [{connected: true, axes: window.stick, buttons: b}]"
    )

    def stick(axes: str) -> Callable[[], Any]:
        return lambda: operator.driver.execute_script(f"window.stick = {axes}")

    held(
        stick("[0, 0.9, 0.05, 0]"), stick("[0.1, -0.1, 0.1, 0]"),
        lambda: np.linalg.norm((tip(served, "PSM1") - begin)[:3, 3]) > 0.003, "the stick moves the tip",
    )  # fmt: skip
    end = standing(served)
    assert end[:3, :3] == pytest.approx(begin[:3, :3], abs=2e-3), "a stick at rest is never quite in the middle"
    operator.driver.execute_script("delete navigator.getGamepads")


class Picture:
    """The large picture as it stands in the window, of one eye or of both side by side; places in pixels."""

    def __init__(self, served: Served, person: Person, eyes: int) -> None:
        self._served, self._person = served, person
        until(lambda: self._eyes == eyes, f"the picture of {eyes} eyes is large")
        box = person.driver.execute_script(
            "const r = document.getElementById('lig-image').getBoundingClientRect(); return [r.x, r.y, r.width, r.height]"
        )
        # the picture fits its box as a whole
        wide, high = until(lambda: person.driver.execute_script(SIZE), "the size of the picture")
        self._high = min(box[3], box[2] * high / wide)
        left = box[0] + box[2] / 2 - 0.5 * (eyes - 1) / eyes * self._high * wide / high
        self._middle, self._view = np.array([left, box[1] + box[3] / 2]), sight(served)

    @property
    def _eyes(self) -> int:
        width, height = self._served.scene.cameras[0].resolution
        wide, high = self._person.driver.execute_script(SIZE) or (0, 1)
        return round(wide / high * height / width)

    def place(self, pose: np.ndarray) -> np.ndarray:
        """Where a tip (4, 4) is seen by the left eye."""
        return self._middle + self._view.place(pose[:3, 3]) * self._high * [1, -1]

    def inwards(self, right: float, down: float) -> np.ndarray:
        """A place so far from the tip, towards the picture's middle."""
        here = self.place(standing(self._served))
        return np.asarray(here - np.copysign([right, down], here - self._middle))

    def depth(self, pose: np.ndarray) -> float:
        return self._view.depth(pose[:3, 3])

    def drags_to(self, goal: np.ndarray) -> None:
        """Take the tip where it is seen, drag it to ``goal``, and keep hold of it."""
        here = self.place(tip(self._served, "PSM1"))
        self._person.holds_at(*here, [tuple(0.25 * (goal - here)), tuple(0.75 * (goal - here))])

    def found(self) -> str:
        """What a reader of a failure wants to know: where the tip is, what lies there in the window, what the arm does."""
        here, arm = self.place(tip(self._served, "PSM1")), self._served.arm("PSM1")
        lies = self._person.driver.execute_script(
            "const e = document.elementFromPoint(arguments[0], arguments[1]);"
            "return e ? `${e.tagName} ${e.id} ${e.textContent.slice(0, 80)}` : 'nothing'", *map(float, here),
        )  # fmt: skip
        doing = {name: arm[name].tolist() for name in ("operating", "homed", "busy")}
        return f"at {here} over {lies}; PSM1 {doing}; {self._served.lines[-3:]}"

    def there(self, goal: np.ndarray) -> bool:
        """Whether the tip is seen at ``goal``."""
        return bool(np.abs(self.place(tip(self._served, "PSM1")) - goal).max() < 4.0)


def test_a_drag_in_the_picture_takes_the_tip_along(served: Served, in_view: Person) -> None:
    operator = in_view
    presses(operator, "lig-swap")
    try:
        picture, begin = Picture(served, operator, 1), standing(served)
        goal = picture.inwards(40.0, 30.0)
        # the arm follows while the pointer is held, however slow the machine is
        held(
            lambda: picture.drags_to(goal), operator.lets_go, lambda: picture.there(goal),
            lambda: f"the tip is at {goal}, not {picture.found()}",
        )  # fmt: skip
        end = standing(served)
        assert picture.there(goal), "and stays there"
        assert picture.depth(end) == pytest.approx(picture.depth(begin), abs=1e-3)
    finally:
        presses(operator, "lig-swap")


def test_a_picture_of_other_eyes_does_not_move_what_is_dragged(served: Served, in_view: Person) -> None:
    operator = in_view
    presses(operator, "lig-swap")
    presses(operator, "lig-eyes")
    try:
        picture = Picture(served, operator, 2)
        goal = picture.inwards(20.0, 15.0)

        def turns_one_eye_off() -> bool:
            if not picture.there(goal):
                return False
            presses(operator, "lig-eyes")
            try:
                Picture(served, operator, 1)
                ActionChains(operator.driver).move_by_offset(1, 0).perform()
                stays(lambda: picture.there(goal), "the tip stays where it was dragged to", 1.0)
            finally:
                presses(operator, "lig-eyes")
            return True

        held(lambda: picture.drags_to(goal), operator.lets_go, turns_one_eye_off, picture.found)
    finally:
        presses(operator, "lig-eyes")
        presses(operator, "lig-swap")


def test_hints_go_away_for_good(served: Served, operator: Person) -> None:
    operator.driver.execute_script("localStorage.removeItem('ligature_hints')")
    operator.driver.refresh()
    operator.sees("Give up control")
    until(lambda: shown(operator, "lig-hints"), "a hint is shown")
    presses(operator, "lig-hints-off")
    until(lambda: not shown(operator, "lig-hints"), "it goes")
    operator.driver.refresh()
    operator.sees("Give up control")
    until(lambda: shown(operator, "lig-arm"), "the page is there")
    stays(lambda: not shown(operator, "lig-hints"), "and does not come back", 1.0)


def test_a_question_mark_shows_all_keys_and_escape_ends_it(operator: Person) -> None:
    ActionChains(operator.driver).send_keys("?").perform()
    until(lambda: shown(operator, "lig-help"), "the help is open")
    for words in ("move the tip left, right", "Game pad", "Behind the clock"):
        assert words in element(operator, "lig-help").text
    inside = "return document.getElementById('lig-help').contains(document.activeElement)"
    assert operator.driver.execute_script(inside), "the focus is in it"
    ActionChains(operator.driver).send_keys(Keys.ESCAPE).perform()
    until(lambda: not shown(operator, "lig-help"), "it closes")


def test_the_theme_is_light_or_dark_and_kept(served: Served, operator: Person) -> None:
    scheme = "return document.documentElement.dataset.mantineColorScheme"
    assert operator.driver.execute_script(scheme) == "dark"
    presses(operator, "lig-theme")
    until(lambda: operator.driver.execute_script(scheme) == "light", "it is light")
    operator.driver.refresh()
    until(lambda: operator.driver.execute_script(scheme) == "light", "it is light after a reload")
    presses(operator, "lig-theme")
    until(lambda: operator.driver.execute_script(scheme) == "dark", "it is dark again")
