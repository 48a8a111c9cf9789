"""All bodies of tissue of a scene, as two subsystems around the step of rods."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ligature.adf import Diagnostic, Severity
from ligature.model.scene import Scene
from ligature.model.state import StateRecord
from ligature.model.subsystem import Subsystem
from ligature.suture.bodies import SutureBodies
from ligature.suture.rods import Rods

if TYPE_CHECKING:
    from ligature.soft.piece import Piece


class Tissues(Subsystem):
    """The bodies of soft tissue of a scene; `BeforeRods` begins their tick, this ends it.

    Parameters
    ----------
    scene
        The scene with the tissue.
    bodies
        Gives motion and masses of the rigid bodies and takes impulses on them; the simulation passes its `World`.
    rods
        The threads, which pass through the tissue and lie on it.
    dt
        Length of a tick in seconds.
    """

    def __init__(self, scene: Scene, bodies: SutureBodies, rods: Rods, dt: float) -> None:
        self._rods = rods
        self.pieces: list[Piece] = []
        if scene.tissues:
            from ligature.soft.piece import Piece  # scenes without tissue start without it and SciPy, 20 MB smaller

            self.pieces = [Piece(scene, tissue, bodies, rods.rods, dt) for tissue in scene.tissues]
        self._names = [scene.bodies[tissue.body].identity.identifier for tissue in scene.tissues]
        self._reported: set[str] = set()
        self._problems: list[Diagnostic] = []

    def begin(self) -> None:
        """Begin the tick, before the rods are solved."""
        for rod in self._rods.rods:
            rod.clear_springs()
        for piece in self.pieces:
            piece.begin()

    def step(self, tick: int) -> None:
        """End the tick, after the rods were solved."""
        for name, piece in zip(self._names, self.pieces, strict=True):
            piece.end()
            if piece.contacts.overflow and name not in self._reported:
                self._reported.add(name)
                message = f"'{name}' has reached its maximum number of contact points; it ignores further ones"
                hint = "use larger cells, or fewer bodies on it"
                self._problems.append(Diagnostic(Severity.WARNING, message, hint=hint, code="tissue"))

    def forget(self, body: int) -> None:
        """Take notice that a body was put elsewhere."""
        for piece in self.pieces:
            piece.forget(body)

    def write_state(self, state: StateRecord) -> None:
        """Write nodes, forces, punctures and insertions; those in holes are written before."""
        for piece in self.pieces:
            piece.write_state(state)
            pushed = piece.block.interface.points.force.any(axis=1)
            state["tissue_contacts"][0, piece.tissue.index] = int(pushed.sum())

    def reset(self) -> None:
        """Whole, at rest and without needles."""
        for piece in self.pieces:
            piece.reset()

    def snapshot(self) -> list[dict[str, Any]]:
        """Everything that lasts from tick to tick."""
        return [piece.snapshot() for piece in self.pieces]

    def restore(self, snapshot: list[dict[str, Any]]) -> None:
        """Continue from `snapshot`."""
        for piece, kept in zip(self.pieces, snapshot, strict=True):
            piece.restore(kept)

    def take_problems(self) -> list[Diagnostic]:
        """What was found since the last call."""
        found, self._problems = self._problems, []
        return found


class BeforeRods(Subsystem):
    """Begins the tick of `Tissues`, which keeps all that lasts."""

    def __init__(self, tissues: Tissues) -> None:
        self._tissues = tissues

    def step(self, tick: int) -> None:
        """Let bodies press the tissue, and hand its springs to the rods."""
        self._tissues.begin()

    def reset(self) -> None:
        """Nothing: it is part of the tissues."""

    def recover(self) -> None:
        """Start the tissues anew."""
        self._tissues.reset()

    def snapshot(self) -> None:
        """Nothing: it is part of the tissues."""

    def restore(self, snapshot: None) -> None:
        """Nothing: it is part of the tissues."""
