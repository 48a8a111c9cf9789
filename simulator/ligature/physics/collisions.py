"""Pairs of bodies that do not collide: those of the scene, and those that grasps disable."""

from __future__ import annotations

import pybullet

from ligature.physics.engine import Engine


class Collisions:
    """Collision between the bodies of an engine, pair by pair."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._disabled_pairs: set[tuple[int, int]] = set()
        self.rebuild()

    def disable(self, body: int, other: int, disabled: bool) -> None:
        """Disable collision between two bodies, or enable it again unless the scene disables it."""
        (self._disabled_pairs.add if disabled else self._disabled_pairs.discard)((body, other))
        self._set(body, other, not disabled and not self._apart(body, other))

    def _apart(self, body: int, other: int) -> bool:
        """Whether the scene disables collision between two bodies."""
        return other in self._engine.scene.bodies[body].no_collision_with

    def _set(self, body: int, other: int, collide: bool) -> None:
        a, b = self._engine.place_of[body], self._engine.place_of[other]
        pybullet.setCollisionFilterPair(a.uid, b.uid, a.link, b.link, int(collide), physicsClientId=self._engine.client)

    def rebuild(self) -> None:
        """Begin anew in an engine that was rebuilt: only pairs of the scene do not collide."""
        self._disabled_pairs = set()
        for body in self._engine.place_of:
            for other in self._engine.scene.bodies[body].no_collision_with:
                if other > body and other in self._engine.place_of:
                    self._set(body, other, False)

    def restart(self) -> None:
        """Begin anew: only pairs of the scene do not collide."""
        self.restore(set())

    def snapshot(self) -> set[tuple[int, int]]:
        """What lasts from tick to tick."""
        return self._disabled_pairs

    def restore(self, snapshot: set[tuple[int, int]]) -> None:
        """Continue from `snapshot`."""
        for body, other in sorted(self._disabled_pairs ^ snapshot):
            self._set(body, other, (body, other) not in snapshot and not self._apart(body, other))
        self._disabled_pairs = snapshot
