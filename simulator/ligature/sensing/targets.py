"""What sensors sense and push: rigid bodies and the elements of threads, which Bullet does not have, as one.

World axes, SI units.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.model.hits import Contact, RayHits
from ligature.sensing.queries import Elements, Pushable, Queries, ThreadQueries

Array = NDArray[np.float64]


class Targets:
    """The ``bodies`` of a scene, which ``queries`` asks about, with the ``elements`` of its threads."""

    def __init__(self, bodies: Pushable, queries: Queries, elements: Elements, threads: ThreadQueries) -> None:
        self._bodies, self._queries, self._elements, self._threads = bodies, queries, elements, threads

    def pose7(self, body: int) -> Array:
        """Pose (7,) of a body frame now."""
        return (self._bodies if self._elements.element_of(body) is None else self._elements).pose7(body)

    def twist(self, body: int) -> Array:
        """Linear velocity of the centre of mass and angular velocity of a body, (6,)."""
        return (self._bodies if self._elements.element_of(body) is None else self._elements).twist(body)

    def push(self, body: int, force: Array, point: Array, stiffness: Array) -> None:
        """Push a body with ``force`` (3,) at ``point`` (3,) during the coming step.

        ``stiffness`` (3, 3) is how the force gives way to the point's motion, which counts for elements alone.
        """
        if self._elements.element_of(body) is None:
            self._bodies.apply_force(body, force, point)
        else:
            self._elements.push(body, force, point, stiffness)

    def ray_test(self, starts: Array, ends: Array) -> RayHits:
        """Closest hits of the segments ``starts`` to ``ends``, each (n, 3)."""
        return self._threads.cast(starts, ends, self._queries.ray_test(starts, ends))

    def contacts(self, body: int, threshold: float) -> list[Contact]:
        """Contact points of ``body`` whose distance is at most ``threshold``."""
        return [*self._queries.contacts(body, threshold), *self._threads.contacts(body, threshold)]
