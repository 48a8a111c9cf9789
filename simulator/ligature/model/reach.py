"""How far joints of closed loops can move before the limits of other joints in the loop stop them.

Kinematic: a joint is moved along its range while the other joints of its mechanism follow within their limits, as in
`ligature.model.assembly`. Metres, radians.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ligature.adf import Diagnostic, Severity
from ligature.model.assembly import CLOSED, OPEN, REDUNDANT, STEPS, coupled
from ligature.model.mechanism import Chain, Mechanism, chain_of
from ligature.model.scene import Joint, JointType, Scene

Array = NDArray[np.float64]

MOTORISED = (JointType.REVOLUTE, JointType.PRISMATIC)
"""Joints with motors."""

PARTS, HALVINGS = 16, 4
"""Steps along the range of a joint, and halvings of the one at which its loop opens."""

UNREPORTED = 0.02
"""Part of its range by which a joint may stop short of its limit without a report."""

AT_LIMIT = 1e-6
"""Distance from a limit at which a joint counts as stopped by it."""

MAX_COORDINATES = 64
"""Coordinates of the largest mechanism that is looked at: the time grows with their third power."""


@dataclass(frozen=True)
class Reach:
    """Where a joint starts, where it stops in each direction, and the joints that stop it, if any."""

    joint: int
    start: float
    low: float
    high: float
    stopped_low: tuple[int, ...] = ()
    stopped_high: tuple[int, ...] = ()


def reaches(scene: Scene) -> list[Reach]:
    """How far each joint of a loop goes that has limits and can be commanded; large mechanisms are left out."""
    chains = _chains(scene)
    slack = {c.joint: c.slack for c in scene.closures}
    commanded = {joint for body in scene.bodies for joint in body.joints}
    coordinates = {j: np.array(q) for j, q in scene.start.coordinates.items()}
    found = []
    for mechanism, members in _mechanisms(scene, chains):
        x = mechanism.gather(coordinates, scene.start.roots)
        if len(x) > MAX_COORDINATES:
            continue
        allowed = np.maximum(mechanism.gaps(x)[:, 0], [slack[chain.joint] for chain in members]) + OPEN
        found += [
            _reach(mechanism, x, scene.joints[index], allowed)
            for index in sorted(mechanism.inner_of())
            if index in commanded and scene.joints[index].type in MOTORISED and _limited(scene.joints[index])
        ]
    return found


def _chains(scene: Scene) -> list[Chain]:
    return [chain_of(scene.joints[c.joint], scene.joints[c.joint].child == c.outer) for c in scene.closures]


def _mechanisms(scene: Scene, chains: list[Chain]) -> Iterator[tuple[Mechanism, list[Chain]]]:
    for trees, members in coupled(scene.bodies, scene.joints, scene.articulations, chains):
        yield Mechanism(scene.bodies, scene.joints, [scene.articulations[k] for k in trees], members), members


def findings(scene: Scene) -> list[Diagnostic]:
    """A finding for each joint that its loop stops short of a limit, and for mechanisms that are left out."""
    coordinates = {j: np.array(q) for j, q in scene.start.coordinates.items()}
    found = []
    for mechanism, members in _mechanisms(scene, _chains(scene)):
        size = len(mechanism.gather(coordinates, scene.start.roots))
        if size > MAX_COORDINATES:
            joint = scene.joints[members[0].joint]
            message = (
                f"the loop of joint '{joint.identity.key}' has {size} coordinates; reaches are computed for at most "
                f"{MAX_COORDINATES}, so its joints may stop short of their limits"
            )
            found.append(Diagnostic(Severity.INFO, message, joint.identity.mark, "", "reach"))
    for reach in reaches(scene):
        joint = scene.joints[reach.joint]
        assert joint.low is not None and joint.high is not None
        short = UNREPORTED * (joint.high - joint.low)
        for stop, limit, stopping in (
            (reach.low, joint.low, reach.stopped_low), (reach.high, joint.high, reach.stopped_high),
        ):  # fmt: skip
            if abs(stop - limit) > short:
                names = " and ".join(f"'{scene.joints[j].identity.key}'" for j in stopping)
                verb = "is at its limit" if len(stopping) == 1 else "are at their limits"
                why = f"{names} {verb}" if names else "its loop is stretched"
                message = f"joint '{joint.identity.key}' stops at {stop:.3g}, short of its limit {limit:.3g}: {why}"
                found.append(Diagnostic(Severity.INFO, message, joint.identity.mark, "", "reach"))
    return found


def _limited(joint: Joint) -> bool:
    return joint.low is not None and joint.high is not None and joint.low < joint.high


def _reach(mechanism: Mechanism, x: Array, joint: Joint, allowed: Array) -> Reach:
    column = mechanism.column(joint.index)
    ends, stopping = [], []
    assert joint.low is not None and joint.high is not None
    for limit in (joint.low, joint.high):
        end, stopped = _move_to(mechanism, x, column, limit, (joint.high - joint.low) / PARTS, allowed)
        ends.append(float(end[column]))
        stopping.append(() if stopped is None else _at_limits(mechanism, stopped, column))
    return Reach(joint.index, float(x[column]), ends[0], ends[1], stopping[0], stopping[1])


def _move_to(
    mechanism: Mechanism, x: Array, column: int, limit: float, step: float, allowed: Array
) -> tuple[Array, Array | None]:
    """The last configuration (n,) with closed loops on the way to ``limit``, and the open one beyond it, or None."""
    open_one = None
    halvings = 0
    while x[column] != limit and halvings <= HALVINGS:
        trial = x.copy()
        trial[column] += np.clip(limit - x[column], -step, step)
        if abs(trial[column] - limit) < 1e-12:
            trial[column] = limit
        trial = mechanism.solve(trial, STEPS, CLOSED, REDUNDANT, kept=(column,))
        if (mechanism.gaps(trial)[:, 0] <= allowed).all():
            x = trial
        else:
            open_one, step, halvings = trial, step / 2, halvings + 1
    return x, open_one if x[column] != limit else None


def _at_limits(mechanism: Mechanism, opened: Array, column: int) -> tuple[int, ...]:
    """The joints that were at a limit where the loops opened."""
    held = (opened <= mechanism.low + AT_LIMIT) | (opened >= mechanism.high - AT_LIMIT)
    held[column] = False
    return tuple(index for index in sorted(mechanism.inner_of()) if held[mechanism.columns(index)].any())
