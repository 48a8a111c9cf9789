"""A knot over the wound of `scenes/soft_suturing`, in a thread through both of its lips of soft tissue.

World axes; the wound runs along x, and the top of the pad at rest is at z = 0. SI units, but for laid throws, which are
in thicknesses of the thread.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace

import ligature
import numpy as np
from ligature.adf.frames import minimal_rotation
from ligature.model.frames import axis_rotation, matrix_pose7, matrix_quaternion, pose7_matrix, quaternion_matrix
from ligature.soft.frame import Frame
from ligature.soft.thread import SceneThread
from ligature.suture.description import from_material
from ligature.tasks.knots import determinant
from ligature.tissue.block import TissueBlock
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from tests.suture.conftest import DT, Bench, body, damped
from tests.suture.throws import in_hands
from tests.tasks.threads import closed

Array = NDArray[np.float64]

WAY = 1e-3 * np.array([[2.2, -4.5], [3.9, -4.5], [5.2, -3.6], [6.1, -2.0], [6.5, -0.1]])
"""A thread's way through a lip at rest, from the wound's wall to the top: distances from its middle, and heights."""

AT, ALONG = 6.67e-3, 6e-3
"""Fingers press nodes of the top so far from the middle of the wound, and along it."""

EASES = 5.0
"""N a second by which they press on and let go."""

SETTLES = 1000
"""Ticks until lips that are pressed together rest."""

LENGTH = 1.25
"""Of an element, in thicknesses of the thread."""

HALF, WINDING, ABOVE = 3.0, 0.75, 2.5
"""Of a laid throw, in thicknesses: half its length, radius of its strands about each other, height over the last one."""

TAIL = 0.024
"""Metres of thread beyond the first throw."""

PACE = 0.03
"""Metres a second by which a hand draws at most."""

CLOSE, BESIDE = 1.4, 1
"""Thicknesses between strands that touch, and elements between the last of a throw and one that a forceps holds."""

LEFT, RIGHT, FORCEPS = range(3)


@dataclass(frozen=True)
class Thread:
    """Thickness in metres, Young's modulus in Pa, newtons with which a throw is drawn, and what its bends and skin do."""

    thick: float
    youngs: float
    drawn: float
    yield_strain: float
    friction: float


def strands(sense: int, begin: float, tail: float, *, bend: bool) -> list[Array]:
    """Two strands (n, 3) through a loose throw, their beginnings at -``begin`` and ``begin`` of y, their ends along y.

    In thicknesses of the thread. With a ``bend`` they begin outwards, below it. Each turns half a time more than ``sense``.
    """
    s = np.linspace(0.0, 1.0, 240)
    angle = np.pi * ((2.0 * sense + np.sign(sense)) * s - 0.5)
    wound, along = WINDING * np.column_stack([np.cos(angle), np.sin(angle)]), HALF * (2.0 * s - 1.0)
    z = WINDING + (ABOVE if bend else 0.0)
    through = [
        np.column_stack([wound[:, 0], along, z + wound[:, 1]]),
        np.column_stack([-wound[:, 0], along, z - wound[:, 1]])[::-1],
    ]
    laid, turn = [], np.linspace(0.0, np.pi, 40)
    for strand, side in zip(through, (-1.0, 1.0), strict=True):
        up = 0.5 * ABOVE * np.column_stack([0.0 * turn, 1.5 * side * np.sin(turn), 1.0 - np.cos(turn)])
        first = up + [0.0, side * begin, 0.0] if bend else np.array([[0.0, side * begin, 0.0]])
        ends = strand[-1] + np.linspace(0.0, 1.0, 200)[1:, None] * [0.0, -side * tail, 0.0]
        laid.append(np.vstack([first, strand, ends]))
    return laid


def evenly(points: Array, length: float) -> Array:
    """Points so far apart along a curve, from its beginning."""
    at = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]
    return np.column_stack([np.interp(np.arange(0.0, at[-1], length), at, column) for column in points.T])


