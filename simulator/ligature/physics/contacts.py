"""Which groups of bodies touched something else in the last tick: one look at all contacts for all groups."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import pybullet
from numpy.typing import NDArray

from ligature.kernels import kernel
from ligature.physics.bullet import get_contacts, init_contact_request, submit, whole_at
from ligature.physics.engine import Engine

Integers = NDArray[np.int64]

CONTACT_BYTES = 176
"""Size of Bullet's `b3ContactPointData`; whole numbers from byte 4 on are multibodies and links of both sides."""


@kernel
def _touching(handle: int, information: Integers, groups: Integers) -> int:
    """The groups with a contact outside their group, one bit each.

    ``groups`` (u, l) holds the groups of each multibody's links, the base first. ``information`` (3,) is its own
    address and Bullet's answer, a number of contacts and their address.
    """
    submit(handle, init_contact_request(handle))
    get_contacts(handle, information[0] + 8)
    found = 0
    for i in range(whole_at(information[0] + 8)):
        at = information[2] + i * CONTACT_BYTES
        a, b = whole_at(at + 4), whole_at(at + 8)
        one = groups[a, 1 + whole_at(at + 12)] if 0 <= a < groups.shape[0] else 0
        other = groups[b, 1 + whole_at(at + 16)] if 0 <= b < groups.shape[0] else 0
        found |= one & ~other
        if a != b:  # Bullet gives a contact between links of one multibody in one order only
            found |= other & ~one
    return found


class Contacts:
    """The contacts of an engine's client in the last tick."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._numbers: dict[tuple[int, ...], int] = {}
        links = [(uid, link) for uid, link in engine.body_at]
        self._groups = np.zeros((1 + max((u for u, _ in links), default=0), 2 + max((n for _, n in links), default=0)),
                                dtype=np.int64)  # fmt: skip
        self._information = np.zeros(3, dtype=np.int64)
        self._information[0] = self._information.ctypes.data
        self._tick, self._found = -1, 0

    def touch(self, bodies: tuple[int, ...], own: Collection[tuple[int, int]]) -> bool:
        """Whether ``bodies``, which are ``own`` multibodies and links, touched others in the last tick."""
        motions = self._engine.motions
        if not motions.handle:
            return self._touch(own)
        number = self._numbers.get(bodies)
        if number is None:
            number = self._numbers[bodies] = len(self._numbers)
            if number < 63:
                for uid, link in own:
                    self._groups[uid, 1 + link] |= 1 << number
            self._tick = -1
        if number >= 63:
            return self._touch(own)
        tick = int(motions.trees.ticks[0])
        if tick != self._tick:
            self._tick, self._found = tick, int(_touching(motions.handle, self._information, self._groups))
        return bool(self._found >> number & 1)

    def _touch(self, own: Collection[tuple[int, int]]) -> bool:
        return any(
            (found[1], found[3]) in own and (found[2], found[4]) not in own
            for uid in {uid for uid, _ in own}
            for found in pybullet.getContactPoints(bodyA=uid, physicsClientId=self._engine.client)
        )
