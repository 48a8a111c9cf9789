"""Pairs of bodies that do not collide: those of the scene, of grasps, and those that start overlapped."""

from __future__ import annotations

import pybullet

from ligature.physics.engine import Engine
from ligature.physics.overlaps import held_overlaps, overlap

CHECK_INTERVAL = 50
"""Ticks between two checks whether bodies that started overlapped have parted."""


class Collisions:
    """Collision between the bodies of an engine, pair by pair.

    Attributes
    ----------
    overlaps
        Bodies that joints hold inside each other where the scene starts; they do not collide until they have parted.
    """

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._disabled_pairs: set[tuple[int, int]] = set()
        self._overlapped: set[tuple[int, int]] = set()
        self.rebuild()
        self.overlaps = held_overlaps(engine)
        self.restart()

    @property
    def waits(self) -> bool:
        """Whether bodies that started overlapped have not parted yet."""
        return bool(self._overlapped)

    def step(self, tick: int) -> None:
        """Let those that started overlapped collide once they have parted."""
        if not self._overlapped or tick % CHECK_INTERVAL:
            return
        parted = {pair for pair in self._overlapped if overlap(self._engine, *pair) == 0.0}
        self._change(self._disabled_pairs, self._overlapped - parted)

    def collide(self, body: int, other: int) -> bool:
        """Whether two bodies collide where they touch."""
        bodies, disabled = self._engine.scene.bodies, self._disabled_pairs | self._overlapped
        return (
            other not in bodies[body].no_collision_with
            and (body, other) not in disabled
            and (other, body) not in disabled
            and not (bodies[body].static and bodies[other].static)
        )

    def disable(self, body: int, other: int, disabled: bool) -> None:
        """Disable collision between two bodies, or enable it again unless they are disabled for another reason."""
        pair = {(body, other)}
        self._change(self._disabled_pairs | pair if disabled else self._disabled_pairs - pair, self._overlapped)

    def _change(self, disabled: set[tuple[int, int]], overlapped: set[tuple[int, int]]) -> None:
        """Replace the disabled pairs, and set in Bullet those that were added or removed."""
        before = self._disabled_pairs | self._overlapped
        self._disabled_pairs, self._overlapped = disabled, overlapped
        now = disabled | overlapped
        for body, other in sorted(before ^ now):
            apart = other in self._engine.scene.bodies[body].no_collision_with
            self._set(body, other, not apart and (body, other) not in now and (other, body) not in now)

    def _set(self, body: int, other: int, collide: bool) -> None:
        a, b = self._engine.place_of[body], self._engine.place_of[other]
        pybullet.setCollisionFilterPair(a.uid, b.uid, a.link, b.link, int(collide), physicsClientId=self._engine.client)
        self._engine.motions.rouse_all()

    def rebuild(self) -> None:
        """Begin anew in an engine that was rebuilt: only pairs of the scene do not collide."""
        self._disabled_pairs, self._overlapped = set(), set()
        for body in self._engine.place_of:
            for other in self._engine.scene.bodies[body].no_collision_with:
                if other > body and other in self._engine.place_of:
                    self._set(body, other, False)

    def restart(self) -> None:
        """Begin anew where the scene starts."""
        self._change(set(), {(found.body, found.other) for found in self.overlaps})

    def begin(self) -> None:
        """Bodies were put back to where the scene starts: those that overlap there do so again."""
        self._change(self._disabled_pairs, {(found.body, found.other) for found in self.overlaps})

    def snapshot(self) -> tuple[set[tuple[int, int]], set[tuple[int, int]]]:
        """What lasts from tick to tick."""
        return self._disabled_pairs, self._overlapped

    def restore(self, snapshot: tuple[set[tuple[int, int]], set[tuple[int, int]]]) -> None:
        """Continue from `snapshot`."""
        self._change(*snapshot)
