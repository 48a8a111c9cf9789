"""Where joints start, and how loops close: the coordinates that best agree with where the files place the bodies.

A joint starts where its bodies' ``location`` states; loops are then
assembled by Gauss-Newton steps of least change over the joints and free bases that take part. I is a body's inertial
frame, A and B are a joint's frames; metres, radians.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ligature.adf import Diagnostic, Severity
from ligature.adf.diagnostics import length
from ligature.model.axes import axes_of
from ligature.model.axis import Axis
from ligature.model.frames import axis_rotation, frame, inverse, matrix_quaternion, matrix_rpy
from ligature.model.mechanism import Chain, Mechanism, chain_of, rotation
from ligature.model.scene import Articulation, Body, Closure, Joint, JointType, Start
from ligature.model.trees import MOST_LINKS, links_of

Array = NDArray[np.float64]

PLACED_M, PLACED_RAD = 0.01, 0.05
"""How far a location may be off its joint to still count as the start of the joint.

Files with three digits are off by up to 2 mm and 0.003 rad; those whose locations mean nothing by decimetres.
"""

ROUNDING = 1e-3
"""Positions (m, rad) below which a location that was rounded to three digits means zero."""

REPORTED_M, REPORTED_RAD = 2e-3, 0.02
"""A body that starts at least this far from where its joint and its location agree is reported."""

CLOSED = 1e-9
"""Gap in metres at which a loop counts as closed."""

FRAME_M, FRAME_RAD = 1.5e-3, 0.01
"""Metres and radians by which a joint's frame may be corrected so that its loop closes.

Rounding to three digits moves a pivot by 0.9 mm; axes that are meant to be parallel are up to 0.008 rad apart.
"""

CORRECTIONS = 5
"""Rounds of corrections; each squares what is left open."""

CONSISTENT = 1e-6
"""Gap (m, rad) up to which what the other joints hold as well is held twice: two that agree do not fight."""

OPEN = 1e-4
"""Gap in metres from which on an open loop is reported."""

STEPS = 30
"""Gauss-Newton steps; four are usual, each step at a limit costs one more."""

REDUNDANT = 0.02
"""Motion of a loop's ends, per motion of its mechanism, both relative to its size, below which the other joints hold.

Rounding tilts axes that are meant to be parallel by up to 0.008 rad.
"""

SAMPLES, SAMPLE_STEP = 10, 0.3
"""Configurations in which redundancy is looked for, and the largest coordinate (rad) of the step to each."""


def joint_coordinates(joint: Joint, D: Array) -> tuple[Array, float, float]:
    """Positions of a joint's axes where frame B stands at ``D`` (4, 4) in A, and what D is off them (m, rad)."""
    axes = axes_of(joint) or ()
    roll, pitch, yaw = matrix_rpy(D[:3, :3])
    six = np.array([*D[:3, 3], roll, pitch, yaw])
    values = np.array([six[int(np.argmax(axis.direction)) + (0 if axis.prismatic else 3)] for axis in axes])
    for i, axis in enumerate(axes):
        if not axis.prismatic and axis.low is not None and axis.high is not None:
            turns = np.round(((axis.low + axis.high) / 2 - values[i]) / (2 * np.pi))
            values[i] += 2 * np.pi * turns
    E = inverse(motion(axes, values)) @ D
    if joint.type is JointType.P2P:
        return values, float(np.linalg.norm(E[:3, 3])), 0.0
    return values, float(np.linalg.norm(E[:3, 3])), _angle(E[:3, :3])


def clipped(axis: Axis, value: float) -> float:
    """``value`` within the limits of an axis."""
    low = -np.inf if axis.low is None else axis.low
    high = np.inf if axis.high is None else axis.high
    return float(min(max(value, low), high))


def motion(axes: Sequence[Axis], values: Array) -> Array:
    """Pose (4, 4) of frame B in A at the positions ``values`` of the axes."""
    T = np.eye(4)
    for axis, q in zip(axes, values, strict=True):
        if axis.prismatic:
            T = T @ frame(np.eye(3), q * axis.direction)
        else:
            T = T @ frame(axis_rotation(axis.direction, q), (0.0, 0.0, 0.0))
    return T


