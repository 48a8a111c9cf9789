"""What sensors and actuators need of physics and threads: `ligature.physics.World`, its parts and rods implement it.

Poses are x y z qx qy qz qw in world axes, lengths in metres.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ligature.model.hits import Contact, RayHits
from ligature.model.scene import Slip
from ligature.model.shapes import Collider

Array = NDArray[np.float64]


class Queries(Protocol):
    """Geometry questions about the bodies of a scene at their present poses."""

    def add_probe(self, colliders: Sequence[Collider], margin: float) -> int:
        """Register a volume that produces no contacts; returns its handle."""

    def probe_gaps(self, probe: int, pose: Array, bodies: Sequence[int], within: float) -> list[float]:
        """Distance of each of ``bodies`` from the probe at ``pose`` (7,), negative where they overlap.

        ``within`` stands for all larger distances.
        """

    def ray_test(self, starts: Array, ends: Array) -> RayHits:
        """Closest hits of the segments ``starts`` to ``ends``, each (n, 3)."""

    def contacts(self, body: int, threshold: float) -> list[Contact]:
        """Contact points of ``body`` whose distance is at most ``threshold``."""


class Posed(Protocol):
    """Bodies that are somewhere."""

    def pose7(self, body: int) -> Array:
        """Pose (7,) of a body now."""


class Moving(Posed, Protocol):
    """Bodies that move."""

    def twist(self, body: int) -> Array:
        """Linear velocity of the centre of mass and angular velocity of a body, (6,)."""


class Pushable(Moving, Protocol):
    """Bodies that sensors push."""

    def apply_force(self, body: int, force: Array, point: Array) -> None:
        """Push a body with ``force`` (3,) at ``point`` (3,) during the coming step."""


class Elements(Moving, Protocol):
    """Elements of threads: bodies of the scene that the physics does not have; `ligature.suture.Rods`."""

    def element_of(self, body: int) -> tuple[int, int] | None:
        """Number of the rod and of the element that a body is; None for other bodies."""

    def push(self, body: int, force: Array, point: Array, stiffness: Array) -> None:
        """Push an element with ``force`` (3,) at ``point`` (3,) less ``stiffness`` (3, 3) times the point's motion."""


class ThreadQueries(Protocol):
    """Geometry questions about threads: `ligature.suture.RodQueries`."""

    def cast(self, starts: Array, ends: Array, hits: RayHits) -> RayHits:
        """Of what the segments ``starts`` to ``ends`` (n, 3) hit, the nearer: ``hits`` or an element."""

    def contacts(self, body: int, threshold: float) -> list[Contact]:
        """Where ``body`` is at most ``threshold`` away from elements and, if it is an element itself, from bodies."""


class Touchable(Protocol):
    """Bodies whose contacts are watched."""

    def touches(self, most: int) -> tuple[Array, Array]:
        """Contact points of the last step (n, 3), and the forces (n, 3) on one of the two bodies; at most ``most``."""


class Attachable(Protocol):
    """Bodies that actuators attach to others and grasp."""

    def attach(self, parent: int, child: int, T_parent_frame: Array, T_child_frame: Array) -> Any:
        """Attach two frames rigidly, given in the body frames of parent and child; returns a handle."""

    def grasp(self, slip: Slip, parent: int, child: int, T_parent_frame: Array, T_child_frame: Array) -> Any:
        """Hold ``child`` by friction between pads, beyond which it slips; returns a handle."""

    def holds(self, handle: Any) -> bool:
        """Whether the body of a handle is still held."""

    def release(self, handle: Any) -> None:
        """Release the body of a handle from `attach` or `grasp`."""
