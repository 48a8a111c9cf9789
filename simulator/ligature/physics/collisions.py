"""Pairs of bodies that do not collide: those of the scene, of grasps, and those that start overlapped."""

from __future__ import annotations

import pybullet

from ligature.physics.engine import Engine
from ligature.physics.overlaps import held_overlaps, overlap

LOOK = 50
"""Ticks between two looks at whether bodies that started overlapped have parted."""


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
        self.overlaps = held_overlaps(engine)
        self.restart()

    def step(self, tick: int) -> None:
        """Let those that started overlapped collide once they have parted."""
        if not self._overlapped or tick % LOOK:
            return
        parted = {pair for pair in self._overlapped if overlap(self._engine, *pair) == 0.0}
        self._overlapped -= parted
        for body, other in sorted(parted - self._disabled_pairs):
            self._set(body, other, True)

    def disable(self, body: int, other: int, disabled: bool) -> None:
        """Disable collision between two bodies, or enable it again unless they are disabled for another reason."""
        (self._disabled_pairs.add if disabled else self._disabled_pairs.discard)((body, other))
        overlapped = not self._overlapped.isdisjoint(((body, other), (other, body)))
        silent = other in self._engine.scene.bodies[body].no_collision_with
        self._set(body, other, not (disabled or overlapped or silent))

    def _set(self, body: int, other: int, collide: bool) -> None:
        a, b = self._engine.place_of[body], self._engine.place_of[other]
        pybullet.setCollisionFilterPair(a.uid, b.uid, a.link, b.link, int(collide), physicsClientId=self._engine.client)

    def restart(self) -> None:
        """Begin anew in an engine that was rebuilt."""
        self.restore((set(), {(found.body, found.other) for found in self.overlaps}))

    def begin(self) -> None:
        """Bodies were put back to where the scene starts: those that overlap there do so again."""
        self.restore((self._disabled_pairs, {(found.body, found.other) for found in self.overlaps}))

    def snapshot(self) -> tuple[set[tuple[int, int]], set[tuple[int, int]]]:
        """What lasts from tick to tick."""
        return self._disabled_pairs, self._overlapped

    def restore(self, snapshot: tuple[set[tuple[int, int]], set[tuple[int, int]]]) -> None:
        """Continue from `snapshot` in an engine that was rebuilt."""
        self._disabled_pairs, self._overlapped = snapshot
        for body in self._engine.place_of:
            for other in self._engine.scene.bodies[body].no_collision_with:
                if other > body and other in self._engine.place_of:
                    self._set(body, other, False)
        for body, other in sorted(self._disabled_pairs | self._overlapped):
            self._set(body, other, False)