def _angle(R: Array) -> float:
    q = matrix_quaternion(R)
    return 2.0 * math.atan2(np.linalg.norm(q[:3]), abs(q[3]))


def assemble(
    bodies: Sequence[Body], joints: list[Joint], forest: Sequence[Articulation], loops: Sequence[int]
) -> tuple[Start, tuple[Closure, ...], list[Diagnostic]]:
    """Where the trees of a scene start, how its loops are held, and what does not stand where its file states.

    Parameters
    ----------
    bodies, joints
        Of the whole scene; the pivots of joints whose roundings keep a loop open are corrected in place.
    forest, loops
        The spanning trees, and the joints that no tree holds.
    """
    builder = _Assembly(bodies, joints, forest, loops)
    return builder.start(), tuple(builder.closures), builder.diagnostics


def coupled(
    bodies: Sequence[Body], joints: Sequence[Joint], forest: Sequence[Articulation], loops: Sequence[Chain]
) -> list[tuple[list[int], list[Chain]]]:
    """Trees that ``loops`` couple, with the loops; point-to-point joints last: files add them to complete ones."""
    tree_of = {link.body: k for k, tree in enumerate(forest) for link in tree.links}
    static = {k for k, tree in enumerate(forest) if len(tree.links) == 1 and bodies[tree.links[0].body].static}
    group = list(range(len(forest)))

    def find(k: int) -> int:
        while group[k] != k:
            k = group[k]
        return k

    for chain in loops:
        ends = [tree_of[body] for body in (chain.inner, chain.outer)]
        if not static & set(ends):
            a, b = (find(k) for k in ends)
            group[max(a, b)] = min(a, b)
    found: dict[int, tuple[list[int], list[Chain]]] = {}
    for chain in loops:
        ends = [tree_of[body] for body in (chain.inner, chain.outer)]
        moving = next(k for k in ends if k not in static)
        trees, chains = found.setdefault(find(moving), ([], []))
        chains.append(chain)
        trees += [k for k in dict.fromkeys(ends) if k not in trees]
    for trees, chains in found.values():
        trees.sort()
        chains.sort(key=lambda chain: (joints[chain.joint].type is JointType.P2P, chain.joint))
    return list(found.values())


