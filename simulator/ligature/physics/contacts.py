"""What groups of bodies feel: one look at all contacts of the last tick for all groups, and at what pushes bodies."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np
import pybullet
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.physics.bullet import get_contacts, init_contact_request, submit, whole_at, word_at
from ligature.physics.engine import Engine
from ligature.physics.parking import Boxes, count_pairs, paired
from ligature.physics.trees import open_trees
from ligature.tables import opener, table_of

Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

CONTACT_BYTES = 176
"""Size of Bullet's `b3ContactPointData`; whole numbers from byte 4 on are multibodies and links of both sides."""

MOST_GROUPS = 62
"""Groups that have a bit each."""


class Groups(NamedTuple):
    """The groups of each link and body, one bit for each group: u multibodies of at most l links, b bodies, n boxes."""

    of_link: Integers  # (u, 1 + l), the base first
    of_body: Integers  # (b,)
    of_box: Integers  # (n,) of what each of `Boxes` belongs to
    answer: Integers  # (3,) its own address, and where Bullet puts a number of contacts and their address
    seen: Integers  # (2,) the tick whose contacts were looked at, -1 for none, and the groups with one


_open_groups = opener(Groups(np.zeros((1, 1), np.int64), *np.zeros((4, 1), np.int64)))


@inlined
def _may_touch(boxes: Boxes, groups: Groups) -> bool:
    """Whether Bullet has a pair of boxes out of which a group may have a contact; asking for contacts takes longer."""
    if boxes.at.shape[0] == 0:  # without boxes there is no address of the pairs either
        return True
    for j in range(count_pairs(boxes)):
        one, other = paired(boxes, j, 0), paired(boxes, j, 1)
        if (groups.of_box[one] if one >= 0 else 0) != (groups.of_box[other] if other >= 0 else 0):
            return True
    return False


@inlined
def _touching(handle: int, groups: Groups) -> int:
    """The groups with a contact outside their group in the last tick."""
    submit(handle, init_contact_request(handle))
    get_contacts(handle, groups.answer[0] + 8)
    found, of_link = 0, groups.of_link
    for i in range(whole_at(groups.answer[0] + 8)):
        at = word_at(groups.answer[0] + 16) + i * CONTACT_BYTES
        a, b = whole_at(at + 4), whole_at(at + 8)
        one = of_link[a, 1 + whole_at(at + 12)] if 0 <= a < of_link.shape[0] else 0
        other = of_link[b, 1 + whole_at(at + 16)] if 0 <= b < of_link.shape[0] else 0
        found |= one & ~other
        if a != b:  # Bullet gives a contact between links of one multibody in one order only
            found |= other & ~one
    return found


@kernel
def felt(handle: int, tree_table: Integers, acted: Flags, table: Integers) -> int:
    """The groups with a contact outside their group in the last tick, or with a body that is ``acted`` on.

    ``table`` is that of `Groups`.
    """
    trees, groups = open_trees(tree_table), _open_groups(table)
    if groups.seen[0] != trees.ticks[0]:
        groups.seen[0] = trees.ticks[0]
        groups.seen[1] = _touching(handle, groups) if _may_touch(trees.boxes, groups) else 0
    found = groups.seen[1]
    for body in range(acted.shape[0]):
        if acted[body]:
            found |= groups.of_body[body]
    return found


class Contacts:
    """What groups of an engine's bodies feel, for the engine's present client."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        places = list(engine.body_at)
        shape = 1 + max((uid for uid, _ in places), default=0), 2 + max((link for _, link in places), default=0)
        bodies, boxes = len(engine.scene.bodies), len(engine.motions.trees.boxes.at)
        of_link, of_body, of_box, answer = (np.zeros(n, np.int64) for n in (shape, bodies, boxes, 3))
        self._groups = Groups(of_link, of_body, of_box, answer, np.full(2, -1))
        self._groups.answer[0] = self._groups.answer.ctypes.data
        self._table = table_of(self._groups)

    def add(self, number: int, bodies: Sequence[int], own: Collection[tuple[int, int]]) -> None:
        """Add group ``number`` of ``bodies``, which are ``own`` multibodies and links."""
        for uid, link in own:
            self._groups.of_link[uid, 1 + link] |= 1 << number
        for body in bodies:
            self._groups.of_body[body] |= 1 << number
        for box, place in enumerate(self._engine.boxed):
            if place in own:
                self._groups.of_box[box] |= 1 << number
        self.forget()

    def forget(self) -> None:
        """Bullet's contacts are others now, though no tick passed."""
        self._groups.seen[:] = -1

    def felt(self, acted: Flags) -> int:
        """The groups that touch others, or with a body that is ``acted`` on, one bit each; it takes a handle."""
        motions = self._engine.motions
        return int(felt(motions.handle, motions.table, acted, self._table))

    def touch(self, own: Collection[tuple[int, int]]) -> bool:
        """Whether ``own`` multibodies and links touched others in the last tick; this asks PyBullet."""
        return any(
            (found[1], found[3]) in own and (found[2], found[4]) not in own
            for uid in {uid for uid, _ in own}
            for found in pybullet.getContactPoints(bodyA=uid, physicsClientId=self._engine.client)
        )
