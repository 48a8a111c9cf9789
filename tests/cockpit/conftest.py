"""A simulation with its page, and a person before a browser: Debian's Chromium, headless, drawing in software."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import ligature
import numpy as np
import pytest
from ligature.bus import Block
from ligature.bus.leftovers import FOLDER
from ligature.cockpit.stage import VIEW_ANGLE, first_view
from ligature.model.frames import pose7_matrix
from ligature.model.state import new_state
from ligature.process import end_with_parent

from tests import waiting

ROOT = Path(__file__).resolve().parents[2]
SMALL = ROOT / "scenes" / "suturing_small" / "launch.yaml"
TIMEOUT = 100.0
COARSE = 0.25
"""Pixels drawn of the 3D view for each of the window: nobody looks at it here, and software draws."""

FLAGS = (
    "--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--use-gl=angle", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader", "--window-size=1180,700", "--disable-background-networking",
    "--disable-renderer-backgrounding", "--disable-background-timer-throttling",
)  # fmt: skip


def until(
    condition: Callable[[], Any], what: str | Callable[[], str], seconds: float = TIMEOUT, every: float = 0.05
) -> Any:
    """Wait for ``condition``, as long as a busy browser takes; returns what it returned."""
    return waiting.until(condition, what, seconds, every)


class Served:
    """A simulation with a page, and its state as the physics process writes it."""

    def __init__(
        self, *arguments: str, scene: Path = SMALL, folder: Path | None = None, prefix: Sequence[str] = ()
    ) -> None:
        self.lines: list[str] = []
        command = [*prefix, str(Path(sys.executable).parent / "ligature"), "cockpit", str(scene), "--at", "127.0.0.1:0"]
        self.process = subprocess.Popen(
            [*command, "-p", "250", *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            env=dict(os.environ, COLUMNS="200"), cwd=folder, preexec_fn=end_with_parent,
        )  # fmt: skip
        threading.Thread(target=self._read, daemon=True).start()
        try:
            self._attach(scene)
        except BaseException:
            self.process.kill()
            raise

    def _attach(self, scene: Path) -> None:
        ready = until(lambda: next((x for x in self.lines if x.startswith("cockpit ready")), ""), "the page is served")
        self.url = ready.partition(": ")[2].strip()
        self.scene = ligature.load(str(scene))
        (name,) = [path.name for path in FOLDER.glob(f"ligature-{self.process.pid}-*")]
        self._record = new_state(self.scene)
        self.block = Block.attach(name, self._record.dtype)
        self.block.read(self._record)
        self.first = self._record.copy()
        self.names = [arm.name for arm in self.scene.arms]

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.append(line.rstrip("\n"))

    @property
    def state(self) -> Any:
        """The newest state, one element of the record."""
        self.block.read(self._record)
        return self._record[0]

    def arm(self, name: str) -> Any:
        """The newest state of an arm."""
        return self.state["arm"][self.names.index(name)]

    def end(self) -> None:
        self.process.send_signal(signal.SIGINT)
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise
        finally:
            self.block.close()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the simulator is started."""
    return tmp_path_factory.mktemp("started")


@pytest.fixture(scope="module")
def served(folder: Path) -> Iterator[Served]:
    running = Served(folder=folder)
    yield running
    running.end()


