"""The controllers of all joints, tree by tree, as arms and grasping use them. Radians, metres, N·m, N."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.model.commands import CommandType
from ligature.model.scene import Body
from ligature.physics.axes import FREE, act, axes, requested_effort, stop
from ligature.physics.control import TreeControl
from ligature.physics.engine import Engine
from ligature.tables import table_of


class Joints:
    """All joints of an engine that have a single axis or several, by the index of the joint.

    Attributes
    ----------
    controls
        The controllers of each tree, in the order of ``engine.trees``; others after a `rebuild`.
    table
        The addresses of their arrays, for compiled code; others after a `rebuild`.
    """

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self.rebuild()

    def rebuild(self) -> None:
        """Begin anew in an engine that was rebuilt: all joints are limp."""
        engine = self._engine
        self._axes = axes(len(engine.trees), len(engine.motions.position))
        self.table = table_of(self._axes)
        self.controls = [
            TreeControl(engine.client, tree, engine.scene.joints, engine.dt, engine.motions, self._axes, k)
            for k, tree in enumerate(engine.trees)
        ]
        self._control_of = {joint: control for control in self.controls for joint in control.row}
        self.moving = [control for control in self.controls if control.links]

    def act(self) -> None:
        """Set motors and efforts of all joints for the coming tick, where compiled code cannot."""
        motions = self._engine.motions
        motions.everything()
        act(0, motions.table, self.table, self._engine.dt)
        for control in self.moving:
            control.send()

    def held(self) -> list[dict[str, Any]]:
        """The commands of all joints now, for `follow`."""
        return [control.held() for control in self.controls]

    def follow(self, held: Sequence[dict[str, Any]]) -> None:
        """Begin anew with commands that `held` gave, as if they came now."""
        for control, commands in zip(self.controls, held, strict=True):
            control.follow(commands)

    def control_of(self, joint: int) -> TreeControl:
        """The controllers of the tree that a joint belongs to; others after a snapshot."""
        return self._control_of[joint]

    # --- commands ---------------------------------------------------------------------------

    def command(self, body: Body, types: Sequence[CommandType], values: Sequence[float]) -> bool:
        """Take commands for the joints of ``body``; a missing type is an effort.

        Returns whether one of them has no effect since an arm owns the joint.
        """
        owned = False
        for i, (joint, value) in enumerate(zip(body.joints, values, strict=False)):
            control = self._control_of.get(joint)
            if control is not None:
                type_ = types[i] if i < len(types) else CommandType.FORCE
                owned |= bool(control.owned[control.row[joint]]) and type_ is not CommandType.FORCE
                control.command(self._engine.scene.joints[joint], type_, value)
        return owned

    def release(self, joints: Sequence[int]) -> None:
        """Let joints go limp, but those that an arm owns."""
        for joint in joints:
            if joint in self._control_of:
                self._control_of[joint].release(joint)

    def release_tree(self, root: int | None = None) -> None:
        """Let all joints of the tree with a root body go limp, or of all trees, those that arms own, too."""
        for control in self.moving:
            if root in (None, control.tree.root):
                control.release_rows(np.arange(len(control.links)))

    def commanded(self, bodies: set[int]) -> bool:
        """Whether a client commands a joint of a tree with any of ``bodies``."""
        return any(c.commanded for c in self.controls if not bodies.isdisjoint(c.tree.link_of))

    # --- single joints ----------------------------------------------------------------------

    def set_state(self, joint: int, position: float, velocity: float) -> None:
        """Set a joint to a position and velocity at once, without dynamics."""
        control = self._control_of[joint]
        control.set_state([control.row[joint]], [position], velocity)

    def axis(self, joint: int) -> int:
        """Number of a joint's axis among those of the world; raises KeyError for a joint that closes a loop."""
        control = self._control_of[joint]
        return int(control.first_axis + control.row[joint])

    def stop(self, joint: int, position: float, effort: float) -> None:
        """Stop a joint at ``position`` whatever its command, until `resume`; it reports ``effort``."""
        motions, control = self._engine.motions, self._control_of[joint]
        motions.rouse(self.controls.index(control))
        if stop(motions.table, self.table, self.axis(joint), float(position), float(effort)):
            control.sort()

    def limit_velocity(self, joint: int, low: float, high: float, strength: float) -> None:
        """Keep the velocity of a joint's motor between ``low`` and ``high``, and its effort below ``strength``."""
        self._control_of[joint].limit_velocity(joint, low, high, strength)

    def resume(self, joint: int) -> None:
        """End `stop` and `limit_velocity`."""
        self._control_of[joint].resume(joint)

    def driven(self, joint: int) -> bool:
        """Whether a command drives a joint."""
        control = self._control_of[joint]
        return bool(control.mode[control.row[joint]] != FREE)

    def position(self, joint: int) -> float:
        """Position of a joint now."""
        control = self._control_of[joint]
        return float(control.read(np.array([control.row[joint]]))[0, 0])

    def state(self, joint: int) -> NDArray[np.float64]:
        """Position, velocity and effort (3,) of a joint now; raises LookupError for one that closes a loop."""
        if joint not in self._control_of:
            raise LookupError("the joint closes a loop; its position is in the state alone")
        control = self._control_of[joint]
        found: NDArray[np.float64] = control.read(np.array([control.row[joint]]))[:, 0]
        return found

    def requested_effort(self, joint: int, stiffness: float) -> float:
        """Effort that a joint's command requests; see `ligature.physics.axes.asked_of`."""
        motions = self._engine.motions
        return float(requested_effort(motions.table, self.table, self.axis(joint), stiffness))

    # --- snapshots --------------------------------------------------------------------------

    def snapshot(self) -> list[dict[str, Any]]:
        """What the controllers of each tree keep from tick to tick."""
        return [control.snapshot() for control in self.controls]

    def restore(self, snapshot: list[dict[str, Any]]) -> None:
        """Continue from `snapshot`."""
        for control, state in zip(self.controls, snapshot, strict=True):
            control.restore(state)
