"""How a command samples a simulation into a dataset: the options that ``demo`` and ``replay`` share."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

SMALLEST, LARGEST = 16, 8192
"""Pixels of a side of a picture."""


@dataclass(frozen=True)
class Sampling:
    """Samples per simulated second, width and height of the pictures, and names of the cameras."""

    rate: float = 10.0
    size: tuple[int, int] = (320, 240)
    cameras: tuple[str, ...] = ("cameraL", "cameraR")

    def words(self) -> list[str]:
        """The same as options of ``examples/record_dataset.py``."""
        size = f"{self.size[0]}x{self.size[1]}"
        cameras = [word for name in self.cameras for word in ("--camera", name)]
        return ["--rate", f"{self.rate:g}", "--size", size, *(cameras or ["--no-cameras"])]


@dataclass(frozen=True)
class Sampled:
    """A dataset that a record is written to, and what is known of how the run went.

    ``task`` is judged by the simulation, by default that of the recorded run; ``success`` is what the operator found;
    ``text`` is the instruction.
    """

    path: Path
    sampling: Sampling = Sampling()
    task: str = ""
    success: bool | None = None
    text: str = ""


def picture_size(text: str) -> tuple[int, int]:
    """Width and height of a text such as ``640x480``; raises ValueError."""
    match = re.fullmatch(r"(\d{1,5})x(\d{1,5})", text)
    size = (int(match[1]), int(match[2])) if match else (0, 0)
    if not SMALLEST <= min(size) <= max(size) <= LARGEST:
        raise ValueError(
            f"'{text}' is not a size of pictures; write WIDTHxHEIGHT in pixels, {SMALLEST} to {LARGEST} each: 640x480"
        )
    return size
