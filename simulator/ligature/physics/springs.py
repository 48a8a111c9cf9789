"""Springs that start stretched so far that they throw what hangs on them. Metres, kilograms, joules."""

from __future__ import annotations

from ligature.adf import Diagnostic, Severity
from ligature.physics.articulation import STIFFEST, Tree
from ligature.physics.divergence import joined
from ligature.physics.engine import Engine
from ligature.physics.guard import MAX_SPEED


def findings(engine: Engine) -> list[Diagnostic]:
    """A warning for each mechanism whose springs start with the energy to move its lightest body at `MAX_SPEED`.

    A mechanism is a tree with those that loops join to it. That no body of it is faster follows from energy.
    """
    groups = {tuple(sorted(joined(engine, [k]))) for k in range(len(engine.trees))}
    found = [_finding(engine, group) for group in sorted(groups)]
    return [finding for finding in found if finding is not None]


def _finding(engine: Engine, group: tuple[int, ...]) -> Diagnostic | None:
    scene, trees = engine.scene, [engine.trees[k] for k in group]
    energies: dict[int, float] = {}
    for tree in trees:
        for joint, energy in _released(tree, engine.dt):
            energies[joint] = energies.get(joint, 0.0) + energy
    total = sum(energies.values())
    bodies = [scene.bodies[b] for tree in trees for b in tree.link_of if not scene.bodies[b].static]
    if total == 0.0 or not bodies:
        return None
    lightest = min(bodies, key=lambda body: body.mass)
    speed = (2.0 * total / lightest.mass) ** 0.5
    if speed < MAX_SPEED:
        return None
    first = scene.joints[max(energies, key=lambda joint: energies[joint])].identity
    message = (
        f"the spring of joint '{first.key}' starts stretched, with {total:.3g} J, enough to throw "
        f"'{lightest.identity.identifier}' ({lightest.mass:.3g} kg) at {speed:.3g} m/s"
    )
    hint = "start nearer to the equilibrium point, or soften the spring"
    return Diagnostic(Severity.WARNING, message, first.mark, hint, "speed")


def _released(tree: Tree, dt: float) -> list[tuple[int, float]]:
    """Joints with the energy (J) that their springs release from the start to rest, or to a limit before it."""
    found = []
    for (_, joint, axis, moved), start in zip(tree.axes, tree.start, strict=True):
        stiffness = min(axis.stiffness, moved / (STIFFEST * dt**2))
        low = axis.rest if axis.low is None else axis.low
        high = axis.rest if axis.high is None else axis.high
        end = min(max(axis.rest, low), high)
        energy = 0.5 * stiffness * ((start - axis.rest) ** 2 - (end - axis.rest) ** 2)
        if energy > 0.0:
            found.append((joint, energy))
    return found