class _Assembly:
    """The steps of `assemble`."""

    def __init__(
        self, bodies: Sequence[Body], joints: list[Joint], forest: Sequence[Articulation], loops: Sequence[int]
    ) -> None:
        self.bodies, self.joints, self.forest = bodies, joints, forest
        self.diagnostics: list[Diagnostic] = []
        self.tree_of = {link.body: k for k, tree in enumerate(forest) for link in tree.links}
        self.links = [
            sum(links_of(joints[link.joint]) for link in tree.links if link.joint is not None) for tree in forest
        ]
        self.chains = [self._chain(joints[j]) for j in loops if self._closes(joints[j]) and self._fits(joints[j])]
        self.coordinates: dict[int, Array] = {}
        self.roots = {tree.links[0].body: bodies[tree.links[0].body].T_world_body for tree in forest}
        looped = {t for chain in self.chains for t in (self.tree_of[chain.inner], self.tree_of[chain.outer])}
        for k, tree in enumerate(forest):
            for link in tree.links[1:]:
                assert link.joint is not None
                self._place(joints[link.joint], link.body, exact=k in looped)
        self.closures: list[Closure] = []
        for trees, chains in coupled(bodies, joints, forest, self.chains):
            self._close(trees, chains)

    def start(self) -> Start:
        """The coordinates found."""
        return Start({j: tuple(q.tolist()) for j, q in self.coordinates.items()}, self.roots)

    # --- joints of trees --------------------------------------------------------------------

    def _place(self, joint: Joint, outer: int, exact: bool) -> None:
        """Start a joint where the locations state; report the body that cannot be there."""
        D = self._located(joint)
        values, metres, radians = joint_coordinates(joint, D)
        axes = axes_of(joint) or ()
        if metres > PLACED_M or radians > PLACED_RAD:
            values = np.zeros(len(axes))
        elif not exact:
            values = np.where(np.abs(values) < ROUNDING, 0.0, values)
        values = np.array([clipped(axis, q) for axis, q in zip(axes, values, strict=True)])
        self.coordinates[joint.index] = values
        E = inverse(motion(axes, values)) @ D
        metres, radians = float(np.linalg.norm(E[:3, 3])), _angle(E[:3, :3])
        if metres > REPORTED_M or radians > REPORTED_RAD:
            name, key = self.bodies[outer].identity.identifier, joint.identity.key
            message = (
                f"'{name}' starts {length(metres)} and {radians:.3g} rad away from its location: "
                f"joint '{key}' requires it"
            )
            hint = "move the body, or the joint's pivots, axes, offset and limits"
            self.diagnostics.append(Diagnostic(Severity.INFO, message, joint.identity.mark, hint, "moved"))

    def _located(self, joint: Joint) -> Array:
        """Frame B of a joint in A where the files place its bodies."""
        parent, child = self.bodies[joint.parent], self.bodies[joint.child]
        T_world_a = parent.T_world_body @ parent.T_body_inertial @ joint.T_parent_a
        T_world_b = child.T_world_body @ child.T_body_inertial @ joint.T_child_b
        return inverse(T_world_a) @ T_world_b

    # --- loops ------------------------------------------------------------------------------

    def _closes(self, joint: Joint) -> bool:
        """Whether a joint can close a loop; report one that cannot."""
        ends = (joint.parent, joint.child)
        if all(end in self.tree_of for end in ends) and not all(self.bodies[end].static for end in ends):
            return True
        one, two = (self.bodies[end].identity.identifier for end in ends)
        if all(end in self.tree_of for end in ends):
            why, hint = f"neither '{one}' nor '{two}' has a mass", "set a mass on one of them, or remove the joint"
        else:
            why, hint = f"'{one}' or '{two}' is an element of a rod", "opt out with 'ligature rod: false'"
        message = f"joint '{joint.identity.key}' has no effect: {why}"
        self.diagnostics.append(Diagnostic(Severity.INFO, message, joint.identity.mark, hint, "loop"))
        return False

    def _fits(self, joint: Joint) -> bool:
        """Whether the tree from which a closing joint starts has room for another link; report a tree that is full."""
        inner = self._chain(joint).inner
        tree = self.tree_of[inner]
        needed = 0 if joint.type is JointType.P2P else links_of(joint)
        if self.links[tree] + needed <= MOST_LINKS:
            self.links[tree] += needed
            return True
        root = self.bodies[self.forest[tree].links[0].body].identity.identifier
        message = (
            f"joint '{joint.identity.key}' is left out: with it the bodies joined to '{root}' have more than "
            f"{MOST_LINKS} degrees of freedom"
        )
        hint = "join fewer bodies to it, or make joints of theirs fixed by merging bodies"
        self.diagnostics.append(Diagnostic(Severity.ERROR, message, joint.identity.mark, hint, "loop"))
        return False

    def _chain(self, joint: Joint) -> Chain:
        return chain_of(joint, forward=not self.bodies[joint.child].static)

    def _close(self, trees: list[int], chains: list[Chain]) -> None:
        """Assemble the loops of one mechanism, and find what of them its other joints hold already."""
        for chain in chains:
            joint = self.joints[chain.joint]
            values, _, _ = joint_coordinates(joint, self._located(joint))
            limits = axes_of(joint) or ()
            self.coordinates[chain.joint] = np.array([clipped(a, q) for a, q in zip(limits, values, strict=True)])
        mechanism = self._mechanism(trees, chains)
        x = mechanism.gather(self.coordinates, self.roots)
        before, file_gap = mechanism.poses(x), float(mechanism.gaps(x)[:, 0].max())
        x = mechanism.solve(x, STEPS, CLOSED, REDUNDANT)
        mechanism, places, corrected = self._corrected(mechanism, x, trees)
        chains, x = mechanism.chains, places[0]
        redundant, slack = self._redundant(mechanism, places)
        mechanism.scatter(x, self.coordinates, self.roots)
        after = mechanism.poses(x)
        moved = {body: float(np.linalg.norm(after[body][:3, 3] - before[body][:3, 3])) for body in after}
        self._report_assembled(mechanism, x, moved, file_gap, corrected)
        for k, chain in enumerate(chains):
            # with no link left a direction that the others hold as well is held twice
            tree = self.tree_of[chain.inner]
            free = redundant[k] if self.links[tree] + len(redundant[k]) <= MOST_LINKS else ()
            self.links[tree] += len(free)
            self.closures.append(Closure(chain.joint, chain.inner, chain.outer, free, slack[k]))
            if free:
                self._report_redundant(chain, slack[k])

    def _mechanism(self, trees: list[int], chains: list[Chain]) -> Mechanism:
        return Mechanism(self.bodies, self.joints, [self.forest[k] for k in trees], chains)

    def _corrected(
        self, mechanism: Mechanism, x: Array, trees: list[int]
    ) -> tuple[Mechanism, list[Array], tuple[float, float]]:
        """Correct frames of joints by what roundings do to them, so that the loops close wherever they can go.

        Where that takes more than roundings, they are to close at the start at least. Returns the mechanism, places
        that it can go to, the start first, and the largest corrections (m, rad).
        """
        places = self._places(mechanism, x)
        ranks = [mechanism.rank(place, 3.0 * REDUNDANT) for place in places]
        # near a singular place a gap is not one of the files, and closing it there takes large corrections
        places = [x, *(place for place, rank in zip(places[1:], ranks[1:], strict=True) if rank == max(ranks))]
        return (
            self._close_at(mechanism, places, trees)
            or self._close_at(mechanism, places[:1], trees, places[1:])
            or (mechanism, places, (0.0, 0.0))
        )

    def _close_at(
        self, mechanism: Mechanism, places: list[Array], trees: list[int], others: Sequence[Array] = ()
    ) -> tuple[Mechanism, list[Array], tuple[float, float]] | None:
        """Correct frames so that the loops close at ``places``; None if that takes more than roundings."""
        joints = list(self.joints)
        total = {index: np.zeros((4, 3)) for index in mechanism.inner_of()}
        size = np.zeros(2)
        for _ in range(CORRECTIONS):
            if max(float(mechanism.gaps(place)[:, 0].max()) for place in places) < CLOSED:
                break
            moves, inner = mechanism.corrections(places, REDUNDANT), mechanism.inner_of()
            for index, move in moves.items():
                total[index] += move
                self.joints[index] = _shifted(self.joints[index], inner[index], move, self.bodies)
            size = np.abs(list(total.values())).max(axis=(0, 2)).reshape(2, 2).max(axis=0)
            if size[0] > FRAME_M or size[1] > FRAME_RAD:
                self.joints[:] = joints
                return None
            chains = [self._chain(self.joints[chain.joint]) for chain in mechanism.chains]
            mechanism = self._mechanism(trees, chains)
            mechanism.gather(self.coordinates, self.roots)
            places = [mechanism.solve(place, STEPS, CLOSED, REDUNDANT) for place in places]
        return mechanism, [*places, *others], (float(size[0]), float(size[1]))

    def _places(self, mechanism: Mechanism, x: Array) -> list[Array]:
        """The configuration ``x`` (n,) and others, sampled by a random walk within the joint limits."""
        rng, places = np.random.default_rng(0), [x]
        for _ in range(SAMPLES):
            trial = mechanism.wandered(places[-1], rng, SAMPLE_STEP, REDUNDANT)
            trial = mechanism.solve(trial, STEPS, CLOSED, REDUNDANT)
            if mechanism.hard_gap(trial, REDUNDANT) < 1e-4 * mechanism.size:
                places.append(trial)
        return places

    def _redundant(self, mechanism: Mechanism, places: list[Array]) -> tuple[list[tuple[Axis, ...]], list[float]]:
        """Directions of each loop that other joints constrain at all ``places``, and the gaps along them in metres."""
        grams = [np.zeros((6, 6)) for _ in mechanism.chains]
        for place in places:
            for k, gram in enumerate(mechanism.freedoms(place, REDUNDANT)):
                grams[k] += gram
        gaps = np.max([mechanism.gaps(place).max(axis=1) for place in places], axis=0)
        found, slack = [], []
        stuck = len(places) == 1 and mechanism.tangent(places[0], REDUNDANT).shape[1] > 0
        for k, chain in enumerate(mechanism.chains):
            free: list[Axis] = []
            for offset, prismatic in ((0, True), (3, False)):
                if stuck or (not prismatic and chain.point):
                    continue
                block = grams[k][offset : offset + 3, offset : offset + 3]
                scale, directions = np.linalg.eigh(block)
                free += [
                    Axis(prismatic, _signed(directions[:, i]))
                    for i in range(3)
                    if np.sqrt(max(scale[i], 0.0)) < REDUNDANT
                ]
            open_by = float(gaps[k])
            found.append(tuple(free) if open_by > CONSISTENT else ())
            slack.append(open_by if free else 0.0)
        return found, slack

    def _report_assembled(
        self, mechanism: Mechanism, x: Array, moved: dict[int, float], file_gap: float, corrected: tuple[float, float]
    ) -> None:
        first = self.joints[mechanism.chains[0].joint].identity
        left = float(mechanism.gaps(x)[:, 0].max())
        furthest = max(moved, key=lambda body: moved[body])
        name = self.bodies[furthest].identity.identifier
        others = len(mechanism.chains) - 1
        loops = f"'{first.key}'" + (f" and {others} more" if others else "")
        if left > OPEN:
            message = f"the loop of joint {loops} does not close: {length(left)} remain"
            hint = "correct the joint's pivots, or widen the limits of the joints of the loop"
            self.diagnostics.append(Diagnostic(Severity.WARNING, message, first.mark, hint, "loop"))
        elif file_gap > OPEN:
            message = (
                f"the loop of joint {loops} is open by {length(file_gap)} and closes as it starts: "
                f"'{name}' moves furthest, by {length(moved[furthest], 2)}, "
                f"pivots by up to {length(corrected[0], 2)}"
            )
            severity = Severity.WARNING if moved[furthest] > PLACED_M else Severity.INFO
            self.diagnostics.append(Diagnostic(severity, message, first.mark, "", "loop"))

    def _report_redundant(self, chain: Chain, slack: float) -> None:
        joint = self.joints[chain.joint]
        if slack > OPEN:
            message = (
                f"joint '{joint.identity.key}' is redundant in its loop; "
                f"where it contradicts the other joints, it opens by up to {length(slack, 2)}"
            )
            self.diagnostics.append(Diagnostic(Severity.INFO, message, joint.identity.mark, "", "loop"))


