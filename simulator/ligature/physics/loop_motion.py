"""Gaps and coordinates of mechanisms with loops: read from trees, moved, and written back to trees and to Bullet."""

from __future__ import annotations

import math

from ligature.kernels import inlined
from ligature.model.poses import compose
from ligature.physics.bullet import (
    init_motion,
    set_angular_velocity,
    set_joint_positions,
    set_joint_velocities,
    set_linear_velocity,
    set_orientation,
    set_position,
    submit,
)
from ligature.physics.loop_arrays import Loops
from ligature.physics.trees import MAX_RATE, SLIDES, Trees, follow, most_rate


@inlined
def link(trees: Trees, loops: Loops, m: int) -> None:
    """Update the poses of links of mechanism ``m``, in trees where they are out of date."""
    for t in range(loops.tree_begin[m], loops.tree_begin[m + 1]):
        if not trees.linked[loops.tree[t]]:
            follow(trees, loops.tree[t])


@inlined
def measure(trees: Trees, loops: Loops, m: int) -> float:
    """Fill `error` and `gap` of mechanism ``m``: translation and rotation from second to first frame; the largest."""
    row, widest = 0, 0.0
    for c in range(loops.begin[m], loops.begin[m + 1]):
        one, other, error = loops.end[0], loops.end[1], loops.error
        compose(trees.pose[loops.end_row[c, 0]], loops.end_frame[c, 0], one)
        compose(trees.pose[loops.end_row[c, 1]], loops.end_frame[c, 1], other)
        square = 0.0
        for a in range(3):
            error[row + a] = one[a] - other[a]
            error[row + 3 + a] = 0.0
            square += error[row + a] * error[row + a]
        loops.gap[c] = math.sqrt(square)
        widest = max(widest, loops.gap[c])
        if not loops.point[c]:
            x, y, z, w = one[3], one[4], one[5], one[6]
            ox, oy, oz, ow = -other[3], -other[4], -other[5], other[6]
            tx = w * ox + x * ow + y * oz - z * oy
            ty = w * oy - x * oz + y * ow + z * ox
            tz = w * oz + x * oy - y * ox + z * ow
            tw = w * ow - x * ox - y * oy - z * oz
            sine = math.sqrt(tx * tx + ty * ty + tz * tz)
            if tw < 0.0:
                tx, ty, tz, tw = -tx, -ty, -tz, -tw
            angle = 2.0 * math.atan2(sine, tw)
            stretch = angle / sine if sine > 1e-12 else 2.0
            error[row + 3], error[row + 4], error[row + 5] = stretch * tx, stretch * ty, stretch * tz
            widest = max(widest, angle)
        row += 6
    return widest


@inlined
def gather(trees: Trees, loops: Loops, m: int) -> None:
    """Read values, limits and speeds of the coordinates of mechanism ``m`` from its trees."""
    for t in range(loops.tree_begin[m], loops.tree_begin[m + 1]):
        k = loops.tree[t]
        base = trees.begin[k]
        begin = loops.column[base]
        for i in range(begin, begin + loops.width[base]):
            loops.first[i] = begin
            loops.place[i], loops.bound[i, 0], loops.bound[i, 1] = 0.0, -math.inf, math.inf
            loops.speed[i], loops.most[i] = trees.twist[base, i - begin], MAX_RATE
            loops.linear[i], loops.shift[i] = i - begin < 3, 0.0
        for a in range(trees.first[k], trees.first[k + 1]):
            i = begin + loops.width[base] + a - trees.first[k]
            loops.first[i] = begin
            loops.place[i], loops.bound[i, 0], loops.bound[i, 1] = trees.joints[0, a], loops.low[a], loops.high[a]
            loops.speed[i], loops.most[i] = trees.joints[1, a], most_rate(trees, a)
            loops.linear[i], loops.shift[i] = False, 0.0
        for r in range(base + 1, trees.begin[k + 1]):
            if loops.width[r] == 1:
                loops.linear[loops.column[r]] = trees.rows[r, 1] == SLIDES


@inlined
def move_by(trees: Trees, loops: Loops, m: int, share: float) -> None:
    """Move mechanism ``m`` by a share of `step`."""
    for t in range(loops.tree_begin[m], loops.tree_begin[m + 1]):
        k = loops.tree[t]
        base = trees.begin[k]
        i = loops.column[base]
        if loops.width[base] > 0:
            pose, step = trees.pose[base], loops.step
            for a in range(3):
                pose[a] += share * step[i + a]
            x, y, z, w = pose[3], pose[4], pose[5], pose[6]
            rx, ry, rz = 0.5 * share * step[i + 3], 0.5 * share * step[i + 4], 0.5 * share * step[i + 5]
            tx, ty = x + rx * w + ry * z - rz * y, y + ry * w + rz * x - rx * z
            tz, tw = z + rz * w + rx * y - ry * x, w - rx * x - ry * y - rz * z
            norm = math.sqrt(tx * tx + ty * ty + tz * tz + tw * tw)
            pose[3], pose[4], pose[5], pose[6] = tx / norm, ty / norm, tz / norm, tw / norm
            i += 6
        for a in range(trees.first[k], trees.first[k + 1]):
            loops.place[i] += share * loops.step[i]
            trees.joints[0, a] = loops.place[i]
            i += 1
        trees.linked[k] = False


@inlined
def scatter(trees: Trees, loops: Loops, m: int) -> None:
    """Write the speeds of mechanism ``m`` to its trees."""
    for t in range(loops.tree_begin[m], loops.tree_begin[m + 1]):
        k = loops.tree[t]
        base = trees.begin[k]
        i = loops.column[base]
        for a in range(loops.width[base]):
            trees.twist[base, a] = loops.speed[i]
            i += 1
        for a in range(trees.first[k], trees.first[k + 1]):
            trees.joints[1, a] = loops.speed[i]
            i += 1
        trees.linked[k] = False


@inlined
def send(handle: int, trees: Trees, loops: Loops, k: int) -> None:
    """Set base and joints of tree ``k`` in Bullet."""
    command = init_motion(handle, trees.uid[k])
    wanted, at, base, first = loops.wanted, loops.wanted_at[0], trees.begin[k], trees.first[k]
    count = trees.first[k + 1] - first
    if trees.going[k]:
        pose = trees.pose[base]
        for a in range(6):
            wanted[a] = trees.twist[base, a]
        set_position(command, pose[0], pose[1], pose[2])
        set_orientation(command, pose[3], pose[4], pose[5], pose[6])
        set_linear_velocity(command, at)
        set_angular_velocity(command, at + 24)
    for a in range(count):
        wanted[13 + a], wanted[13 + count + a] = trees.joints[0, first + a], trees.joints[1, first + a]
    if count > 0:
        set_joint_positions(command, count, at + 8 * 13)
        set_joint_velocities(handle, command, count, at + 8 * (13 + count))
    submit(handle, command)
