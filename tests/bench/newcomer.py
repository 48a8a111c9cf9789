"""A newcomer's first minutes by the page alone, as a series of pictures: from the start page towards the needle.

    python -m tests.bench.newcomer [--to FOLDER]

A browser is driven as a person uses it: one button, one key, drags in the camera's picture; where the needle lies it takes
from the scene, as a person from the picture. Each step leaves ``newcomer-N.png`` at desk size, and a line of how long it took and
how far the tip is from the needle. Needs Chromium.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
from ligature.cockpit.hands import Sightline
from selenium.webdriver.common.action_chains import ActionChains

from tests.cockpit.conftest import Person, Served, somebody, tip, until
from tests.waiting import steady

DESK = (1440, 900)
ARM = "PSM1"


class Newcomer:
    """Somebody who has never seen the page."""

    def __init__(self, served: Served, person: Person, folder: Path) -> None:
        self._served, self._person, self._folder = served, person, folder
        self._begin, self._count = time.monotonic(), 0

    @property
    def sight(self) -> Sightline:
        """How the endoscope looks."""
        return Sightline.of(self._served.scene.cameras[0], self._served.state["camera_world"][0])

    @property
    def needle(self) -> np.ndarray:
        """Where the needle is, (3,)."""
        return np.asarray(self._served.state["body_pose"][self._served.scene.needles[0].body][:3])

    def leaves(self, what: str) -> None:
        """Take a picture of what is to be seen now."""
        self._count += 1
        self._person.driver.save_screenshot(str(self._folder / f"newcomer-{self._count}.png"))
        away = 1e3 * float(np.linalg.norm(tip(self._served, ARM)[:3, 3] - self.needle))
        print(f"{time.monotonic() - self._begin:6.1f} s  {what}; tip {away:.0f} mm from the needle")  # noqa: T201

    def stands(self) -> None:
        """Wait until the tip stands."""
        steady(lambda: tip(self._served, ARM).copy(), 0.5, 1e-6, "the tip stands")

    def presses(self, identity: str) -> None:
        """Press a button."""
        until(lambda: self._person.driver.find_elements("id", identity), identity)
        until(lambda: self._person.driver.find_element("id", identity).is_displayed(), f"{identity} is shown")
        self._person.driver.execute_script("document.getElementById(arguments[0]).click()", identity)

    def drags_to_needle(self) -> None:
        """Drag the tip in the picture to where the needle is seen."""
        x, y, width, height, wide, high = self._person.driver.execute_script(
            "const i = document.getElementById('lig-image'), r = i.getBoundingClientRect();"
            "return [r.x, r.y, r.width, r.height, i.naturalWidth, i.naturalHeight]"
        )
        shown = min(height, width * high / wide)
        middle = np.array([x + width / 2, y + height / 2])
        sight = self.sight
        begin = middle + sight.place(tip(self._served, ARM)[:3, 3]) * shown * [1, -1]
        end = middle + sight.place(self.needle) * shown * [1, -1]
        steps = [(end - begin) / 10] * 10
        self._person.holds_at(float(begin[0]), float(begin[1]), [(float(s[0]), float(s[1])) for s in steps])
        self._person.lets_go()
        self.stands()

    def holds(self, key: str, seconds: float) -> None:
        """Hold a key."""
        ActionChains(self._person.driver).key_down(key).pause(seconds).key_up(key).perform()
        self.stands()


def main() -> None:
    """Play a newcomer."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--to", type=Path, default=Path("build"))
    folder = parser.parse_args().to
    served = Served()
    try:
        with somebody() as person:
            person.driver.execute_cdp_cmd(
                "Emulation.setDeviceMetricsOverride",
                {"width": DESK[0], "height": DESK[1], "deviceScaleFactor": 1, "mobile": False},
            )
            person.opens(served.url)
            one = Newcomer(served, person, folder)
            until(lambda: person.driver.find_elements("id", "lig-start"), "there is a button")
            one.leaves("the start page")
            one.presses("lig-start")
            until(lambda: served.arm(ARM)["homed"] and not served.arm(ARM)["busy"], "instruments are ready")
            one.stands()
            one.leaves("Start: powered, homed and in view")
            one.presses("lig-swap")
            size = "return document.getElementById('lig-image').naturalHeight > 300"
            until(lambda: person.driver.execute_script(size), "the picture is large")
            time.sleep(2.0)
            one.leaves("the camera's picture is large")
            one.drags_to_needle()
            one.leaves("the tip is dragged to where the needle is seen")
            one.holds("x", 0.5)
            one.leaves("the jaw is open")
            for _ in range(12):
                depth = one.sight.depth(one.needle) - one.sight.depth(tip(served, ARM)[:3, 3])
                if depth < 0.004:
                    break
                one.holds("e", min(depth / 0.04, 0.5))
            one.leaves("the tip is at the needle's depth")
            one.drags_to_needle()
            one.holds("z", 0.8)
            one.leaves("the jaw is closed")
    finally:
        served.end()


if __name__ == "__main__":
    main()
