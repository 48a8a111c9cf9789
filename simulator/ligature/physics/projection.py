"""Closes loops after every tick: projects mechanisms to the nearest configuration and motion with closed loops.

Bullet solves loops iteratively, along linearised constraints. With links of grams that carry kilograms this does not
converge, and a link that turns by 0.1 rad in a tick leaves the range of the linearisation. So each mechanism is
projected in joint space, with all of its loops at once,

    q ← q − M⁻¹Jᵀ (J M⁻¹Jᵀ)⁻¹ φ(q),    v ← v − M⁻¹Jᵀ (J M⁻¹Jᵀ)⁻¹ J v,

φ being the gaps, J their derivative, M the mass matrix: the nearest place and motion in the metric of kinetic energy,
as impulses of the constraints would bring them about. v loses kinetic energy, or none; it never gains any. Momentum
stays, for the impulses act between bodies. Bullet's own impulses Jᵀλ drop out of the result, so that it does not depend
on how far Bullet got, contacts, motors and limits aside. (Sources: R. Featherstone, Rigid Body Dynamics Algorithms,
2008, §6.2 and §8; U. Ascher, H. Chin, L. Petzold, S. Reich, Stabilization of constrained mechanical systems, 1995.)

Coordinates are the six of each free base (of the centre of mass, then about it, world axes), then the axes of its tree.
`loop_motion` measures gaps and reads and writes coordinates, `loop_matrices` computes M, J and their factors, and
`loop_solver` the steps and speeds; all of them work on the arrays of `loop_arrays`.
"""

from __future__ import annotations

import math

from ligature.kernels import inlined, kernel
from ligature.physics.loop_arrays import Integers, Loops, open_loops
from ligature.physics.loop_matrices import FLAT, prepare
from ligature.physics.loop_motion import gather, link, measure, move_by, scatter, send
from ligature.physics.loop_solver import correct_speeds, find_step, product
from ligature.physics.trees import SLACK, Trees, open_trees, read_tree

CLOSED = 1e-6
"""Gap (m, rad) up to which a loop is left to Bullet, so that mechanisms at rest do not change."""

DONE = 1e-10
"""Gap (m, rad) at which a projection ends: in a flat place 1e-6 m change the direction of the next step by radians."""

PROGRESS, HELD_TWICE = 0.5, 1e-5
"""A step that leaves more than this share of a gap is the last one, if the gap (m, rad) is below the second number.

Rounding errors of redundant joints leave gaps of that size.
"""

PLAY = 1e-4
"""Gap (m, rad) up to which a mechanism in a flat place stays where it is, instead of being moved far back."""

THROWN = 3e-5
"""Displacement (m, rad) of a coordinate by which a projection may exceed the motion of the tick."""

TORN = 0.02
"""Gap (m, rad) from which on a loop is closed over several ticks: a rotation of 0.2 rad in a tick opens it by less."""

STEPS = 8
"""Most Gauss-Newton steps of a projection, and again along flat directions; one or two are usual."""

CURVED = 1e-4
"""Change of a coordinate (m, rad) from which on mass matrix and Jacobian are computed anew."""

STRIDE = 0.2
"""Largest change (m, rad) of a coordinate in one Gauss-Newton step."""


UNMOVED, MOVED, FAILED = 0, 1, 2
"""Result for a mechanism; it fails if its mass matrix has no inverse, or a step is not finite."""


@kernel
def measure_loops(tree_table: Integers, loop_table: Integers) -> float:
    """The widest gap in metres; fills `Loops.gap`. Trees must be up to date, but for their links."""
    trees, loops = open_trees(tree_table), open_loops(loop_table)
    widest = 0.0
    for m in range(loops.size.shape[0]):
        if loops.begin[m] == loops.begin[m + 1]:
            continue
        link(trees, loops, m)
        measure(trees, loops, m)
        for c in range(loops.begin[m], loops.begin[m + 1]):
            widest = max(widest, loops.gap[c])
    return widest


