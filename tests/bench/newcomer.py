"""A newcomer's first throw by the page alone, as a series of pictures: from the start page to a needle through tissue.

    python -m tests.bench.newcomer [--to FOLDER] [--docs]

A browser is driven as a person uses it who has not read anything: whatever the page offers next is pressed, at last its
slider is pulled. Each step leaves ``newcomer-N.png``, and a line of how long it took; ``--docs`` writes those that
the documentation shows to ``docs/pictures``. Exit status 1 when the needle is not through. Needs Chromium.
"""

from __future__ import annotations

import argparse
import io
import sys
import time
from pathlib import Path

from PIL import Image

from tests.cockpit.conftest import ROOT, Newcomer, Served, somebody

DESK = (1440, 900)
SHOWN = {1: "cockpit_start", 3: "cockpit_pick", 5: "cockpit_bring", 6: "cockpit_drive", 7: "cockpit"}
"""Steps whose pictures the documentation has."""


class Album:
    """Takes pictures of what is to be seen."""

    def __init__(self, one: Newcomer, folder: Path, docs: bool) -> None:
        self._one, self._folder, self._docs = one, folder, docs
        self._begin, self._count = time.monotonic(), 0

    def keep(self, what: str) -> None:
        """Take one."""
        self._count += 1
        picture = Image.open(io.BytesIO(self._one.person.driver.get_screenshot_as_png())).convert("RGB")
        picture.save(self._folder / f"newcomer-{self._count}.png")
        if self._docs and self._count in SHOWN:
            small = picture.resize((DESK[0] * 2 // 3, DESK[1] * 2 // 3), Image.Resampling.LANCZOS)
            small.quantize(128).save(ROOT / "docs" / "pictures" / f"{SHOWN[self._count]}.png", optimize=True)
        sys.stdout.write(f"{time.monotonic() - self._begin:6.1f} s  {what}: {self._one.words or '…'}\n")
        sys.stdout.flush()


def main() -> int:
    """Play a newcomer."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--to", type=Path, default=Path("build"))
    parser.add_argument("--docs", action="store_true")
    given = parser.parse_args()
    served = Served(scene=ROOT / "scenes" / "needle_insertion" / "launch.yaml")
    try:
        with somebody() as person:
            person.driver.set_window_size(*DESK)
            frame = DESK[1] - person.driver.execute_script("return innerHeight")
            person.driver.set_window_size(DESK[0], DESK[1] + frame)
            person.opens(served.url, 0.6)
            one = Newcomer(served, person)
            album = Album(one, given.to, given.docs)
            one.waits_for("lig-start")
            time.sleep(3.0)  # pictures come
            album.keep("the start page")
            one.presses("lig-start")
            one.waits_for("lig-pick")
            album.keep("Start")
            one.presses("lig-swap")
            one.sees_the_picture()
            time.sleep(2.0)
            album.keep("the camera's picture is large")
            one.presses("lig-pick")
            one.waits_for("lig-bring")
            album.keep("Pick up the needle")
            one.presses("lig-bring")
            one.waits_for("lig-drive")
            time.sleep(2.0)
            album.keep("Bring it to the tissue")
            one.pulls("lig-drive", 0.0, 0.55)
            one.waits_until(lambda: one.punctures == 1, "the needle is in")
            time.sleep(3.0)
            album.keep("the slider is half way")
            one.pulls("lig-drive", 0.55, 1.0)
            one.waits_until(lambda: "through the tissue" in one.words, "the needle is through")
            time.sleep(3.0)
            album.keep(f"the slider is at its end, {one.punctures} punctures")
            return 0 if one.punctures == 2 else 1
    finally:
        served.end()


if __name__ == "__main__":
    sys.exit(main())
