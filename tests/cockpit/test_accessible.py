"""The page is read by screen readers and used by keyboard: axe-core finds nothing of WCAG 2.1 A and AA against it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.keys import Keys

from tests.cockpit.conftest import Person, Served, until

axe = pytest.importorskip("axe_core_python", reason="the package axe-core-python holds what checks the page")

pytestmark = pytest.mark.timeout(600)

SOURCE = (Path(axe.__file__).parent / "axe.min.js").read_text("utf-8")
RULES = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa"]


def violations(person: Person) -> list[str]:
    """What axe-core has against what is shown now, one line for each element."""
    person.driver.execute_script(SOURCE)
    found: list[dict[str, Any]] = person.driver.execute_async_script(
        "const done = arguments[1]; axe.run(document, {runOnly: arguments[0]}).then((all) => done(all.violations), (error) => done([{id: String(error), nodes: [{html: '', failureSummary: ''}]}]))",
        RULES,
    )
    return [
        f"{rule['id']}: {node['html'][:200]} {node['failureSummary'][:300]}" for rule in found for node in rule["nodes"]
    ]


def clicks(person: Person, identity: str) -> None:
    shown = "const e = document.getElementById(arguments[0]); return !!e && e.offsetParent !== null"
    until(lambda: person.driver.execute_script(shown, identity), f"{identity} is shown")
    person.driver.execute_script("document.getElementById(arguments[0]).click()", identity)


def check(person: Person, where: str) -> None:
    """Names are given by our script a quarter of a second after viser makes something."""
    left: list[str] = []

    def none() -> bool:
        left[:] = violations(person)
        return not left

    try:
        until(none, where, 6.0)
    except AssertionError:
        raise AssertionError(f"{where}:\n" + "\n".join(left)) from None


@pytest.fixture(scope="module")
def operating(served: Served, person: Person) -> Person:
    person.opens(served.url)
    check(person, "who watches")
    clicks(person, "lig-start")
    person.sees("Give up control")
    until(lambda: served.arm("PSM1")["homed"], "instruments are homed")
    return person


def test_nothing_is_against_the_page_of_its_operator(operating: Person) -> None:
    check(operating, "dark")
    assert operating.driver.execute_script("return document.documentElement.lang")
    clicks(operating, "lig-theme")
    until(
        lambda: operating.driver.execute_script("return document.documentElement.dataset.mantineColorScheme")
        == "light",
        "it is light",
    )
    try:
        check(operating, "light")
    finally:
        clicks(operating, "lig-theme")


def test_nothing_is_against_the_help(operating: Person) -> None:
    clicks(operating, "lig-help-button")
    check(operating, "help")
    ActionChains(operating.driver).send_keys(Keys.ESCAPE).perform()


def test_the_keyboard_reaches_every_control_once_in_the_order_of_the_page(operating: Person) -> None:
    operating.driver.execute_script(
        "document.activeElement.blur(); window.reached = [];"
        "document.addEventListener('focusin', ({target: e}) => window.reached.push("
        "(e.id.startsWith('lig-') && e.id) || e.getAttribute('aria-label') || e.textContent.trim().slice(0, 40) || e.className))"
    )
    chain = ActionChains(operating.driver)
    for _ in range(90):
        chain.send_keys(Keys.TAB)
    chain.perform()
    reached = list(map(str, operating.driver.execute_script("return window.reached")))
    for one in ("lig-swap", "lig-arm", "lig-speed", "lig-help-button", "yaw °", "Give up control", "Enable"):
        assert one in reached, reached
    bar = [reached.index(one) for one in ("lig-swap", "lig-arm", "lig-speed", "lig-theme", "lig-help-button")]
    assert bar == sorted(bar)