class StitchedWound:
    """A wound of 4 mm in the pad of `scenes/soft_suturing`, a thread in a path through each lip, its ends in two hands.

    Fingers press both lips together beside the exits, with ``press`` newtons each, while `knot` draws it. A thread
    meets tissue only in its paths here, so that nothing lies on the top. The ``first`` throw is laid from the beginning.
    """

    def __init__(self, first: int, thread: Thread, press: float) -> None:
        self._thread, self._press_with, self._force, self.pressed = thread, press, 0.0, True
        scene = ligature.load("soft_suturing")
        self._form = scene.tissues[0].form
        grid, top = self._form.grid, float(self._form.grid.nodes[:, 2].max())
        self.block = TissueBlock(grid, self._form.materials, self._form.fixed)
        pad = body(0, None, (0.0, 0.0, -top), R=axis_rotation((0.0, 0.0, 1.0), np.pi / 2))
        self.frame = Frame(pad)
        self.frame.read(matrix_pose7(pad.T_world_body), np.zeros(6))
        self.frame.restart()
        rest, pairs = grid.nodes, self.block.lips.pairs
        on_top = np.abs(rest[:, 2] - top) < 1e-6
        self._facing = on_top[pairs[:, 0]] & (np.abs(rest[pairs[:, 0], 1]) < ALONG)
        self._at_stitch = np.abs(rest[pairs[:, 0], 1]) < 1e-3
        beside = on_top & (np.abs(rest[:, 1]) < ALONG) & (np.abs(np.abs(rest[:, 0]) - AT) < 1e-3)
        self._pressed = [
            (self.block.interface.add(np.array([node]), np.ones(1)), -np.sign(rest[node, 0]))
            for node in np.flatnonzero(beside)
        ]
        for _ in range(SETTLES):
            self._press()
            self.block.step()
        self._sew(first)

    def _sew(self, first: int) -> None:
        """The thread from one hand through the first throw, both lips, and that throw again to the other."""
        thread = self._thread
        ways = [self._way(side) for side in (-1, 1)]
        inside = np.vstack([ways[0][::-1], ways[1]])
        at = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(inside, axis=0), axis=1))]
        fine = np.linspace(0.0, at[-1], 100)
        curve = PchipInterpolator(at, inside)(fine)
        wall = int(np.argmin(np.abs(fine - at[5])))
        tails = [
            self.centre() + thread.thick * strand
            for strand in strands(first, HALF + 1.0, TAIL / thread.thick, bend=False)
        ]
        points = np.vstack([tails[0][::-1], curve, tails[1]])
        at = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]
        n = round(at[-1] / (LENGTH * thread.thick))
        even = np.linspace(0.0, at[-1], n + 1)
        self._length = length = even[1]
        begin = len(tails[0])
        self._bottom = round(at[begin + wall] / length)
        laid = np.column_stack([np.interp(even, at, column) for column in points.T])
        self.bench = Bench([body(LEFT, None, laid[0]), body(RIGHT, None, laid[-1]), body(FORCEPS, None)])
        made = from_material(
            laid, thread.thick, thread.youngs, 1100.0, friction=thread.friction, gravity=(0, 0, 0), damping=0.003,
            straight=False, yield_strain=thread.yield_strain,
        )  # fmt: skip
        made = replace(made, compliance=np.full(n - 1, length / 4000.0), attachments=in_hands(made, LEFT, RIGHT))
        self.rod = self.bench.add(damped(made, 0.9))
        needle = SimpleNamespace(body=SimpleNamespace(index=LEFT), met=False)
        self.thread = SceneThread(self.rod, needle, self.block, self.frame)
        for way, entry in ((ways[0], begin), (ways[1][::-1], begin + wall)):
            path = self.block.lay_path((way - self.frame.p) @ self.frame.R, thread.thick / 2)
            self.thread.inside.insert(path, at[entry])

    def _way(self, side: int) -> Array:
        """Where `WAY` through a lip is now, (5, 3)."""
        rest = np.column_stack([side * WAY[:, 0], np.zeros(len(WAY)), WAY[:, 1] - self.frame.p[2]])
        return self._form.embed(rest).positions(self.block.positions) @ self.frame.R.T + self.frame.p

    @property
    def gap(self) -> float:
        """Between the lips at the top, at the stitch, m."""
        return float(self.block.lips.gaps()[self._facing & self._at_stitch].max())

    @property
    def beside(self) -> float:
        """Between the lips at the top, 5 mm beside the stitch, m."""
        return float(self.block.lips.gaps()[self._facing & ~self._at_stitch].max())

    @property
    def loop(self) -> float:
        """Tension between the lips, N."""
        return float(self.rod.tension[self._bottom - 2 : self._bottom + 3].mean())

    @property
    def legs(self) -> Array:
        """Tension (2,) of the thread between each lip and the knot, N."""
        at = self.thread.inside.snapshot()["at"][self.thread.inside.engaged > 0]
        return self.rod.tension[[round(at.min() / self._length) - 2, round(at.max() / self._length) + 1]]

    @property
    def ends(self) -> Array:
        """Tension (2,) at both hands, N."""
        return self.rod.tension[[1, -2]]

    def determinant(self) -> int:
        """Of the knot in the thread."""
        side = np.sign(self.bench.pose[RIGHT][1] - self.bench.pose[LEFT][1])
        return determinant(closed(side * self.rod.positions))

    # --- the hands --------------------------------------------------------------------------

    def centre(self) -> Array:
        """Between both exits, where the knot goes, (3,)."""
        return np.mean([self._way(side)[-1] for side in (-1, 1)], axis=0)

    def _side(self, hand: int) -> float:
        return float(np.sign(self.bench.pose[hand][1]))

    def _pull(self, force: float) -> bool:
        """For a tick, draw both ends with a force, flat over the lips; whether they bear it."""
        ends, level = self.ends, self.centre()[2]
        for hand, pull in zip((LEFT, RIGHT), ends, strict=True):
            twist = self.bench.twist[hand]
            twist[1] = self._side(hand) * PACE * np.clip((force - pull) / max(0.3 * force, 0.1), -1.0, 1.0)
            twist[2] = PACE * np.clip((level - self.bench.pose[hand][2]) / 1e-3, -1.0, 1.0)
        self.step()
        return bool((ends > 0.9 * force).all())

    def draw(self, most: int = 3000) -> None:
        """Draw the ends until both have borne the force for 0.1 s."""
        drawn = 0
        for _ in range(most):
            drawn += self._pull(self._thread.drawn)
            if drawn > 100:
                return
        raise AssertionError(f"the throw never drew tight: {self.ends} N")

    def close_forceps(self) -> None:
        """A forceps holds both strands where they leave the last throw, as an assistant does."""
        x, n = self.rod.positions, len(self.rod.positions)
        apart = np.linalg.norm(x[:, None] - x[None], axis=2)
        apart[np.abs(np.subtract.outer(np.arange(n), np.arange(n))) < 8] = np.inf
        inside = np.flatnonzero(apart.min(axis=1) < CLOSE * self._thread.thick)
        self._held = (int(inside[0]) - BESIDE, int(inside[-1]) + BESIDE)
        for element in self._held:
            T = pose7_matrix(np.r_[x[element], self.rod.orientations[element]])
            self.rod.attach(element, FORCEPS, np.eye(4), T)

    def open_forceps(self) -> None:
        """It lets go."""
        for element in self._held:
            self.rod.detach(element, FORCEPS)

    def lay(self, sense: int) -> None:
        """Lay the ends beyond the forceps to a loose throw over the last one, without a bend that wants to straighten."""
        thick = self._thread.thick
        outs = [self._outer_end(hand) for hand in (LEFT, RIGHT)]
        order = sorted((LEFT, RIGHT), key=lambda hand: outs[hand][1])
        begin = 0.5 * float(outs[order[1]][1] - outs[order[0]][1]) / thick
        laid = strands(sense, begin, 2.0 * TAIL / thick, bend=True)
        moved: list[int] = []
        for strand, hand in zip(laid, order, strict=True):
            line = 0.5 * (outs[0] + outs[1]) + thick * strand
            moved += self._lay_end(hand, evenly(np.vstack([outs[hand], line[1:]]), self._length))
        for held in (True, False):
            for element in moved:
                self.rod.hold_element(element, held)
            if held:
                self.step()
        joints = self.rod.joints
        between = np.unique(np.add.outer(self.rod.first + np.array(moved), (-1, 0)))
        between = between[(between >= self.rod.first) & (between < self.rod.first + len(self.rod.positions) - 1)]
        joints.rest[between], joints.load[between] = joints.angle[between], 0.0

    def _outer_end(self, hand: int) -> Array:
        """Where an element that a forceps holds ends, towards a hand, (3,)."""
        element = self._held[hand]
        T = pose7_matrix(np.r_[self.rod.positions[element], self.rod.orientations[element]])
        return T[:3, :3] @ self.rod.description.ends[element, hand] + T[:3, 3]

    def _lay_end(self, hand: int, points: Array) -> list[int]:
        """Lay all elements beyond the forceps along points so far apart as elements are long, at rest; returns them."""
        nodes, step, last = self.rod.nodes, (-1, 1)[hand], (-1, len(self.rod.positions))[hand]
        elements = list(range(self._held[hand] + step, last, step))
        R = quaternion_matrix(self.rod.orientations[self._held[hand]])
        for element, a, b in zip(elements, points, points[1:], strict=False):
            R = minimal_rotation(R[:, 2], step * (b - a) / np.linalg.norm(b - a)) @ R
            row = self.rod.first + element
            nodes.x[row], nodes.q[row], nodes.v[row], nodes.w[row] = 0.5 * (a + b), matrix_quaternion(R), 0.0, 0.0
        self.bench.pose[hand][:3], self.bench.twist[hand][:] = points[len(elements)], 0.0
        return elements

    def knot(self, senses: Sequence[int]) -> None:
        """Draw the first throw, and lay and draw the next ones over it; the hands then hold the ends."""
        self.draw()
        for sense in senses[1:]:
            self.close_forceps()
            self.lay(sense)
            self.draw()
            self.open_forceps()
            self.draw()

    def let_go(self) -> None:
        """The fingers leave the lips; 0.4 s later the hands ease the ends, within another 0.2 s."""
        self.pressed = False
        for _ in range(400):
            self._pull(self._thread.drawn)
        for share in np.linspace(1.0, 0.0, 200):
            self._pull(share * self._thread.drawn)

    def rest(self, ticks: int) -> None:
        """Wait; the hands follow the ends without force."""
        for _ in range(ticks):
            self._pull(0.0)

    def _press(self) -> None:
        """Fingers press both lips together, or let go of them."""
        goal = self._press_with if self.pressed else 0.0
        self._force += float(np.clip(goal - self._force, -EASES * DT, EASES * DT))
        for point, side in self._pressed:
            self.block.interface.points.force[point, 0] = side * 2.0 * self._force / len(self._pressed)

    def step(self) -> None:
        """Advance thread and tissue by a tick."""
        self._press()
        self.rod.clear_springs()
        self.thread.begin(DT)
        self.bench.step()
        self.thread.end(DT)
        self.block.step()
