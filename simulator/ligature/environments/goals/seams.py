"""How far needle and thread have been pulled through a pair of holes. World axes, metres."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.environments.goals.driving import holes_at
from ligature.simulation import Simulation
from ligature.tasks.scenery import Scenery
from ligature.tasks.throws import NeedleArc

Array = NDArray[np.float64]


class Pulled(NamedTuple):
    """What is through: metres of thread ``drawn`` out of the exit, the same with the needle before it: ``beyond``.

    ``needle_inside`` says whether a hole has the needle, ``exit_filled`` whether anything is in the exit.
    """

    drawn: float
    beyond: float
    needle_inside: bool
    exit_filled: bool


@dataclass(frozen=True, eq=False)
class Seam:
    """The first pair of holes, and the needle with its thread that goes through them.

    Parameters
    ----------
    simulation
        It is read at each look.
    entry, exit
        Numbers of the holes.
    needle, needle_length
        Its body, and its length from base to tip.
    thread, thread_length, needle_first
        Bodies of the thread, its length, and whether the needle is before its first one.
    """

    simulation: Simulation
    entry: int
    exit: int
    needle: int
    needle_length: float
    thread: tuple[int, ...]
    thread_length: float
    needle_first: bool

    @classmethod
    def of(cls, simulation: Simulation, scenery: Scenery, arc: NeedleArc) -> Seam:
        """The first pair of a scene; ValueError where it holds no needle with a thread."""
        scene, poses = simulation.scene, simulation.state["body_pose"][0]
        entry, exit = (holes_at(simulation, poses[side[0], :3]) for side in (scenery.entries, scenery.exits))
        if not (entry and exit and scenery.thread):
            raise ValueError("the scene has no needle with a thread, and holes that hold them")
        rod = next(rod for rod in scene.rods if rod.bodies == scenery.thread)
        ends = [{scene.joints[j].parent, scene.joints[j].child} for j in rod.anchors]
        first = {scenery.needle, rod.bodies[0]} in ends
        length = float(rod.lengths.sum())
        return cls(simulation, min(entry), min(exit), scenery.needle, arc.length, tuple(scenery.thread), length, first)

    def look(self) -> Pulled:
        """What is through now."""
        state = self.simulation.state
        n = int(state["insertion_count"][0])
        holes, bodies, depths = (state[f"insertion_{what}"][0, :n] for what in ("hole", "body", "depth"))
        needle, thread = bodies == self.needle, np.isin(bodies, self.thread)
        entry, exit = holes == self.entry, holes == self.exit
        drawn = float(self._lengths(depths[thread & exit]).max(initial=0.0)) if (thread & entry).any() else 0.0
        inside = float(depths[needle & exit].max(initial=0.0))
        beyond = self.needle_length + drawn if (thread & exit).any() else inside
        return Pulled(drawn, beyond, bool(needle.any()), bool((exit & (needle | thread)).any()))

    def _lengths(self, depths: Array) -> Array:
        """Metres of thread between the needle and holes with ``depths`` (k,) from there to the last element."""
        return self.thread_length - depths if self.needle_first else depths
