"""What the rest of the world exerts on bodies: contacts, welds, and impulses of rods, grasps and tissue.

World axes, newtons, metres.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ligature.physics.contacts import MOST_GROUPS, Contacts
from ligature.physics.engine import Engine
from ligature.physics.impulses import Impulses
from ligature.physics.welds import Welds
from ligature.physics.wrenches import about, contact_wrench

Array = NDArray[np.float64]

ALWAYS_FELT = 1 << 63
"""The bit of groups that have none of their own."""


class ContactWrenches:
    """Wrenches on groups of bodies in the last tick."""

    def __init__(self, engine: Engine, welds: Welds, impulses: Impulses) -> None:
        self._engine, self._welds, self._impulses = engine, welds, impulses
        self._owned: dict[tuple[int, ...], frozenset[tuple[int, int]]] = {}
        self._groups: list[tuple[int, ...]] = []
        self._contacts = Contacts(engine)

    def group(self, bodies: Sequence[int]) -> int:
        """The bit of a group of ``bodies`` in what is `felt`; the sign's, which always is, once there are too many."""
        group = tuple(bodies)
        if group not in self._groups:
            if len(self._groups) == MOST_GROUPS:
                return ALWAYS_FELT
            self._groups.append(group)
            self._contacts.add(len(self._groups) - 1, group, self._own(group))
        return 1 << self._groups.index(group)

    def felt(self) -> int:
        """The groups for which `on` may find anything, one bit each: a quick look."""
        found = ALWAYS_FELT
        if self._engine.motions.handle:
            found |= self._contacts.felt(self._impulses.acted)
        else:
            for number, group in enumerate(self._groups):
                if self._contacts.touch(self._own(group)) or self._impulses.act(group):
                    found |= 1 << number
        for weld in self._welds:
            for number, group in enumerate(self._groups):
                if weld.parent in group or weld.child in group:
                    found |= 1 << number
        return found

    def forget(self) -> None:
        """Contacts are others now, though no tick passed."""
        self._contacts.forget()

    def rebuild(self) -> None:
        """Forget where bodies were in an engine that was rebuilt."""
        self._owned = {}
        self._contacts = Contacts(self._engine)
        for number, group in enumerate(self._groups):
            self._contacts.add(number, group, self._own(group))

    def _own(self, bodies: Sequence[int]) -> frozenset[tuple[int, int]]:
        """Multibody and link of each of ``bodies``."""
        key = tuple(bodies)
        if key not in self._owned:
            places = (self._engine.place_of[body] for body in bodies if body in self._engine.place_of)
            self._owned[key] = frozenset((place.uid, place.link) for place in places)
        return self._owned[key]

    def on(self, bodies: Sequence[int], point: Array) -> Array:
        """Force and moment (6,) about ``point`` (3,) that the rest of the world exerted on ``bodies`` in the last tick.

        Counted are contacts, welds, and all that was given to `Impulses.apply`: rods, grasps, tissue.
        Gravity, inertia and what the bodies do to each other are not.
        """
        place_of = self._engine.place_of
        own = self._own(bodies)
        wrench = np.zeros(6)
        for uid in dict.fromkeys(place_of[body].uid for body in bodies if body in place_of):
            links = {link for owner, link in own if owner == uid}
            wrench += contact_wrench(self._engine.client, uid, links, own, point)
        inside = set(bodies)
        for weld in self._welds:
            if (weld.parent in inside) != (weld.child in inside):
                sign = 1.0 if weld.parent in inside else -1.0
                wrench += sign * self._welds.wrench(weld, point)
        for body in inside & self._impulses.bodies:
            wrench += about(self._impulses.pending(body) / self._engine.dt, place_of[body].centre(), point)
        return wrench
