"""A whole tick of a rod in one call: usually one step, several where contacts do not settle.

A thread that snaps into a new shape, as when a knot closes, changes its contacts faster than one step
can follow; a tick in which they do not settle is undone and repeated in shorter steps. Where these do not settle
either, one careful step takes their place (`ligature.suture.careful`). World axes, SI units.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.rotations import cross, turn
from ligature.suture import layout
from ligature.suture.careful import advance_carefully
from ligature.suture.contacts import detect
from ligature.suture.crossing import free_share, shorten
from ligature.suture.passage_forces import add_passage_impulses, begin_passages, restart_passages
from ligature.suture.passages import Passages
from ligature.suture.placing import find_pushed, sound
from ligature.suture.plasticity import set_bends
from ligature.suture.point_constraints import add_point_constraints
from ligature.suture.reactions import add_reactions, find_tension
from ligature.suture.springs import Springs, add_spring_impulses, begin_springs, open_springs
from ligature.suture.step import advance, finish, linearise
from ligature.suture.tracking import open_passages
from ligature.tables import copy_into, opener

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


open_touches = opener(layout.touches(1))
open_rod = opener(
    layout.rod_arrays(
        layout.nodes(1), layout.joints(1), layout.no_shapes(1), layout.work(2, 2, 1, 1), 0, 0, 0.0, 0.0, 0.0
    )
)

REFINEMENT, MAX_PARTS = 4, 16
"""How many steps take the place of one that did not settle, and the most in a tick."""

MAX_STEPS, MAX_CAREFUL_STEPS = 16, 200
"""Newton steps of a tick after which a step that does not settle, or a careful one, is not divided any more."""


@inlined
def _place(nodes: layout.Nodes, motion: Array, met: Integers) -> None:
    """Set the nodes ``met[:, 1]`` to the motion of their bodies, rows ``met[:, 0]`` of ``motion`` (b, 13)."""
    for m in range(met.shape[0]):
        row, i = motion[met[m, 0]], met[m, 1]
        for a in range(3):
            nodes.x[i, a], nodes.v[i, a], nodes.w[i, a] = row[a], row[7 + a], row[10 + a]
        for a in range(4):
            nodes.q[i, a] = row[3 + a]


@inlined
def _keep(nodes: layout.Nodes, joints: layout.Joints, work: layout.Work) -> None:
    copy_into(work.kept_x, nodes.x)
    copy_into(work.kept_q, nodes.q)
    copy_into(work.kept_v, nodes.v)
    copy_into(work.kept_w, nodes.w)
    copy_into(work.kept_angle, joints.angle)
    copy_into(work.kept_load, joints.load)


@inlined
def _take_back(nodes: layout.Nodes, joints: layout.Joints, work: layout.Work) -> None:
    copy_into(nodes.x, work.kept_x)
    copy_into(nodes.q, work.kept_q)
    copy_into(nodes.v, work.kept_v)
    copy_into(nodes.w, work.kept_w)
    copy_into(joints.angle, work.kept_angle)
    copy_into(joints.load, work.kept_load)


@inlined
def _move_shapes(nodes: layout.Nodes, shapes: layout.Shapes, h: float) -> None:
    """Advance the parts of bodies by ``h`` seconds with their nodes."""
    for c in range(shapes.node.shape[0]):
        k = shapes.node[c]
        if k < 0:
            continue
        p, v, w = shapes.pose[c], nodes.v[k], nodes.w[k]
        ux, uy, uz = cross(w[0], w[1], w[2], p[0] - nodes.x[k, 0], p[1] - nodes.x[k, 1], p[2] - nodes.x[k, 2])
        p[0], p[1], p[2] = p[0] + h * (v[0] + ux), p[1] + h * (v[1] + uy), p[2] + h * (v[2] + uz)
        turn(shapes.pose[:, 3:7], c, h * w[0], h * w[1], h * w[2])


@inlined
def _scale_loads(joints: layout.Joints, factor: float) -> None:
    """Scale the loads, which are times the square of the step, to another step."""
    for j in range(joints.load.shape[0]):
        for a in range(6):
            joints.load[j, a] *= factor


@inlined
def _leave_errors(
    n: int, first: int, elements: int, nodes: layout.Nodes, joints: layout.Joints, work: layout.Work, h: float,
    share: float,
) -> None:  # fmt: skip
    """Set `Work.left`: a step of ``h`` takes off a ``share`` of how far the bodies at the rod's ends are from it.

    Physics moves a body that others hold elsewhere than the rod's solve did. To take all of that off in a part of the
    tick would give the rod a speed that grows as the part shrinks.
    """
    for side in range(2):
        for a in range(6):
            work.left[side, a] = 0.0
    head, tail = first > 0, n > first + elements
    if share == 1.0 or not (head or tail):
        return
    linearise(n, nodes.mass.shape[0], nodes, joints, work, h)
    for side in range(2):
        j = 0 if side == 0 else n - 2
        for a in range(6 if (head if side == 0 else tail) else 0):
            # What a load stretches is no error, nor is the angle of an axis that is free.
            if a < 3 or joints.low[j, a - 3] == joints.high[j, a - 3]:
                work.left[side, a] = (1.0 - share) * (work.c[j, a] + work.compliance[j, a] * joints.load[j, a])


@inlined
def _one_step(
    rod: layout.RodArrays, old: layout.Touches, new: layout.Touches, passages: Passages, owner: int,
    springs: Springs, constraints: Integers, points: Array, h: float, begins: bool, elapsed: float, share: float,
    careful: bool,
) -> tuple[int, bool]:  # fmt: skip
    """A step of ``h`` seconds, a ``share`` of what is left of the tick, that ends ``elapsed`` seconds after it began.

    See `advance` for what it returns.
    """
    nodes, joints, work, constants = rod.nodes, rod.joints, rod.work, rod.constants
    n, total, elements = joints.load.shape[0] + 1, nodes.mass.shape[0], work.segment.shape[0]
    new.count[0] = 0
    add_point_constraints(nodes, work, old, new, constraints, points, constants.stiffness[0], share)
    detect(
        constants.first[0], elements, nodes, rod.shapes, old, new, work, rod.tension, rod.counts,
        constants.self_skip[0], h,
    )  # fmt: skip
    _leave_errors(n, constants.first[0], elements, nodes, joints, work, h, share)
    if careful:
        return advance_carefully(
            n, total, nodes, joints, new, work, passages, owner, springs, constants.stiffness[0], h, begins, elapsed
        )
    return advance(
        n, total, nodes, joints, new, work, passages, owner, springs, constants.stiffness[0], h, begins, elapsed
    )


@inlined
def _next_size(done: int, size: int) -> int:
    """The largest step, of ``size`` or more, that may begin when ``done`` of the tick is done."""
    while size < MAX_PARTS and done % (REFINEMENT * size) == 0:
        size *= REFINEMENT
    return size


@kernel
def run_tick(
    rod_table: Integers, last: Integers, next_: Integers, scratch: Integers, passage_table: Integers, owner: int,
    spring_table: Integers, constraints: Integers, points: Array, motion: Array, met: Integers,
) -> None:  # fmt: skip
    """One tick; contacts of the last one are in ``last``, those of this one go to ``next_``, or ``scratch``.

    Groups of arrays come as the tables of `ligature.tables`. `RodArrays.counts` returns: contacts found,
    contacts for which there was no room, Newton steps, whether the contacts lie in ``scratch``, how many nodes
    `RodArrays.pushed` lists, and whether all elements are finite and slower than the maximum speed.
    """
    rod, passages, springs = open_rod(rod_table), open_passages(passage_table), open_springs(spring_table)
    a, b, c = open_touches(last), open_touches(next_), open_touches(scratch)
    nodes, joints, shapes, work, impulse, counts = rod.nodes, rod.joints, rod.shapes, rod.work, rod.impulse, rod.counts
    n, total, elements = joints.load.shape[0] + 1, nodes.mass.shape[0], work.segment.shape[0]
    first, dt = rod.constants.first[0], rod.constants.dt[0]
    _place(nodes, motion, met)
    _keep(nodes, joints, work)
    copy_into(rod.shape_poses, shapes.pose)
    begin_passages(passages, owner)
    begin_springs(springs, nodes)
    for i in range(total):
        for k in range(6):
            impulse[i, k] = 0.0
    old, new, in_c = a, b, False
    # In units of the smallest step: what of the tick is done, the next step, that of the loads, and of those kept.
    done, size, scale, kept = 0, MAX_PARTS, MAX_PARTS, MAX_PARTS
    steps, careful = 0, done > 0  # a constant would make Numba compile what depends on it twice
    while done < MAX_PARTS:
        h = dt * size / MAX_PARTS
        if size != scale:
            _scale_loads(joints, (size / scale) ** 2)
            scale = size
        more, settled = _one_step(
            rod, old, new, passages, owner, springs, constraints, points, h, done == 0, dt * (done + size) / MAX_PARTS,
            size / (MAX_PARTS - done), careful,
        )  # fmt: skip
        steps += more
        share = free_share(first, elements, nodes, new, work, counts[1])
        most = MAX_CAREFUL_STEPS if careful else MAX_STEPS
        divide = not (settled and share == 1.0) and size > 1 and steps < most
        if divide or not (settled or careful):
            _take_back(nodes, joints, work)
            restart_passages(passages, owner)
            scale = kept
            if divide:
                size //= REFINEMENT
            else:
                careful, size = True, _next_size(done, size)
            continue
        if share < 1.0:
            shorten(total, nodes, work, share)
            finish(n, total, nodes, joints, work, h)
        add_reactions(n, joints, new, work, impulse, h)
        add_passage_impulses(passages, owner, impulse, h)
        add_spring_impulses(springs, impulse, h)
        done += size
        if done == MAX_PARTS:
            break
        _move_shapes(nodes, shapes, h)
        _keep(nodes, joints, work)
        kept = size
        old, in_c = new, not in_c
        new = c if in_c else b
        size = _next_size(done, size)
    set_bends(joints)
    copy_into(shapes.pose, rod.shape_poses)
    if scale != MAX_PARTS:
        _scale_loads(joints, (MAX_PARTS / scale) ** 2)
    find_tension(first, n, joints, work, rod.tension, dt)
    counts[2], counts[3] = steps, 1 if in_c else 0
    counts[4] = find_pushed(first, elements, nodes.met, impulse, rod.pushed)
    counts[5] = 1 if sound(first, elements, nodes.x, nodes.q, nodes.v, nodes.w, rod.constants.max_speed[0]) else 0
