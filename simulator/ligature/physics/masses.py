"""Masses of bodies in their response to forces: larger while pads hold a light body or a command drives it.

World axes, SI units.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
import pybullet
from numpy.typing import NDArray

from ligature.model.subsystem import kept, put_back
from ligature.physics.articulation import is_alone
from ligature.physics.bodies import Placement
from ligature.physics.body_commands import BodyCommands
from ligature.physics.engine import Engine
from ligature.physics.inertias import inertia_of
from ligature.physics.trees import push_bodies
from ligature.physics.welds import Welds

Array = NDArray[np.float64]

MIN_HELD_MASS = 0.05
"""Minimum mass in kg of a held body in its response to forces; its weight stays its own, the rest moves with the
holder.

The holder is an arm of kilograms. Stiff pads and a taut thread would throw a needle of 0.1 g from one to the other
within a tick: a force F meets the next reaction only after F dt²/m, 11 mm for 1 N.
"""

MIN_COMMANDED_MASS = 0.5
"""Minimum mass in kg of a body whose velocity a command sets in each tick: that of the challenge's needle.

Such a body pushes with its own momentum: one of 0.1 g with 3 mN at 30 mm/s, which does not open the rim of a hole.
"""

IMMOVABLE = 1e6
"""Mass in kg, and inertia, that no thread or tissue moves in a tick."""


class Masses:
    """The masses of an engine's bodies, by who holds and commands them.

    Attributes
    ----------
    laden, lifts
        (n,) bodies with added mass, and the forces (n, 3) that cancel its weight.
    """

    def __init__(self, engine: Engine, commands: BodyCommands, welds: Welds) -> None:
        self._engine, self._commands, self._welds = engine, commands, welds
        bodies = engine.scene.bodies
        self._free_bodies = {tree.root for tree in engine.trees if is_alone(tree, bodies)}
        self._light_bodies = {body for body in self._free_bodies if bodies[body].mass < MIN_COMMANDED_MASS}
        self._hold_counts: dict[int, int] = {}
        self._grasp_counts: dict[int, int] = {}
        self._attached_loads: dict[int, tuple[Placement, Array]] = {}
        self._list_loads()
        self._scaled: dict[tuple[float, int], tuple[float, Array]] = {}

    def set_held(self, body: int, held: bool, grasped: bool = False) -> None:
        """Count one more holder of ``body``, or one less; a body that pads have ``grasped`` gets added mass.

        A welded body needs none: it is as heavy as its holder.
        """
        change = 1 if held else -1
        for counts in (self._hold_counts, self._grasp_counts) if grasped else (self._hold_counts,):
            counts[body] = counts.get(body, 0) + change
            if counts[body] == 0:
                del counts[body]
        if grasped and body in self._free_bodies:
            self._update(body)

    def is_held(self, body: int) -> bool:
        """Whether something holds a body."""
        return body in self._hold_counts

    def mass_of(self, body: int) -> tuple[float, Array]:
        """Mass and principal moments (3,) of a body in its response to forces now."""
        held = body in self._free_bodies and self.is_held(body)
        return self._at_least(MIN_HELD_MASS if held else 0.0, body)

    def attached_load(self, body: int) -> tuple[float, Array, Array]:
        """What holds a body, and pulls at it in the coming tick: mass, inertia (3,), and commanded wrench (6,)."""
        if self._commands.driven(body):
            return IMMOVABLE, np.full(3, IMMOVABLE), np.zeros(6)
        (own_mass, own_inertia), (held_mass, held_inertia) = self._at_least(0.0, body), self.mass_of(body)
        mass, inertia = held_mass - own_mass, held_inertia - own_inertia
        for palm in self._welds.parents(body):
            palm_mass, palm_inertia = self._at_least(0.0, palm)
            mass, inertia = mass + palm_mass, inertia + palm_inertia.max()
        return mass, inertia, self._commands.wrench(body)

    def carry(self, body: int, wrench: Array) -> None:
        """Apply ``wrench`` (6,) in the coming tick, which moves the added mass of a body with its holders."""
        if self.is_laden(body):
            self._attached_loads[body][0].apply_wrench(wrench.tolist())

    def is_laden(self, body: int) -> bool:
        """Whether a body has added mass."""
        return body in self._attached_loads

    def lift(self) -> None:
        """Cancel the weight of added mass in the coming tick."""
        engine = self._engine
        if not self._attached_loads:
            return
        if engine.motions.handle:
            push_bodies(engine.motions.handle, engine.motions.table, engine.place_table, self.laden, self.lifts)
            return
        for place, force in self._attached_loads.values():
            place.apply_force(force)

    def _list_loads(self) -> None:
        """List bodies with added mass, and the forces (n, 3) that cancel its weight, for compiled code."""
        self.laden = np.array(list(self._attached_loads), dtype=np.int64)
        self.lifts = np.array([force for _, force in self._attached_loads.values()]).reshape(-1, 3)

    def update_commanded(self, body: int, before: bool) -> None:
        """Update the mass of a light free body that was driven ``before`` a command began or ended."""
        if body in self._light_bodies and self._commands.driven(body) != before:
            self._update(body)

    def _update(self, body: int) -> None:
        """Set the mass of a body in Bullet, and record the force that corrects the weight of the added part.

        A held body keeps its own weight; a commanded body falls as before, and its command corrects that.
        """
        place, commanded = self._engine.place_of[body], self._commands.driven(body)
        least = MIN_COMMANDED_MASS if commanded else MIN_HELD_MASS if body in self._grasp_counts else 0.0
        mass, inertia = self._at_least(least, body)
        pybullet.changeDynamics(
            place.uid, -1, mass=mass, localInertiaDiagonal=inertia.tolist(), physicsClientId=self._engine.client
        )
        self._engine.motions.rouse(place.tree)
        arrays = self._engine.motions.trees
        arrays.mass[place.row], arrays.inertia[place.row] = mass, inertia
        extra = mass - place.body.mass
        if extra > 0.0:
            fall = place.body.gravity if commanded else np.zeros(3)
            self._attached_loads[body] = place, extra * (fall - self._engine.gravity)
        else:
            self._attached_loads.pop(body, None)
        self._list_loads()

    def _at_least(self, mass: float, body: int) -> tuple[float, Array]:
        """Mass and principal moments (3,) of a body, scaled up to ``mass``."""
        known = self._scaled.get((mass, body))
        if known is None:
            described = self._engine.scene.bodies[body]
            scale = mass / described.mass if mass > described.mass else 1.0
            known = scale * described.mass, scale * inertia_of(described)
            known[1].flags.writeable = False
            self._scaled[mass, body] = known
        return known

    def restart(self) -> None:
        """Begin anew: only welds hold bodies."""
        self._hold_counts, self._grasp_counts = dict(Counter(self._welds.children)), {}
        self._set_all()

    def snapshot(self) -> dict[str, Any]:
        """What lasts from tick to tick."""
        return kept(self, _KEPT)

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`, after commands were restored."""
        put_back(self, snapshot)
        self._set_all()

    def _set_all(self) -> None:
        """Set the masses of grasped and commanded bodies, and of those that no longer are."""
        for body in sorted(self._free_bodies):
            loaded = body in self._attached_loads or body in self._grasp_counts
            if loaded or (body in self._light_bodies and self._commands.driven(body)):
                self._update(body)


_KEPT = ("_hold_counts", "_grasp_counts")
"""Attributes that last from tick to tick; the attached loads follow from them and from commands."""