class Person:
    """Somebody before a browser, who sees what is on the page and uses the mouse and the keyboard."""

    def __init__(self) -> None:
        from selenium import webdriver
        from selenium.webdriver.chrome.service import Service

        options = webdriver.ChromeOptions()
        options.binary_location = str(shutil.which("chromium"))
        for flag in FLAGS:
            options.add_argument(flag)
        self.driver = webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver")))
        self.driver.set_script_timeout(TIMEOUT)
        self.driver.set_page_load_timeout(TIMEOUT)

    def opens(self, url: str, pixels: float = COARSE) -> None:
        self.driver.get(f"{url}/?fixedDpr={pixels}")
        self.sees("Ligature")
        self.driver.execute_script(
            "document.querySelectorAll('.mantine-Notification-closeButton').forEach(b => b.click())"
        )

    @property
    def text(self) -> str:
        return str(self.driver.execute_script("return document.body.innerText"))

    def sees(self, text: str) -> None:
        until(lambda: text in self.text, f"'{text}' is on the page")

    def find(self, xpath: str) -> Any:
        """The first element that is shown."""
        return until(
            lambda: next((e for e in self.driver.find_elements("xpath", xpath) if e.is_displayed()), None), xpath
        )

    def clicks(self, label: str) -> None:
        """Click what bears ``label``."""
        self.find(f"//button[normalize-space(.)='{label}'] | //label[normalize-space(.)='{label}']").click()

    def ticked(self, label: str) -> bool:
        """Whether the box with that label is ticked."""
        return bool(self.find(f"//input[@id=//label[text()='{label}']/@for]").is_selected())

    def operates(self) -> None:
        """Take the desk, unless it has it."""

        def seated() -> bool:
            if "Give up control" not in self.text:
                with suppress(Exception):  # the button goes when an operator who reloads is seated by itself
                    self.driver.find_element("xpath", "//button[normalize-space(.)='Operate']").click()
                    time.sleep(1.0)
            return "Give up control" in self.text

        until(seated, "the desk is taken")

    def operates_arm(self, served: Served, name: str) -> None:
        """Operate on a freshly loaded page, with the arm enabled and homed."""
        self.opens(served.url)
        self.sees("running")
        until(lambda: "operator away" not in self.text or "Give up control" in self.text, "the desk is free")
        self.operates()
        if not served.arm(name)["homed"]:
            self.clicks("Enable")
            until(lambda: served.arm(name)["operating"] == 1, f"{name} is enabled")
            self.clicks("Home")
        until(lambda: served.arm(name)["homed"] and not served.arm(name)["busy"], f"{name} is homed")
        until(lambda: self.slider("yaw °").get_attribute("aria-disabled") != "true", "sliders can be moved")

    def writes(self, label: str, text: str) -> None:
        """Write ``text`` into the field with that label, and leave it."""
        from selenium.webdriver.common.keys import Keys

        field = self.find(f"(//label[text()='{label}']/following::input)[1]")
        field.send_keys(Keys.CONTROL, "a")
        field.send_keys(text, Keys.TAB)

    def slider(self, label: str) -> Any:
        """The thumb of the first slider with that label."""
        root = self.find(f"//label[text()='{label}']").get_attribute("for")
        return self.driver.find_element("xpath", f"//*[@id='{root}']//*[@role='slider']")

    def drags(self, element: Any, right: int, down: int = 0) -> None:
        self._chain().click_and_hold(element).move_by_offset(right, down).release().perform()

    def holds_at(self, x: float, y: float, ways: list[tuple[float, float]]) -> None:
        """Press at a place of the window, and move the pressed mouse along ``ways``."""
        chain = self._chain()
        chain.w3c_actions.pointer_action.move_to_location(round(x), round(y))
        chain.pause(0.3).click_and_hold()
        for right, down in ways:
            chain.move_by_offset(round(right), round(down)).pause(0.05)
        chain.perform()

    def presses(self, element: Any, right: int) -> None:
        """Press on an element and drag it, and keep it pressed."""
        self._chain().click_and_hold(element).move_by_offset(right, 0).perform()

    def lets_go(self) -> None:
        self._chain().release().perform()

    def _chain(self) -> Any:
        from selenium.webdriver.common.action_chains import ActionChains

        return ActionChains(self.driver, duration=50)

    def processes(self) -> list[int]:
        """Process ids of the browser, its first one first."""
        listing = subprocess.run(["ps", "-wweo", "pid,ppid"], capture_output=True, text=True, check=True).stdout
        parents = dict(tuple(map(int, line.split())) for line in listing.splitlines()[1:])  # type: ignore[misc]
        found = [self.driver.service.process.pid]
        for pid in found:
            found += [child for child, parent in parents.items() if parent == pid]
        return found[1:]

    def goes(self) -> None:
        with suppress(Exception):  # a browser that was killed cannot be asked to end
            self.driver.quit()


