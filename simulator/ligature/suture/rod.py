"""One rod: its state, its tick, and its impulses on the bodies that it is attached to or touches.

World axes, SI units. Outside, poses are x y z qx qy qz qw of body frames B, twists linear then angular
with the linear part at the centre of mass.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import inverse, matrix_pose7, matrix_quaternion, quaternion_matrix
from ligature.model.poses import compose_rows
from ligature.model.subsystem import kept, put_back
from ligature.suture import layout
from ligature.suture.assembly import Numbering, chain_joints, chain_nodes, grasp_rows, point_constraint
from ligature.suture.bodies import Bodies
from ligature.suture.colliders import Colliders
from ligature.suture.description import Attachment, RodDescription
from ligature.suture.grasped import assign, force_of, nearest
from ligature.suture.parting import depth_of, draw_out, find_inside
from ligature.suture.partners import JawPads, Partner, PointConstraint
from ligature.suture.passages import Passages, passages
from ligature.suture.placing import Elements, bounds, sound, write_elements
from ligature.suture.releasing import Releases
from ligature.suture.springs import CAPACITY, read_other_loads, springs
from ligature.suture.ticking import RodTick, tick_rod
from ligature.tables import table_of

Array = NDArray[np.float64]

INDENTATION = 0.05
"""Penetration depth of a contact under 1 N, in radii."""

MAX_SPEED = 1e4
"""Speed in m/s beyond which a rod counts as diverged."""


class Rod:
    """An elastic rod among bodies.

    Parameters
    ----------
    description
        What the rod is made of.
    partners
        The bodies that it may meet; attachments name them by index.
    shapes
        Their convex parts, from `Colliders`; None for a rod that touches nothing but itself.
    dt
        Length of a tick in seconds.

    Attributes
    ----------
    joints
        The joints of the chain with their springs, angles and loads, those of the attachments at its ends included.
    springs
        What tissue does to the nodes; whoever fills them does so before every tick.
    shapes
        The convex parts of bodies around the rod.
    self_skip
        Elements on either side of one that it does not touch.
    tension
        (n,) pull along each element in newtons at the last tick.
    settled_soundly
        Whether the state after the last tick is finite and below `MAX_SPEED`.
    """

    def __init__(
        self,
        description: RodDescription,
        partners: Sequence[Partner] = (),
        shapes: layout.Shapes | None = None,
        dt: float = 1e-3,
    ) -> None:
        self.description = description
        self.partners = tuple(partners)
        self.dt = dt
        self.constraints: list[PointConstraint] = []
        self._pads: tuple[JawPads, ...] = ()
        n = len(description.mass)
        numbers = Numbering.of(description, partners)
        self._first, self._chain, self._total, self.node_of = (
            numbers.first, numbers.chain, numbers.total, numbers.node_of,
        )  # fmt: skip
        self._own = slice(self._first, self._first + n)
        self.joints = chain_joints(description, numbers.head, numbers.tail)
        self._unbent = self.joints.rest.copy()
        ends = ((0, numbers.head), (len(self._unbent) - 1, numbers.tail))
        self._releases = Releases(self.joints, [(j, end) for j, end in ends if end], dt)
        self._nodes = chain_nodes(description, self.partners, numbers, dt)
        self.shapes = shapes or layout.no_shapes(n)
        capacity = 256 + 8 * n + 3 * len(numbers.others)
        self._buffers = self._touches = tuple(layout.touches(capacity) for _ in range(3))
        self._touch_tables = np.array([table_of(touches) for touches in self._buffers])
        self._order = np.arange(3)
        lengths = np.linalg.norm(description.ends[:, 1] - description.ends[:, 0], axis=1)
        self._starts = np.concatenate([[0.0], np.cumsum(lengths)[:-1]])
        self.self_skip = 1 + int(np.ceil(np.pi * description.radius.max() / lengths.min()))
        self._arrays = layout.rod_arrays(
            self._nodes, self.joints, self.shapes, layout.work(self._chain, self._total, n, capacity), self._first,
            self.self_skip,
            1.0 / (INDENTATION * float(description.radius.min())), MAX_SPEED, dt,
        )  # fmt: skip
        self._table = table_of(self._arrays)
        self._permanent = [point_constraint(description, attachment) for attachment in numbers.others]
        self._mobile = np.full(self._total, -1)
        for partner in partners:
            if partner.mass > 0.0:
                self._mobile[self.node_of[partner.body]] = partner.body
        self._fixed = {p.body: p.fixed for p in partners}
        self._near: list[int] | None = None
        self._lent = 0
        """Springs that others have filled for the tick."""
        self._met, self._motion = np.zeros((0, 2), np.int64), np.zeros((0, 13))
        self._tick: RodTick | None = None
        self._tick_table = np.zeros(0, np.int64)
        self._apart: list[int] = []
        self._movable: list[tuple[int, int]] = []
        self._pulled: dict[int, tuple[Array, float, Array]] = {}
        self._external: dict[int, tuple[Array, Array]] = {}
        self._attached = [attachment.body for attachment in description.attachments]
        self._positions, self._corners = self._nodes.x[self._own], np.zeros((2, 3))
        self._inertial_to_body = np.array([matrix_pose7(inverse(T)) for T in description.T_body_inertial])
        self._bodies = np.array(description.bodies, dtype=np.int64)
        self.springs = springs(CAPACITY + n)
        self._spring_table = table_of(self.springs)
        self.take_passages(passages(1), 0)
        self.impulse, self.tension = self._arrays.impulse, self._arrays.tension
        self.reset()

    # --- state ------------------------------------------------------------------------------

    def reset(self) -> None:
        """Put every element back to its initial pose, at rest, and release added attachments and grasps."""
        nodes, own = self._nodes, self._own
        poses = np.array([matrix_pose7(T) for T in self.description.T_world_inertial])
        nodes.x[:], nodes.q[:] = 0.0, [0.0, 0.0, 0.0, 1.0]
        nodes.x[own], nodes.q[own] = poses[:, :3], poses[:, 3:]
        nodes.v[:], nodes.w[:] = 0.0, 0.0
        for partner in self.partners:
            nodes.fixed[self.node_of[partner.body]] = partner.fixed
        self._off = (False,) * len(self._off)
        self.joints.load[:], self.joints.angle[:], self.joints.rest[:] = 0.0, 0.0, self._unbent
        self.constraints, self._pads, self._near = [], (), None
        self._external.clear()
        self._constraint_rows = self._gather_constraints()
        self.tension[:], self.impulse[:] = 0.0, 0.0
        self.newton_steps, self.settled_soundly, self._pushed = 0, True, 0
        self._clear_touches()

    def _clear_touches(self) -> None:
        """Clear the contacts, and the rows of earlier ones."""
        for touches in self._touches:
            for array in touches:
                array[:] = 0

    def snapshot(self) -> dict[str, Any]:
        """Everything that lasts from tick to tick."""
        touches = self._touches[0]
        n = int(touches.count[0])
        return {
            **{name: getattr(self._nodes, name) for name in NODES_KEPT},
            **{name: getattr(self.joints, name) for name in JOINTS_KEPT},
            **{f"touch_{name}": np.array(getattr(touches, name)[:n]) for name in TOUCHES_KEPT},
            **kept(self, _KEPT),
        }

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`."""
        for name in NODES_KEPT:
            getattr(self._nodes, name)[:] = snapshot[name]
        for name in JOINTS_KEPT:
            getattr(self.joints, name)[:] = snapshot[name]
        self._clear_touches()
        touches = self._touches[0]
        n = touches.count[0] = len(snapshot["touch_key"])
        for name in TOUCHES_KEPT:
            getattr(touches, name)[:n] = snapshot[f"touch_{name}"]
        put_back(self, {name: snapshot[name] for name in _KEPT})
        self._near, self._pushed = None, 0
        self._constraint_rows = self._gather_constraints()

    def finite(self) -> bool:
        """Whether the state is usable."""
        nodes = self._nodes
        n = len(self.description.mass)
        return bool(sound(self._first, n, nodes.x, nodes.q, nodes.v, nodes.w, MAX_SPEED))

    def report_to(self, poses: Array, twists: Array, tensions: Array) -> None:
        """Have `write` fill the elements' rows of all bodies' body frames (b, 7), twists (b, 6) and tensions (b,)."""
        nodes = self._nodes
        self._elements = Elements(
            np.array([self._first]), nodes.x, nodes.q, nodes.v, nodes.w, self._inertial_to_body, self.tension,
            self._bodies, poses, twists, tensions, np.zeros((3, 3)),
        )  # fmt: skip
        self._element_table = table_of(self._elements)

    def write(self) -> None:
        """Write the elements' state to where `report_to` set."""
        write_elements(self._element_table)

    @property
    def positions(self) -> Array:
        """Centres of mass (n, 3) of the elements."""
        return self._positions

    @property
    def orientations(self) -> Array:
        """Quaternions (n, 4) of the elements' inertial frames."""
        return self._nodes.q[self._own]

    @property
    def twists(self) -> Array:
        """Velocities (n, 6) of the elements."""
        return np.hstack([self._nodes.v[self._own], self._nodes.w[self._own]])

    def set_motion(self, poses: Array, twists: Array) -> None:
        """Put the elements' inertial frames to ``poses`` (n, 7) moving with ``twists`` (n, 6)."""
        nodes, own = self._nodes, self._own
        nodes.x[own], nodes.q[own] = poses[:, :3], poses[:, 3:]
        nodes.v[own], nodes.w[own] = twists[:, :3], twists[:, 3:]

    def hangs_on(self, body: int) -> bool:
        """Whether ``body`` and nothing else holds the rod."""
        attached = set(self._attached).difference(self._releases.bodies)
        return attached.union(constraint.body for constraint in self.constraints) == {body}

    @property
    def _off(self) -> tuple[bool, ...]:
        """Which ends have come off what they were attached to."""
        return self._releases.off

    @_off.setter
    def _off(self, off: tuple[bool, ...]) -> None:
        self._releases.set(off)

    def carry(self, T: Array) -> None:
        """Move the whole rod by ``T`` (4, 4) in world axes, at rest and without contacts."""
        nodes, own = self._nodes, self._own
        nodes.x[own] = nodes.x[own] @ T[:3, :3].T + T[:3, 3]
        for i in range(own.start, own.stop):
            nodes.q[i] = matrix_quaternion(T[:3, :3] @ quaternion_matrix(nodes.q[i]))
        nodes.v[own], nodes.w[own] = 0.0, 0.0
        for touches in self._touches:
            touches.count[0] = 0

    def hold_element(self, element: int, held: bool = True) -> None:
        """Let an element keep its present velocity against all forces, or free it again."""
        self._nodes.fixed[self._first + element] = held

    @property
    def nodes(self) -> layout.Nodes:
        """The arrays of all nodes; the elements begin at row ``first``."""
        return self._nodes

    @property
    def first(self) -> int:
        """Row of the first element in `nodes`."""
        return self._first

    def take_passages(self, held: Passages, owner: int) -> None:
        """Include the passages of ``held`` with this ``owner`` in the solve from now on."""
        self._passages, self._passage_table, self._owner = held, table_of(held), np.array([owner])
        self._tick = None

    def pull_partner(self, body: int, acceleration: Array, mass: float, inertia: Array) -> None:
        """Set ``acceleration`` (3,), ``mass`` and ``inertia`` (3,) of a movable partner for the coming tick.

        Loads and holders of a partner change from tick to tick.
        """
        i, nodes = self.node_of[body], self._nodes
        self._pulled.setdefault(i, (nodes.gravity[i].copy(), float(nodes.mass[i]), nodes.inertia[i].copy()))
        nodes.gravity[i], nodes.mass[i], nodes.inertia[i] = acceleration, mass, inertia

    @property
    def spring_table(self) -> NDArray[np.int64]:
        """The springs for compiled code."""
        return self._spring_table

    def clear_springs(self) -> None:
        """Remove the springs of the last tick."""
        self.springs.filled[0] = 0

    def read_joint_load(self, body: int, out: Array) -> None:
        """Fill ``out`` with force and moment (6,) of the rod on a partner in the last tick, without its `springs`."""
        node = self.node_of[body]
        read_other_loads(self._spring_table, node, self.impulse[node], self.dt, out)

    def end_pulls(self) -> None:
        """Undo `pull_partner`."""
        nodes = self._nodes
        for i, (gravity, mass, inertia) in self._pulled.items():
            nodes.gravity[i], nodes.mass[i], nodes.inertia[i] = gravity, mass, inertia
        self._pulled.clear()

    def push(self, element: int, force: Array, point: Array, stiffness: Array) -> None:
        """Push an element with ``force`` (3,) at ``point`` (3,) in the coming tick.

        ``stiffness`` (3, 3) is how the force gives way to the point's motion within the tick: the force of a stiff
        penalty law would throw an element of micrograms otherwise.
        """
        x, y, z = (point - self.positions[element]).tolist()
        J = np.hstack([np.eye(3), [[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]]])
        K, load = self._external.get(element, (np.zeros((6, 6)), np.zeros(6)))
        self._external[element] = K + J.T @ stiffness @ J, load + J.T @ force

    def _begin_pushes(self) -> None:
        """Make springs of what `push` took, as many as there is room for."""
        springs = self.springs
        for element, (K, load) in self._external.items():
            row = int(springs.filled[0])
            if row < len(springs.node):
                springs.node[row], springs.K[row], springs.load[row] = self._first + element, K, load
                springs.filled[0] = row + 1
        self._external.clear()

    def _end_pushes(self) -> None:
        """Remove the springs of `push` and `draw_out`, which come after those of others."""
        if int(self.springs.filled[0]) == self._lent:
            return
        for array in self.springs[1:]:
            array[self._lent : self.springs.filled[0]] = 0
        self.springs.filled[0] = self._lent

    def find_inside(self, parts: NDArray[np.bool_], inside: NDArray[np.bool_]) -> None:
        """Flag elements ``inside`` (S, n) the ``parts`` (S,) of `shapes` that they may collide with."""
        find_inside(self._table, parts, inside)

    def depth(self, part: int, element: int) -> float:
        """How deep the axis of an element is in a part of `shapes`, in metres; below 0 outside."""
        return float(depth_of(self._table, part, element))

    def draw_out(self, never: NDArray[np.bool_], inside: NDArray[np.bool_]) -> bool:
        """Push elements out of the parts that they are ``inside`` (S, n) in the coming tick; see `parting.draw_out`."""
        return bool(draw_out(self._table, self._spring_table, never, inside, self.dt))

    def set_gravity(self, element: int, acceleration: Sequence[float]) -> None:
        """Set the gravity ``acceleration`` (3,) of an element from now on."""
        self._nodes.gravity[self._first + element] = acceleration

    @property
    def body_poses(self) -> Array:
        """Poses (n, 7) of the elements' body frames."""
        own = np.hstack([self.positions, self.orientations])
        poses = np.empty_like(own)
        compose_rows(own, self._inertial_to_body, np.arange(len(own)), poses)
        return poses

    @property
    def contacts(self) -> layout.Touches:
        """Contact points of the last tick; only the first ``count[0]`` rows count."""
        return self._touches[0]

    # --- the tick ---------------------------------------------------------------------------

    def box(self) -> Array:
        """Corners (2, 3) of a box around all centres of elements."""
        bounds(self._positions, self._corners)
        return self._corners

    def place(self, body: int, pose: Array, twist: Array) -> None:
        """Set pose (7,) and twist (6,) of a partner's inertial frame at the start of the tick."""
        i, nodes = self.node_of[body], self._nodes
        nodes.x[i], nodes.q[i], nodes.v[i], nodes.w[i] = pose[:3], pose[3:], twist[:3], twist[3:]

    def set_mass(self, partner: Partner, mass: float, inertia: Array, held: bool) -> None:
        """Set ``mass`` and principal moments ``inertia`` (3,) of a partner; a ``held`` one does not fall."""
        i, nodes = self.node_of[partner.body], self._nodes
        nodes.mass[i], nodes.inertia[i] = mass, inertia
        nodes.gravity[i] = 0.0 if held else partner.gravity

    def meet(self, colliders: Colliders, near: list[int], bodies: Bodies) -> None:
        """Read the motion of the partners of this tick: those near, attached or grasping."""
        self._lent = int(self.springs.filled[0])
        if near is not self._near:
            self._gather_partners(colliders, near)
        for body in self._apart:
            self.place(body, *bodies.motion(body))
        for body, node in self._movable:
            self._nodes.fixed[node] = bodies.driven(body)

    def _gather_partners(self, colliders: Colliders, near: list[int]) -> None:
        """Collect the partners of this tick: their shapes, the source of their motion, and which of them can move."""
        self._near, self._motion, self._tick = near, colliders.motion, None
        self.shapes.node[:] = -1
        for body in near:
            self.shapes.node[colliders.parts_of(body)] = self.node_of[body]
        rows = [(colliders.row_of[body], self.node_of[body]) for body in near]
        self._met = np.array(rows, dtype=np.int64).reshape(-1, 2)
        holding = sorted({*self._attached, *(g.body for g in self.constraints), *(p.body for p in self._pads)})
        self._apart = [body for body in holding if body not in near]
        partners = [(body, self.node_of[body]) for body in (*near, *self._apart)]
        self._movable = [(body, node) for body, node in partners if not self._fixed[body]]
        self._nodes.met[self._chain :] = False
        self._nodes.met[[node for _, node in partners]] = True

    def attach(self, element: int, body: int, T_element_a: Array, T_body_b: Array) -> None:
        """Attach frame a of an element to frame b of a partner, (4, 4) in their frames B.

        Raises ValueError for a body that is no partner.
        """
        if body not in self.node_of:
            raise ValueError(
                f"rod '{self.description.name}' cannot be attached to body {body}: the body has no collision shape"
            )
        description = self.description
        T_a = inverse(description.T_body_inertial[element]) @ T_element_a
        partner = next(p for p in self.partners if p.body == body)
        T_b = inverse(partner.T_body_inertial) @ T_body_b
        none = np.zeros(3)
        attachment = Attachment(element, body, T_a, T_b, none, none, none, none, none)
        self.constraints.append(point_constraint(description, attachment))
        self._near = None
        self._constraint_rows = self._gather_constraints()

    def detach(self, element: int, body: int) -> None:
        """Remove an attachment that `attach` made."""
        self.constraints = [g for g in self.constraints if (g.element, g.body) != (element, body)]
        self._near = None
        self._constraint_rows = self._gather_constraints()

    def set_pads(self, pads: Sequence[JawPads]) -> None:
        """Grasp the elements between ``pads`` from now on, and no others."""
        before, self._pads = self._pads, tuple(pads)
        if len(before) == len(pads) and all(map(JawPads.is_as, pads, before)):
            limits = [p.limit / len(p.points) for p in pads for _ in p.points]
            points = self._constraint_rows[1]
            points[len(points) - len(limits) :, 2, 0, 0] = limits
            return
        if [p.body for p in pads] != [p.body for p in before]:
            self._near = None
        self._constraint_rows = self._gather_constraints()

    def _gather_constraints(self) -> tuple[NDArray[np.int64], Array]:
        """Nodes and kinds (g, 3) and points (g, 3, 2, 3) of all point constraints and grasps; grasps last."""
        held = (*self._permanent, *self.constraints)
        nodes = [(self._first + g.element, self.node_of[g.body], 0) for g in held]
        nodes += [(self._first, self.node_of[p.body], 1) for p in self._pads for _ in p.points]
        points = np.array([*(g.points for g in held), *(p for pads in self._pads for p in grasp_rows(pads))])
        self._tick = None
        return np.array(nodes, dtype=np.int64).reshape(-1, 3), points.reshape(-1, 3, 2, 3)

    def _find_grasped(self) -> None:
        """Assign to every grasp the element nearest to its point."""
        x, q, own = self._nodes.x, self._nodes.q, len(self.positions)
        assign(*self._constraint_rows, self._first, own, x, q, np.zeros((3, 3)))

    def nearest(self, point: Array) -> tuple[int, Array, Array, float]:
        """The element nearest to ``point`` (3,), its point nearest to it, its direction, and the arc length there."""
        out, d = np.zeros(7), self.description
        element = int(nearest(self.positions, self.orientations, d.ends, self._starts, point, np.zeros((3, 3)), out))
        return element, out[:3], out[3:6], float(out[6])

    def grasped(self, body: int) -> tuple[int, Array]:
        """Element between the pads of a body, -1 for none, and force (3,) of the pads on the rod in the last tick."""
        held, force = self._grasped_by(self.node_of[body])
        return (held - self._first if held >= 0 else -1), force

    def _grasped_by(self, node: int) -> tuple[int, Array]:
        """The node between the pads of another node, -1 for none, and their force (3,) on it."""
        t, force = self._touches[0], np.zeros(3)
        return int(force_of(node, int(t.count[0]), t.key, t.node, t.bilateral, t.force, force)), force

    def warm_up(self) -> None:
        """Compile what a grasp takes, or load it from the cache, so that the first one does not wait."""
        self.nearest(np.zeros(3))
        self._find_grasped()
        self._grasped_by(0)

    def pushes(self) -> list[tuple[int, Array]]:
        """Movable partners that the last tick pushed, with impulse and moment (6,) about their centre."""
        pushed = self._arrays.pushed[: self._pushed]
        bodies = self._mobile[pushed].tolist()
        return [(body, self.impulse[node]) for body, node in zip(bodies, pushed.tolist(), strict=True) if body >= 0]

    def step(self) -> None:
        """Advance by one tick; `impulse` then holds the impulse on each partner."""
        if self._pads:
            self._find_grasped()
        self._begin_pushes()
        tick_rod(self.tick_table.ctypes.data)
        self._end_pushes()
        self.conclude()
        self.end_pulls()

    @property
    def tick_table(self) -> NDArray[np.int64]:
        """What a tick takes, as the table of a `RodTick`."""
        if self._tick is None:
            self._tick = RodTick(
                self._table, self._touch_tables, self._order, self._passage_table, self._owner, self._spring_table,
                *self._constraint_rows, self._motion, self._met, self._positions, self._mobile,
            )  # fmt: skip
            self._tick_table = table_of(self._tick)
        return self._tick_table

    def conclude(self) -> None:
        """Take over what the last tick left in the arrays."""
        _, _, self.newton_steps, _, self._pushed, finite = self._arrays.counts.tolist()
        self.settled_soundly = bool(finite)
        self._touches = tuple(self._buffers[k] for k in self._order.tolist())
        if self._releases.possible:
            self._releases.look()

    def coasts(self, near: list[int]) -> bool:
        """Whether the coming ticks take nothing but `tick_table`, as long as no other bodies are ``near``."""
        waits = self._apart or self._pads or self._external or self._pulled or self._releases.possible
        return near is self._near and not waits

    def impulse_on(self, body: int) -> Array:
        """Linear and angular impulse (6,) of the last tick on a partner, about its centre of mass."""
        return self.impulse[self.node_of[body]]


NODES_KEPT = ("x", "q", "v", "w", "mass", "inertia", "gravity", "fixed")
JOINTS_KEPT = ("angle", "load", "rest")
TOUCHES_KEPT = ("node", "key", "slip", "press", "closed", "mode", "bilateral", "normal", "force", "start")
"""Arrays of nodes, joints and contact points that last from tick to tick."""

_KEPT = ("tension", "impulse", "constraints", "_pads", "newton_steps", "settled_soundly", "_off")
"""Attributes of a `Rod` that do."""
