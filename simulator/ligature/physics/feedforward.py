"""Efforts with which the joints of a tree change their velocities as they are to: inverse dynamics.

Bullet finds the efforts of motors row by row. The axes of a wrist and its two jaws are so coupled that 50 iterations
were not enough while an arm moved; where the efforts are known before, few are left to do. World axes.

Forces of contacts, threads and grasps are left to Bullet.
"""

from __future__ import annotations

from ligature.kernels import inlined
from ligature.physics.trees import SLIDES, Array, Trees, bear, turned
from ligature.rotations import cross


@inlined
def find_efforts(trees: Trees, k: int, dt: float) -> None:
    """Add to `Trees.foreseen` the efforts that give the axes of tree ``k`` their `Trees.change` within a tick.

    The base stands, and the links are up to date (Luh, Walker, Paul 1980).
    """
    rows, frame, speed, acceleration, load = trees.rows, trees.frame, trees.speed, trees.acceleration, trees.load
    begin = trees.begin[k]
    for a in range(6):
        acceleration[begin, a] = load[begin, a] = 0.0
    for r in range(begin + 1, trees.begin[k + 1]):
        p, axis, own = rows[r, 0], rows[r, 2], acceleration[r]
        lx, ly, lz = _at(acceleration[p], speed[p], frame[p], frame[r])
        ax, ay, az = acceleration[p, 3], acceleration[p, 4], acceleration[p, 5]
        if axis >= 0:
            rate, now = trees.change[axis] / dt, trees.joints[1, axis]
            ux, uy, uz = turned(frame[r], trees.fixed[r, 0], trees.fixed[r, 1], trees.fixed[r, 2])
            wx, wy, wz = cross(speed[p, 3], speed[p, 4], speed[p, 5], now * ux, now * uy, now * uz)
            if rows[r, 1] == SLIDES:
                lx, ly, lz = lx + rate * ux + 2.0 * wx, ly + rate * uy + 2.0 * wy, lz + rate * uz + 2.0 * wz
            else:
                ax, ay, az = ax + rate * ux + wx, ay + rate * uy + wy, az + rate * uz + wz
        own[0], own[1], own[2], own[3], own[4], own[5] = lx, ly, lz, ax, ay, az
        _accelerate(trees, r)
    bear(trees, k, trees.foreseen)


@inlined
def _accelerate(trees: Trees, r: int) -> None:
    """Set the load of row ``r`` to the force, and its moment about the world's origin, that accelerates its body."""
    own, speed, pose, load, m = trees.acceleration[r], trees.speed[r], trees.pose[r], trees.load[r], trees.mass[r]
    lx, ly, lz = _at(own, speed, trees.frame[r], pose)
    fx, fy, fz = m * lx, m * ly, m * lz
    load[0], load[1], load[2] = fx, fy, fz
    mx, my, mz = cross(pose[0], pose[1], pose[2], fx, fy, fz)
    hx, hy, hz = 0.0, 0.0, 0.0
    for a in range(3):
        ux, uy, uz = turned(pose, 1.0 if a == 0 else 0.0, 1.0 if a == 1 else 0.0, 1.0 if a == 2 else 0.0)
        change = trees.inertia[r, a] * (ux * own[3] + uy * own[4] + uz * own[5])
        spin = trees.inertia[r, a] * (ux * speed[3] + uy * speed[4] + uz * speed[5])
        mx, my, mz = mx + change * ux, my + change * uy, mz + change * uz
        hx, hy, hz = hx + spin * ux, hy + spin * uy, hz + spin * uz
    gx, gy, gz = cross(speed[3], speed[4], speed[5], hx, hy, hz)
    load[3], load[4], load[5] = mx + gx, my + gy, mz + gz


@inlined
def _at(acceleration: Array, speed: Array, origin: Array, point: Array) -> tuple[float, float, float]:
    """Linear acceleration at a ``point`` of a body that has ``acceleration`` and ``speed`` (6,) at ``origin``."""
    x, y, z = point[0] - origin[0], point[1] - origin[1], point[2] - origin[2]
    ax, ay, az = cross(acceleration[3], acceleration[4], acceleration[5], x, y, z)
    ux, uy, uz = cross(speed[3], speed[4], speed[5], x, y, z)
    ux, uy, uz = cross(speed[3], speed[4], speed[5], ux, uy, uz)
    return acceleration[0] + ax + ux, acceleration[1] + ay + uy, acceleration[2] + az + uz