def _shifted(joint: Joint, inner: int, move: Array, bodies: Sequence[Body]) -> Joint:
    """A joint whose frames on its inner and outer body are moved by ``move`` (4, 3) of `Mechanism.corrections`."""
    forward = joint.parent == inner
    first, second = (joint.T_parent_a, joint.T_child_b) if forward else (joint.T_child_b, joint.T_parent_a)
    first, second = moved(first, move[0], move[1]), moved(second, move[2], move[3])
    T_a, T_b = (first, second) if forward else (second, first)
    parent, child = bodies[joint.parent], bodies[joint.child]
    T_zero = parent.T_body_inertial @ T_a @ inverse(child.T_body_inertial @ T_b)
    axis = T_a[:3, 0 if joint.type is JointType.PRISMATIC else 2].copy()
    return replace(joint, axis=axis, T_parent_a=T_a, T_child_b=T_b, T_parent_child_zero=T_zero)


def moved(T: Array, shift: Array, turn: Array) -> Array:
    """A frame (4, 4) shifted and turned about its origin, both (3,) in the axes that it is given in."""
    return frame(rotation(turn) @ T[:3, :3], T[:3, 3] + shift)


def _signed(direction: Array) -> Array:
    """A direction (3,) with its largest component positive, so that the result is one on every machine."""
    return np.asarray(direction * np.sign(direction[int(np.argmax(np.abs(direction)))]))
