"""What the rest of the world exerts on bodies: contacts, welds, and impulses of rods, grasps and tissue.

World axes, newtons, metres.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ligature.physics.contacts import Contacts
from ligature.physics.engine import Engine
from ligature.physics.impulses import Impulses
from ligature.physics.welds import Welds
from ligature.physics.wrenches import about, contact_wrench

Array = NDArray[np.float64]


class ContactWrenches:
    """Wrenches on groups of bodies in the last tick."""

    def __init__(self, engine: Engine, welds: Welds, impulses: Impulses) -> None:
        self._engine, self._welds, self._impulses = engine, welds, impulses
        self._owned: dict[tuple[int, ...], frozenset[tuple[int, int]]] = {}
        self._contacts = Contacts(engine)

    def any(self, bodies: Sequence[int]) -> bool:
        """Whether `on` may find anything: a quick look."""
        if self._impulses.act(bodies):
            return True
        for weld in self._welds:
            if weld.parent in bodies or weld.child in bodies:
                return True
        return self._contacts.touch(tuple(bodies), self._own(bodies))

    def rebuild(self) -> None:
        """Forget where bodies were in an engine that was rebuilt."""
        self._owned = {}
        self._contacts = Contacts(self._engine)

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
