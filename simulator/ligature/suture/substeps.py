"""A whole tick of a rod in one call: usually one step, several where contacts do not settle.

A thread that snaps into a new shape, as when a knot closes, changes its contacts faster than one step
can follow; a tick in which they do not settle is undone and repeated in shorter steps. World
axes, SI units.
"""

from __future__ import annotations

from ligature.kernels import inlined, kernel
from ligature.suture import layout
from ligature.suture.contacts import detect
from ligature.suture.passage_forces import add_passage_impulses, begin_passages, restart_passages
from ligature.suture.placing import sound
from ligature.suture.point_constraints import add_point_constraints
from ligature.suture.reactions import add_reactions, find_tension
from ligature.suture.rotations import cross, turn
from ligature.suture.springs import add_spring_impulses, begin_springs, open_springs
from ligature.suture.step import advance
from ligature.suture.tables import opener
from ligature.suture.tracking import open_passages

open_nodes = opener(layout.nodes(1))
open_joints = opener(layout.joints(1))
open_shapes = opener(layout.no_shapes(1))
open_touches = opener(layout.touches(1))
open_work = opener(layout.work(2, 2, 1, 1))

REFINEMENT, MAX_PARTS = 4, 16
"""How many steps take the place of one that did not settle, and the most in a tick."""

MAX_STEPS = 16
"""Newton steps of a tick after which steps count although contacts have not settled."""


@inlined
def _copy2(a, b):
    for i in range(a.shape[0]):
        for k in range(a.shape[1]):
            b[i, k] = a[i, k]


@inlined
def _place(nodes, motion, met):
    """Set the nodes ``met[:, 1]`` to the motion of their bodies, rows ``met[:, 0]`` of ``motion`` (b, 13)."""
    for m in range(met.shape[0]):
        row, i = motion[met[m, 0]], met[m, 1]
        for a in range(3):
            nodes.x[i, a], nodes.v[i, a], nodes.w[i, a] = row[a], row[7 + a], row[10 + a]
        for a in range(4):
            nodes.q[i, a] = row[3 + a]


@inlined
def _keep(nodes, joints, work):
    _copy2(nodes.x, work.kept_x)
    _copy2(nodes.q, work.kept_q)
    _copy2(nodes.v, work.kept_v)
    _copy2(nodes.w, work.kept_w)
    _copy2(joints.angle, work.kept_angle)
    _copy2(joints.load, work.kept_load)


@inlined
def _take_back(nodes, joints, work):
    _copy2(work.kept_x, nodes.x)
    _copy2(work.kept_q, nodes.q)
    _copy2(work.kept_v, nodes.v)
    _copy2(work.kept_w, nodes.w)
    _copy2(work.kept_angle, joints.angle)
    _copy2(work.kept_load, joints.load)


@inlined
def _move_shapes(nodes, shapes, h):
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
def _scale_loads(joints, factor):
    """Scale the loads, which are times the square of the step, to another step."""
    for j in range(joints.load.shape[0]):
        for a in range(6):
            joints.load[j, a] *= factor


@inlined
def _one_step(
    first, n, total, nodes, joints, shapes, old, new, work, passages, owner, springs, constraints, points, tension,
    counts, self_skip, stiffness, h, begins, elapsed,
):  # fmt: skip
    new.count[0] = 0
    add_point_constraints(nodes, work, old, new, constraints, points)
    detect(first, work.segment.shape[0], nodes, shapes, old, new, work, tension, counts, self_skip, h)
    return advance(n, total, nodes, joints, new, work, passages, owner, springs, stiffness, h, begins, elapsed)


@kernel
def run_tick(
    first, n, total, node_table, joint_table, shape_table, shape_poses, last, next_, scratch, work_table,
    passage_table, owner, spring_table, constraints, points, motion, met, counts, self_skip, stiffness, impulse,
    tension, max_speed, dt,
):  # fmt: skip
    """One tick; contacts of the last one are in ``last``, those of this one go to ``next_``, or ``scratch``.

    Groups of arrays come as the tables of `ligature.suture.tables`. ``counts`` returns: contacts found,
    contacts for which there was no room, Newton steps, whether the contacts lie in ``scratch``, and whether all
    elements are finite and slower than ``max_speed``.
    """
    nodes, joints, shapes = open_nodes(node_table), open_joints(joint_table), open_shapes(shape_table)
    a, b, c, work = open_touches(last), open_touches(next_), open_touches(scratch), open_work(work_table)
    passages, springs = open_passages(passage_table), open_springs(spring_table)
    _place(nodes, motion, met)
    _keep(nodes, joints, work)
    _copy2(shapes.pose, shape_poses)
    begin_passages(passages, owner)
    begin_springs(springs, nodes)
    for i in range(total):
        for k in range(6):
            impulse[i, k] = 0.0
    old, new, in_c = a, b, False
    # In units of the smallest step: what of the tick is done, the next step, that of the loads, and of those kept.
    done, size, scale, kept = 0, MAX_PARTS, MAX_PARTS, MAX_PARTS
    steps = 0
    while done < MAX_PARTS:
        h = dt * size / MAX_PARTS
        _scale_loads(joints, (size / scale) ** 2)
        scale = size
        more, settled = _one_step(
            first, n, total, nodes, joints, shapes, old, new, work, passages, owner, springs, constraints, points,
            tension, counts, self_skip, stiffness, h, done == 0, dt * (done + size) / MAX_PARTS,
        )  # fmt: skip
        steps += more
        if not settled and size > 1 and steps < MAX_STEPS:
            _take_back(nodes, joints, work)
            restart_passages(passages, owner)
            size, scale = size // REFINEMENT, kept
            continue
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
        while done % (REFINEMENT * size) == 0:
            size *= REFINEMENT
    _copy2(shape_poses, shapes.pose)
    _scale_loads(joints, (MAX_PARTS / scale) ** 2)
    find_tension(first, n, joints, work, tension, dt)
    counts[2], counts[3] = steps, 1 if in_c else 0
    elements = work.segment.shape[0]
    counts[4] = 1 if sound(first, elements, nodes.x, nodes.q, nodes.v, nodes.w, max_speed) else 0
