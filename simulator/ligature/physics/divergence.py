"""Which trees diverged, and what has to be put back along with them."""

from __future__ import annotations

from collections.abc import Iterable

from ligature.physics.engine import Engine

MAX_SPEED = 1e4
"""Speed in m/s or rad/s beyond which a body has diverged."""


def diverged(engine: Engine) -> list[int]:
    """The trees with a base or joint that is faster than `MAX_SPEED`, or not finite."""
    return [k for k in range(len(engine.trees)) if not all(abs(v) < MAX_SPEED for v in engine.motions.speeds(k))]


def joined(engine: Engine, trees: Iterable[int]) -> set[int]:
    """``trees`` and those that loops join to them, over any number of trees that move."""
    ends = [{engine.place_of[body].tree for body in (c.inner, c.outer)} for c in engine.scene.closures]
    still = {k for k, tree in enumerate(engine.trees) if tree.static and not tree.axes}
    found, before = set(trees), -1
    while len(found) > before:
        before = len(found)
        for pair in ends:
            if pair & found - still:
                found |= pair
    return found
