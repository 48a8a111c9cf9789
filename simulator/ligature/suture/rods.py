"""All rods of a scene: built from recognised chains, advanced once a tick beside the rigid bodies.

World axes, SI units; poses and twists as in `ligature.model.state`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.adf import Diagnostic, Severity
from ligature.adf.diagnostics import length
from ligature.model.scene import Scene
from ligature.model.state import FieldViews, StateRecord
from ligature.suture.bodies import Bodies, Masses
from ligature.suture.colliders import Colliders
from ligature.suture.description import RodDescription, from_chain
from ligature.suture.exclusions import Exclusions
from ligature.suture.partners import Partner
from ligature.suture.rod import Rod

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

NEXT_TO_PADS = 3
"""Elements next to the one between pads that do not touch the fingers."""

NEXT_TO_ATTACHMENT = 3
"""Elements next to an attachment that do not touch its body, in which they begin."""


class Rods:
    """The rods of a scene.

    Parameters
    ----------
    scene
        Its recognised chains become the rods.
    dt
        Length of a tick in seconds.

    Attributes
    ----------
    rods
        The rods, in the order of the scene's chains.
    colliders
        The convex parts of the bodies around them.
    """

    def __init__(self, scene: Scene, dt: float = 1e-3) -> None:
        self.colliders = Colliders(scene, dt)
        self._exclusions: list[Exclusions] = []
        self.rods = [self._rod(scene, from_chain(scene, chain), dt) for chain in scene.rods]
        self._names = [body.identity.identifier for body in scene.bodies]
        self.problems: list[Diagnostic] = []
        self._reported = [False] * len(self.rods)
        self._places = {
            body: (number, e) for number, rod in enumerate(self.rods) for e, body in enumerate(rod.description.bodies)
        }
        self._fields = FieldViews("body_pose", "body_twist", "rod_tension")
        self._tick_tables: list[Integers] = []
        self._ticks = np.zeros((0, 0), np.int64)

    def _rod(self, scene: Scene, description: RodDescription, dt: float) -> Rod:
        elements = len(description.mass)
        shapes = self.colliders.shapes(elements)
        attached = [attachment.body for attachment in description.attachments]
        bodies = sorted({*attached, *self.colliders.bodies})
        free = {a.links[0].body for a in scene.articulations if len(a.links) == 1}
        rod = Rod(description, [_partner(scene, b, b in free) for b in bodies], shapes, dt)
        for attachment in description.attachments:
            beside = np.abs(np.arange(elements) - attachment.element) < NEXT_TO_ATTACHMENT
            shapes.skip[self.colliders.parts_of(attachment.body)] |= beside
        for e, element in enumerate(description.bodies):
            for other in scene.bodies[element].no_collision_with:
                shapes.skip[self.colliders.parts_of(other), e] = True
        self._exclusions.append(Exclusions(rod, shapes))
        return rod

    def step(self, bodies: Bodies) -> None:
        """Advance every rod by one tick and apply its impulses to the bodies that it is attached to or touches."""
        if not self.rods:
            return
        box = self.rods[0].box()
        for rod in self.rods[1:]:
            other = rod.box()
            box = np.array([np.minimum(box[0], other[0]), np.maximum(box[1], other[1])])
        near = self.colliders.update(bodies, box)
        for number, rod in enumerate(self.rods):
            rod.meet(self.colliders, near, bodies)
            self._report_inside(number, self._exclusions[number].step())
            rod.step()
            for body, impulse in rod.pushes():
                bodies.apply_impulse(body, impulse[:3], impulse[3:])
            if not rod.settled_soundly:
                self._heal(rod)

    @property
    def coasts(self) -> bool:
        """Whether the coming ticks take nothing but `tick_tables` until a command comes or other bodies are near."""
        near = self.colliders.nearby
        return all(rod.coasts(near) for rod in self.rods) and all(exclusions.idle for exclusions in self._exclusions)

    def tick_tables(self) -> Integers:
        """What a tick of each rod takes, (r, w): the tables of `ligature.suture.ticking.RodTick`."""
        tables = [rod.tick_table for rod in self.rods]
        if list(map(id, tables)) != list(map(id, self._tick_tables)):
            self._tick_tables, self._ticks = tables, np.array(tables)
        return self._ticks

    def end_pulls(self) -> None:
        """Undo what `Rod.pull_partner` set for ticks of compiled code."""
        for rod in self.rods:
            rod.end_pulls()

    def conclude(self) -> None:
        """Take over ticks of compiled code from the arrays, and put back what diverged in the last one."""
        for rod in self.rods:
            rod.conclude()
            if not rod.settled_soundly:
                self._heal(rod)

    def attach(self, body: int, element_body: int, T_body_a: Array, T_element_b: Array) -> None:
        """Attach an element of a rod to a body rigidly.

        Parameters
        ----------
        body, element_body
            Indices of the body and of the element in the scene.
        T_body_a, T_element_b
            Frames (4, 4) in the body frames B of the two; they coincide while the attachment holds.

        Raises
        ------
        ValueError
            If ``element_body`` is not an element of a rod, or ``body`` has no collision shape.
        """
        if element_body not in self._places:
            raise ValueError(f"body {element_body} is not an element of a rod")
        rod, element = self._element(element_body)
        rod.attach(element, body, T_element_b, T_body_a)

    def detach(self, body: int, element_body: int) -> None:
        """Remove the attachment of ``element_body`` to ``body`` that `attach` made."""
        rod, element = self._element(element_body)
        rod.detach(element, body)

    def carry(self, body: int, T: Array) -> None:
        """Follow a ``body`` that was put elsewhere, moved by ``T`` (4, 4) in world axes.

        Threads that are attached to it alone move with it, at rest.
        """
        self.colliders.restart()
        for rod, exclusions in zip(self.rods, self._exclusions, strict=True):
            if rod.hangs_on(body):
                rod.carry(T)
                exclusions.look()
            else:
                exclusions.look(self.colliders.parts_of(body))

    def pose7(self, body: int) -> Array:
        """Pose (7,) of an element's body frame now."""
        rod, element = self._element(body)
        pose: Array = rod.body_poses[element]
        return pose

    def twist(self, body: int) -> Array:
        """Velocity (6,) of an element now."""
        rod, element = self._element(body)
        twist: Array = rod.twists[element]
        return twist

    def element_of(self, body: int) -> tuple[int, int] | None:
        """Number of the rod and of the element that a body is; None for bodies outside rods."""
        return self._places.get(body)

    def _element(self, body: int) -> tuple[Rod, int]:
        """The rod of an element, and the place of the element in it."""
        number, element = self._places[body]
        return self.rods[number], element

    def push(self, body: int, force: Array, point: Array, stiffness: Array) -> None:
        """Push the element ``body`` with ``force`` (3,) at ``point`` (3,) in the coming tick.

        `Rod.push` explains ``stiffness`` (3, 3). World axes, N, m, N/m.
        """
        rod, element = self._element(body)
        rod.push(element, force, point, stiffness)

    def never_collide(self, number: int) -> NDArray[np.bool_]:
        """Pairs (parts, elements) of `colliders` and a rod that the scene keeps from colliding."""
        return self._exclusions[number].of_scene

    def exclude(self, number: int, bodies: Sequence[int], element: int | None) -> None:
        """Disable collision of ``bodies`` with the elements around ``element`` of rod ``number``; None enables it."""
        places = np.arange(len(self.rods[number].positions))
        beside = np.abs(places - element) < NEXT_TO_PADS if element is not None else None
        for body in bodies:
            self._exclusions[number].between_pads(self.colliders.parts_of(body), beside)

    def update_masses(self, masses: Masses) -> None:
        """Read mass and inertia of the bodies that may meet a rod, and whether they are held or fall."""
        for rod in self.rods:
            for partner in rod.partners:
                held = masses.is_held(partner.body)
                mass, inertia = masses.mass_of(partner.body) if held else (partner.mass, partner.inertia)
                if not partner.fixed:
                    rod.set_mass(partner, mass, inertia, held)

    def write_state(self, state: StateRecord) -> None:
        """Write poses, twists and tension of the elements of every rod into a state record."""
        fields = self._fields.of(state)
        for rod in self.rods:
            if self._fields.fresh:
                rod.report_to(*fields)
            rod.write()

    def is_attached(self, body: int, element_body: int) -> bool:
        """Whether `attach` holds the element ``element_body`` to ``body``."""
        rod, element = self._element(element_body)
        return any((constraint.element, constraint.body) == (element, body) for constraint in rod.constraints)

    def reset(self) -> None:
        """Reset every rod to its initial shape, at rest."""
        for rod, exclusions in zip(self.rods, self._exclusions, strict=True):
            rod.reset()
            exclusions.restart()
        self.colliders.reset()

    def take_problems(self) -> list[Diagnostic]:
        """Problems since the last call."""
        found, self.problems = self.problems, []
        return found

    def _report_inside(self, number: int, found: list[tuple[int, int, float]]) -> None:
        """Report the deepest of the overlaps in which a rod starts, once."""
        if not found or self._reported[number]:
            return
        self._reported[number] = True
        part, element, depth = max(found, key=lambda overlap: overlap[2])
        one, other = (
            self._names[self.rods[number].description.bodies[element]],
            self._names[self.colliders.body_of(part)],
        )
        message = (
            f"'{one}' of an attached rod starts {length(depth)} inside '{other}'; such elements do not collide "
            "with it until they have separated"
        )
        self.problems.append(Diagnostic(Severity.WARNING, message, None, "move the rod or the body", "overlap"))

    def _heal(self, rod: Rod) -> None:
        """Put a rod that diverged back to its initial shape, and report it."""
        rod.reset()
        self._exclusions[self.rods.index(rod)].look()
        message = f"rod '{rod.description.name}' diverged and was reset to its initial shape"
        self.problems.append(Diagnostic(Severity.ERROR, message, code="diverged"))

    def snapshot(self) -> dict[str, Any]:
        """Everything that lasts from tick to tick."""
        return {
            "rods": [rod.snapshot() for rod in self.rods],
            "exclusions": [exclusions.snapshot() for exclusions in self._exclusions],
            "colliders": self.colliders.snapshot(),
            "reported": list(self._reported),
        }

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`."""
        for rod, state in zip(self.rods, snapshot["rods"], strict=True):
            rod.restore(state)
        for exclusions, state in zip(self._exclusions, snapshot["exclusions"], strict=True):
            exclusions.restore(state)
        self.colliders.restore(snapshot["colliders"])
        self._reported = list(snapshot["reported"])


def _partner(scene: Scene, index: int, free: bool) -> Partner:
    """A body as a partner of rods; a link of an arm recoils with its own mass alone."""
    body = scene.bodies[index]
    ball = 0.4 * body.mass * 1e-6
    return Partner(
        body=index,
        mass=body.mass,
        inertia=np.where(body.inertia > 0.0, body.inertia, ball),
        T_body_inertial=body.T_body_inertial,
        gravity=body.gravity if free else np.zeros(3),
        fixed=body.static,
    )
