"""What happens between two samples of a dataset, by the ground truth: grasps, releases, contacts, punctures, drops."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import h5py

from ligature.camera_simulation import Simulation

ARM_EVENTS = ("grasp", "release", "contact")
"""Of an arm: its jaws have got hold of something, have let go of it, its tool has met a rigid body that they do not
hold."""

NEEDLE_EVENTS = ("puncture", "exit", "drop")
"""Of the needle: its tip has gone into tissue or a hole, has come out of it; no jaws hold it any more, nor has tissue
it."""


@dataclass(frozen=True)
class _Moment:
    """The part of a state from which events are detected.

    Attributes
    ----------
    held
        Body that each arm's jaws hold, or -1.
    met
        Bodies that each arm's tool touches.
    holes
        Holes that have the needle in them; -1 - k is the body k of soft tissue.
    punctures
        Of each body of soft tissue, places at which needles went in and out.
    """

    held: tuple[int, ...]
    met: tuple[frozenset[int], ...]
    holes: frozenset[int]
    punctures: tuple[int, ...]


@dataclass(frozen=True)
class Events:
    """Whether each of `ARM_EVENTS` happened to each arm (arms, 3), and each of `NEEDLE_EVENTS` to the needle (3,)."""

    arms: tuple[tuple[bool, ...], ...]
    needle: tuple[bool, ...]


class EventWatch:
    """Compares the moments at which ``simulation`` is looked at; what came and went between two of them is not seen."""

    def __init__(self, simulation: Simulation) -> None:
        scene = simulation.scene
        jaws = {jaw.name: index for index, jaw in enumerate(scene.jaws)}
        self._simulation = simulation
        self._jaws = [jaws.get(arm.name, -1) for arm in scene.arms]
        self._tools = [(scene.jaws[jaw].palm, *scene.jaws[jaw].fingers) if jaw >= 0 else () for jaw in self._jaws]
        self._needle = scene.needles[0].body if scene.needles else -1
        self._before: _Moment | None = None

    def begin(self) -> None:
        """Forget what was before: an episode begins."""
        self._before = None

    def observe(self) -> Events:
        """What happened since the last look; nothing at the first one."""
        now = self._look()
        before, self._before = self._before or now, now
        each = zip(now.held, before.held, now.met, before.met, strict=True)
        arms = tuple((-1 != held != was, -1 != was != held, bool(met - had - {held})) for held, was, met, had in each)
        dropped = self._needle in before.held and self._needle not in now.held and not now.holes
        return Events(arms, (*_passed(before, now), dropped))

    def _look(self) -> _Moment:
        state = self._simulation.state[0]
        n = int(state["insertion_count"])
        holes = state["insertion_hole"][:n][state["insertion_body"][:n] == self._needle]
        return _Moment(
            tuple(int(state["jaw_body"][jaw]) if jaw >= 0 else -1 for jaw in self._jaws),
            tuple(self._met(tool) for tool in self._tools),
            frozenset(holes.tolist()),
            tuple(state["puncture_count"].tolist()),
        )

    def _met(self, tool: tuple[int, ...]) -> frozenset[int]:
        found = {other for body in tool for other in self._simulation.touched(body)}
        return frozenset(found.difference(tool))


def _passed(before: _Moment, now: _Moment) -> tuple[bool, bool]:
    """Whether the needle's tip entered, and left, between two states.

    Rigid holes: the first one that has it is where it went in, a further one where it came out, also where it goes on
    to the next bite before it has left the last. Soft tissue lists the places of both: the first, third, ... went in.
    """
    rigid, had = ({hole for hole in moment.holes if hole >= 0} for moment in (now, before))
    new = rigid - had
    inward, outward = bool(new) and not had, bool(new) and len(rigid) > 1
    for count, was in zip(now.punctures, before.punctures, strict=True):
        ways = {k % 2 for k in range(was, count)}
        inward, outward = inward or 0 in ways, outward or 1 in ways
    return inward, outward


def listed(episode: h5py.Group) -> Iterator[tuple[int, str, str]]:
    """Sample, event and what it happened to, an arm or ``needle``, of an episode's events in the order of samples."""
    found = []
    tracks = [(name, f"arms/{name}/events", ARM_EVENTS) for name in episode.get("arms", {})]
    for who, place, names in [*tracks, ("needle", "needle/events", NEEDLE_EVENTS)]:
        if place in episode:
            found += [(int(k), names[event], who) for k, event in zip(*episode[place][:].nonzero(), strict=True)]
    yield from sorted(found)