@kernel
def close_loops(handle: int, tree_table: Integers, loop_table: Integers, most: float, dt: float) -> float:
    """Project all mechanisms whose loops are open, or that are too fast; the widest gap that is left, in metres.

    Where a gap is wider than `TORN`, ``most`` metres of it are closed. With a handle, the result is set in Bullet;
    otherwise the caller does so, for the mechanisms that `Loops.moved` states. Trees must be up to date, except their
    links.
    """
    trees, loops = open_trees(tree_table), open_loops(loop_table)
    left = 0.0
    for m in range(loops.size.shape[0]):
        loops.moved[m] = UNMOVED
        looped = loops.begin[m] < loops.begin[m + 1]
        if not (looped or _too_fast(trees, loops, m)):
            continue
        link(trees, loops, m)
        widest = measure(trees, loops, m)
        if widest > CLOSED or not looped or _too_fast(trees, loops, m):
            loops.moved[m] = MOVED if _project(trees, loops, m, widest, most, dt) else FAILED
            for t in range(loops.tree_begin[m], loops.tree_begin[m + 1]):
                k = loops.tree[t]
                if handle != 0:
                    if loops.moved[m] == MOVED:
                        send(handle, trees, loops, k)
                    read_tree(handle, trees, k)  # with the rounding of Bullet
                    trees.linked[k] = False
        for c in range(loops.begin[m], loops.begin[m + 1]):
            left = max(left, loops.gap[c])
    return left


@inlined
def _too_fast(trees: Trees, loops: Loops, m: int) -> bool:
    """Whether a coordinate of mechanism ``m`` exceeds `Loops.most`."""
    gather(trees, loops, m)
    fast = False
    for a in range(loops.size[m]):
        fast = fast or abs(loops.speed[a]) > SLACK * loops.most[a]
    return fast


@kernel
def _project(trees: Trees, loops: Loops, m: int, widest: float, most: float, dt: float) -> bool:
    """Move mechanism ``m``, whose ``widest`` gap is measured, to where its loops are closed; whether that worked."""
    n, rows = loops.size[m], 6 * (loops.begin[m + 1] - loops.begin[m])
    gather(trees, loops, m)
    begun, share = widest, 1.0 if widest <= TORN else most / widest
    moved = math.inf
    flat, firmly, steps = False, share == 1.0, STEPS  # firm rows first: the gap that remains is that of a flat place
    while steps > 0:
        steps -= 1
        if not prepare(trees, loops, m, rows):
            return False
        flat = loops.firm[0] < loops.rank[0]
        if firmly and flat:
            loops.rank[0] = loops.firm[0]
        if not find_step(loops, n, rows, share):
            return False
        moved = 0.0
        for i in range(n):
            moved = max(moved, abs(loops.step[i]))
        part = min(1.0, STRIDE / moved) if moved > 0.0 else 1.0
        move_by(trees, loops, m, part)
        for i in range(n):
            loops.shift[i] += part * loops.step[i]
        link(trees, loops, m)
        before, widest = widest, measure(trees, loops, m)
        if widest <= DONE or share < 1.0:
            break
        if firmly and flat:
            if moved <= THROWN:
                firmly, begun, steps = False, widest, STEPS
                for i in range(n):
                    loops.shift[i] = 0.0
        elif PROGRESS * before < widest <= HELD_TWICE:
            break
    back = _excess(loops, n, begun, dt) if begun <= PLAY else 0.0
    if back > 0.0:
        for i in range(n):
            loops.step[i] = loops.shift[i]
            loops.shift[i] -= back * loops.step[i]
        move_by(trees, loops, m, -back)
        link(trees, loops, m)
        measure(trees, loops, m)
    if (moved > CURVED or back > 0.0 or (firmly and flat)) and not prepare(trees, loops, m, rows):
        return False
    if back > 0.0:  # rows that are not flat are closed nevertheless
        if not find_step(loops, n, rows, 1.0):
            return False
        far = 0.0
        for i in range(n):
            far = max(far, abs(loops.step[i]))
        move_by(trees, loops, m, min(1.0, THROWN / far) if far > 0.0 else 0.0)
        link(trees, loops, m)
        measure(trees, loops, m)
    correct_speeds(loops, n, rows, dt)
    scatter(trees, loops, m)
    return True


@inlined
def _excess(loops: Loops, n: int, begun: float, dt: float) -> float:
    """The share of `shift` that exceeds the motion by the speeds in this tick of ``dt``.

    In a flat place, as where rounding errors make joints contradict each other, closing the gap ``begun`` takes a large
    displacement. It would move the mechanism back again and again, against the speeds that are reported.
    """
    far = 0.0
    for a in range(n):
        far = max(far, abs(loops.shift[a]))
    if far <= max(THROWN, FLAT * begun):
        return 0.0
    there = -dt * product(loops, n, loops.speed, loops.shift) / product(loops, n, loops.shift, loops.shift)
    return 1.0 - min(max(there, 0.0), 1.0)