class Newcomer:
    """Somebody who presses what the page offers, and knows nothing else."""

    def __init__(self, served: Served, person: Person) -> None:
        self.served, self.person = served, person

    @property
    def words(self) -> str:
        """What the page says about the throw."""
        return str(self.person.driver.execute_script("return document.getElementById('lig-told')?.textContent ?? ''"))

    @property
    def punctures(self) -> int:
        """How many the tissue has."""
        return int(self.served.state["puncture_count"][0])

    def waits_until(self, condition: Callable[[], Any], what: str) -> None:
        until(condition, lambda: f"{what} (the page says: {self.words})")

    def offered(self, identity: str) -> bool:
        """Whether a control is to be seen and can be used."""
        found = self.person.driver.find_elements("id", identity)
        return any(one.is_displayed() and one.is_enabled() for one in found)

    def waits_for(self, identity: str) -> None:
        self.waits_until(lambda: self.offered(identity), f"{identity} is offered")

    def presses(self, identity: str) -> None:
        self.waits_for(identity)
        self.person.driver.find_element("id", identity).click()

    def sees_the_picture(self) -> None:
        size = "return document.getElementById('lig-image')?.naturalHeight > 100"
        until(lambda: self.person.driver.execute_script(size), "the camera's picture is shown")

    def pulls(self, identity: str, begin: float, end: float) -> None:
        """Pull the thumb of a slider from one share of its length to another with the mouse."""
        slider = self.person.driver.find_element("id", identity)
        wide = slider.size["width"] - 16  # the thumb's middle does not reach the ends
        chain = self.person._chain().move_to_element_with_offset(slider, round((begin - 0.5) * wide), 0)
        chain.click_and_hold()
        for _ in range(10):
            chain.move_by_offset(round((end - begin) * wide / 10), 0).pause(0.1)
        chain.move_by_offset(4, 0).release().perform()


def projected(served: Served, person: Person, points: np.ndarray) -> np.ndarray:
    """Places (n, 2) in the window of world points (n, 3), from where a page looks at first.

    The page is assumed to have been opened just now, and the scene's thread to lie as at the start.
    """
    eye, at, up = first_view(served.scene, served.first)
    z = (eye - at) / np.linalg.norm(eye - at)
    x = np.cross(up, z) / np.linalg.norm(np.cross(up, z))
    local = (points - eye) @ np.array([x, np.cross(z, x), z]).T
    box = person.driver.execute_script(
        "const r = document.querySelector('canvas[data-engine]').getBoundingClientRect(); return [r.x, r.y, r.width, r.height]"
    )
    scale = 0.5 * box[3] / np.tan(VIEW_ANGLE / 2) / -local[:, 2]
    return np.column_stack([box[0] + box[2] / 2 + scale * local[:, 0], box[1] + box[3] / 2 - scale * local[:, 1]])


def tip(served: Served, name: str) -> np.ndarray:
    """Set-point (4, 4) of an arm's tip in the world."""
    index = served.names.index(name)
    base = pose7_matrix(served.state["body_pose"][served.scene.arms[index].base])
    return np.asarray(base @ pose7_matrix(served.arm(name)["local_setpoint_cp"]))


@pytest.fixture(scope="module")
def person() -> Iterator[Person]:
    with somebody() as found:
        yield found


@contextmanager
def somebody() -> Iterator[Person]:
    pytest.importorskip("selenium", reason="the package selenium drives the browser")
    for program in ("chromium", "chromedriver"):
        if shutil.which(program) is None:
            pytest.skip(f"{program} is not installed (debian-packages-tests.txt)")
    found = Person()
    try:
        yield found
    finally:
        found.goes()
