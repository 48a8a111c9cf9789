"""A rubber triangle goes from one post of a board to another. World axes, metres, radians, simulated seconds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.environments.goals.base import EARLY, HOLD, UNDONE, Dwell, Goal, Progress
from ligature.model.frames import axis_rotation, frame, matrix_pose7
from ligature.model.shapes import Box, Cylinder
from ligature.tasks.throws import UP

Array = NDArray[np.float64]


class PegTransfer(Goal):
    """Take a block from its post and put it over another, empty post: one block and one arm.

    The exercise of the Fundamentals of Laparoscopic Surgery moves six blocks there and back, from hand to hand; this is
    one of its moves without the other hand. Done when the block has been around the post, upright and down on the
    board, for 0.5 s, and the jaws are empty. Lost when the block falls off the board.
    """

    text = "move the block to the empty post"
    scene, arms, models, steps = "peg_transfer", ("PSM1",), (0, 1, 2), 300
    BLOCKS, POSTS = ("Block1", "Block2", "Block3"), (6, 7, 8)
    """Which blocks are moved, and to which posts of the board, counted from 0."""
    SHIFT, TURN = 0.001, np.pi / 3.0
    """By how much a block is beside its post along each axis, and turned about it."""
    AROUND, LOW, UPRIGHT = 0.004, 0.0012, 0.95
    """Metres from block to post within which it is around it, and above the board within which it is down; cosine of
    its tilt. Beside the post it is 8 mm away."""
    CLEAR = 0.003
    """Metres by which a block passes over the tops of posts."""
    GRASP = 0.02
    _KEPT = ("body", "_post", "_rested", "_rest", "_held")

    def _prepare(self) -> None:
        """Find the board, its posts and the blocks."""
        scene = self._simulation.scene
        named = {body.identity.name: body for body in scene.bodies}
        missing = [name for name in ("Board", *self.BLOCKS) if name not in named]
        if missing:
            raise ValueError(f"the scene '{scene.name}' has no body '{missing[0]}' of a peg board")
        board = named["Board"]
        self._blocks = [named[name].index for name in self.BLOCKS]
        self.body = self._blocks[0]
        posts = [part for part in board.colliders if isinstance(part.shape, Cylinder)]
        self._posts = np.array([(board.T_world_body @ part.T_body_shape)[:3, 3] for part in posts])
        if len(self._posts) <= max(self.POSTS):
            raise ValueError(f"the board of '{scene.name}' has {len(self._posts)} posts, not {max(self.POSTS) + 1}")
        cylinder, block = posts[0].shape, named[self.BLOCKS[0]].colliders[0].shape
        assert isinstance(cylinder, Cylinder) and isinstance(block, Box)
        self.height = float(block.size[2])
        self._top = float(self._posts[0, 2]) + 0.5 * cylinder.height
        self.low = self._top - cylinder.height + 0.5 * self.height
        self.over = self._top + 0.5 * self.height + self.CLEAR

    def begin(self, rng: np.random.Generator) -> None:
        """One of the blocks, moved and turned on its post, is to go to one of the empty posts."""
        self.body = self._blocks[int(rng.integers(len(self._blocks)))]
        self._post = self._posts[self.POSTS[int(rng.integers(len(self.POSTS)))]]
        T = self._pose(self.body)
        turn = axis_rotation((0.0, 0.0, 1.0), float(rng.uniform(-self.TURN, self.TURN)))
        shift = np.append(rng.uniform(-self.SHIFT, self.SHIFT, 2), 0.0)
        self._simulation.set_pose(self.body, matrix_pose7(frame(turn @ T[:3, :3], T[:3, 3] + shift)))
        self._rest, self._rested, self._held = Dwell(), 0.0, False

    def target(self) -> Array:
        """Where the middle of the block is to be."""
        return np.append(self._post[:2], self.low)

    def observe(self) -> Progress:
        """The way of the block up, across and down that is left, and before it is held, how far the tool is."""
        T = self._pose(self.body)
        x, y, z = (T[:3, 3] - self.target()).tolist()
        aside, empty = float(np.hypot(x, y)), self._simulation.grasps[self._arms[0].name] is None
        around = aside <= self.AROUND
        there = around and z <= self.LOW and float(T[2, 2]) >= self.UPRIGHT
        self._held = self.holds()
        self._rested = self._rest.observe(there and empty, self._simulation.time)
        if self._rested >= HOLD - EARLY:
            return Progress(0.0, True)
        lift = self.over - self.low
        left = max(z, 0.0) if around else max(lift - z, 0.0) + aside + lift
        if there:
            left += 0.5 * self.GRASP * (not empty)
        else:
            away = 0.2 * float(np.linalg.norm(self._tip() - T[:3, 3]))
            left += 0.5 * self.GRASP + (0.0 if self._held else self.GRASP + away)
        return Progress(left + UNDONE, lost="the block fell off the board" if z < -self.height else "")

    def marks(self) -> Array:
        """Whether the block is held, the share of the time for which it must rest, whether it is around the post."""
        aside = np.linalg.norm(self._pose(self.body)[:2, 3] - self._post[:2])
        return np.array([self._held, min(self._rested / HOLD, 1.0), aside <= self.AROUND], dtype=float)

    def way(self) -> list[Array]:
        """Poses (4, 4) of the block from where it is over the posts to where it is to be let go."""
        T = self._pose(self.body)
        x, y, _ = self.target()
        places = (T[:3, 3], (*T[:2, 3], self.over), (x, y, self.over), (x, y, self.low + self.LOW))
        return [frame(T[:3, :3], np.array(place)) for place in places]

    def walls(self) -> list[Array]:
        """The three sides of the block: frames (4, 4) in their middles, x along the side, y outwards, z up."""
        T = self._pose(self.body)
        found = []
        for part in self._simulation.scene.bodies[self.body].colliders:
            T_side = T @ part.T_body_shape
            outwards = T_side[:3, 3] - T[:3, 3]
            y = outwards - (outwards @ UP) * UP
            y = y / np.linalg.norm(y)
            found.append(frame(np.column_stack([np.cross(y, UP), y, UP]), T_side[:3, 3]))
        return found
