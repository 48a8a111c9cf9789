"""What is done in a dataset, in words: what each arm does by the ground truth, and gestures of surgeons.

The gestures are those of JIGSAWS (Gao et al., JHU-ISI Gesture and Skill Assessment Working Set, M2CAI workshop of
MICCAI 2014, table 2).
"""

from __future__ import annotations

import bisect
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ligature.model.scene import Scene

ACTIVITIES = ("idle", "moves", "holds needle", "drives needle", "holds thread", "holds something else")
"""What an arm does, by its number."""

MOVING = 0.002
"""Metres a second of a tip that moves."""

GESTURES: Mapping[str, str] = {
    "G1": "reaches for the needle with the right hand",
    "G2": "positions the needle",
    "G3": "pushes the needle through the tissue",
    "G4": "passes the needle from the left to the right hand",
    "G5": "moves to the centre with the needle in hand",
    "G6": "pulls the suture with the left hand",
    "G7": "pulls the suture with the right hand",
    "G8": "orients the needle",
    "G9": "tightens the suture with the help of the right hand",
    "G10": "loosens more of the suture",
    "G11": "drops the suture at the end and moves to the end points",
    "G12": "reaches for the needle with the left hand",
    "G13": "winds a C around the right hand",
    "G14": "reaches for the suture with the right hand",
    "G15": "pulls the suture with both hands",
}
"""Gestures of JIGSAWS by their numbers there, in our words."""


MOST_PHASES = 255
"""Of a dataset: a sample has the number of its phase in one byte."""


class ActivityWatch:
    """Reads from states of ``scene`` what each of its arms does."""

    def __init__(self, scene: Scene) -> None:
        jaws = {jaw.name: index for index, jaw in enumerate(scene.jaws)}
        self._jaws = [jaws.get(arm.name, -1) for arm in scene.arms]
        self._needles = {needle.body for needle in scene.needles}
        self._thread = scene.rod_bodies

    def activities(self, state: Any) -> list[int]:
        """The number of each arm's activity in a state record (one element of it)."""
        n = int(state["insertion_count"])
        inserted = set(state["insertion_body"][:n].tolist())
        return [self._activity(arm, jaw, state, inserted) for arm, jaw in enumerate(self._jaws)]

    def _activity(self, arm: int, jaw: int, state: Any, inserted: set[int]) -> int:
        body = int(state["jaw_body"][jaw]) if jaw >= 0 else -1
        if body in self._needles:
            return 3 if body in inserted else 2
        if body >= 0:
            return 4 if body in self._thread else 5
        return int(float(np.linalg.norm(state["arm"][arm]["local_measured_cv"][:3])) > MOVING)


class MarkedPhases:
    """Phases that an operator marked, in the order of their ``marks``: when each began, and its name, "" for none.

    The first word of a phase may be the number of a gesture, as in "G3 push the needle". Raises ValueError for more
    phases than a dataset can have.
    """

    def __init__(self, marks: Sequence[tuple[float, str]]) -> None:
        self._times = [time for time, _ in marks]
        self._marked = [phase for _, phase in marks]
        self.names = tuple(dict.fromkeys(phase for phase in self._marked if phase))
        if len(self.names) > MOST_PHASES:
            raise ValueError(f"{len(self.names)} different phases were marked; a dataset has at most {MOST_PHASES}")

    @property
    def gestures(self) -> dict[str, str]:
        """Gestures of JIGSAWS by the names of the phases that name one."""
        numbers = {phase: phase.split()[0].upper() for phase in self.names}
        return {phase: number for phase, number in numbers.items() if number in GESTURES}

    def at(self, time: float) -> str:
        """The phase at ``time``; empty before the first."""
        place = bisect.bisect_right(self._times, time)
        return self._marked[place - 1] if place else ""


def phase_of(activities: list[int]) -> str:
    """One phase for all arms: the activity that matters most for the work."""
    order = (3, 2, 4, 5, 1, 0)
    return ACTIVITIES[min(activities, key=order.index)] if activities else ACTIVITIES[0]
