"""What a plug-in sees of the simulation and does to it: the stable part of Ligature's inside.

Everything is as it is in this tick, whatever the rate of updates. World axes, SI units; poses are x y z qx qy qz qw.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ligature.model.commands import Command, Reset
from ligature.model.frames import pose7_matrix
from ligature.model.hits import Contact, RayHits
from ligature.model.lookup import find_by_text
from ligature.model.scene import Scene
from ligature.model.voxels import Values, VolumeForm

Array = NDArray[np.float64]

MAX_FORCE = 1e6
"""Largest force in newtons with which a plug-in may push."""


CENTROID_ERROR = 0.02
"""Approximate error of the centroid of an overlap, in radii of the ball, that voxels cause."""


class Bodies(Protocol):
    """Rigid bodies and elements of threads as one: `ligature.sensing.targets.Targets`."""

    def pose7(self, body: int) -> Array:
        """Pose (7,) of a body frame now."""

    def twist(self, body: int) -> Array:
        """Linear velocity of the centre of mass and angular velocity, (6,)."""

    def push(self, body: int, force: Array, point: Array, stiffness: Array) -> None:
        """Push a body with ``force`` (3,) at ``point`` (3,) in the coming step."""

    def contacts(self, body: int, threshold: float) -> list[Contact]:
        """Contact points of ``body`` whose distance is at most ``threshold``."""

    def ray_test(self, starts: Array, ends: Array) -> RayHits:
        """Closest hits of the segments ``starts`` to ``ends``, each (n, 3)."""


class Voxels(Protocol):
    """A volume as it is now, in its own frame: `ligature.physics.volumes.Voxels`."""

    form: VolumeForm
    values: Values
    count: int

    @property
    def removed(self) -> int:
        """Voxels that were removed since the start."""

    def cut(self, start: Array, end: Array, radius: float) -> int:
        """Remove what a ball meets on its way; returns how many voxels."""

    def overlap(self, centre: Array, radius: float) -> Overlap:
        """What a ball shares with the inside."""


class Overlap(Protocol):
    """`ligature.physics.volumes.Overlap`."""

    @property
    def volume(self) -> float:
        """Cubic metres."""

    @property
    def moment(self) -> Array:
        """First moment (3,) about the ball's middle, in m⁴."""


class Volume:
    """A volume that plug-ins cut; made by `Host.volume`.

    Attributes
    ----------
    body
        Index of its body.
    """

    def __init__(self, host: Host, body: int, voxels: Voxels) -> None:
        self._host, self.body, self._voxels = host, body, voxels
        self._values = voxels.values.view()
        self._values.flags.writeable = False

    @property
    def values(self) -> Values:
        """The voxels (nx, ny, nz), 0 to 255, as they are now; read-only."""
        return self._values

    @property
    def level(self) -> float:
        """Voxels of at least this value are inside."""
        return self._voxels.form.level

    @property
    def spacing(self) -> Array:
        """Edges of a voxel, (3,) m."""
        return self._voxels.form.spacing

    @property
    def count(self) -> int:
        """Voxels inside now."""
        return self._voxels.count

    @property
    def removed(self) -> int:
        """Voxels that were removed since the start of the scene, or since the last reset."""
        return self._voxels.removed

    def local(self, point: Sequence[float] | Array) -> Array:
        """A point (3,) of the world in the frame of the volume, whose origin is in the middle of its box."""
        return _local(self._pose(), _point(point))

    def cut(self, start: Sequence[float] | Array, end: Sequence[float] | Array, radius: float) -> int:
        """Remove the voxels whose centres a moving ball touches.

        Parameters
        ----------
        start, end
            Centre of the ball at the start and at the end of its motion, (3,) in the world, metres.
        radius
            Radius of the ball in metres.

        Returns
        -------
        int
            The number of voxels that were removed.

        Raises
        ------
        RuntimeError
            Outside `Plugin.before_step`.
        ValueError
            If a point is not three finite numbers, or the radius not a finite number above 0.
        """
        self._host._check_before("volumes are cut in before_step")
        T = self._pose()
        return self._voxels.cut(_local(T, _point(start)), _local(T, _point(end)), _radius(radius))

    def overlap(self, centre: Sequence[float] | Array, radius: float) -> tuple[float, Array]:
        """Volume in which a ball and the inside overlap, and the direction out of it.

        Parameters
        ----------
        centre
            Centre of the ball, (3,) in the world, metres.
        radius
            Radius of the ball in metres.

        Returns
        -------
        float
            Volume of the overlap in m³.
        Array
            Unit vector (3,) in world axes from the centroid of the overlap to ``centre``; zero if these two are closer
            than `CENTROID_ERROR` radii, as deep inside.

        Raises
        ------
        ValueError
            If the centre is not three finite numbers, or the radius not a finite number above 0.
        """
        T = self._pose()
        found = self._voxels.overlap(_local(T, _point(centre)), _radius(radius))
        length = float(np.linalg.norm(found.moment))
        away = np.zeros(3) if length <= CENTROID_ERROR * radius * found.volume else -found.moment / length
        return found.volume, T[:3, :3] @ away

    def _pose(self) -> Array:
        return pose7_matrix(self._host.pose(self.body))


def _local(T: Array, point: Array) -> Array:
    """A point (3,) in the frame that stands at ``T``."""
    local: Array = (point - T[:3, 3]) @ T[:3, :3]
    return local


def _point(values: Sequence[float] | Array) -> Array:
    point = np.asarray(values, dtype=float)
    if point.shape != (3,) or not np.isfinite(point).all():
        raise ValueError(f"a point has three finite numbers, not {values}")
    return point


def _radius(radius: float) -> float:
    if not (np.isfinite(radius) and radius > 0.0):
        raise ValueError(f"a radius is a finite number above 0, not {radius}")
    return float(radius)


class Host:
    """The interface of a plug-in to the simulation: `Plugin.host`.

    Parameters
    ----------
    scene
        The simulated scene: bodies, joints, sensors with their names and indices.
    dt
        Length of a tick in seconds.
    bodies
        Poses, twists, contacts and rays of bodies and threads, and pushes on them.
    joint
        Returns position, velocity and effort (3,) of a joint by its index.
    tick
        Returns the number of ticks since the start.
    apply
        Takes commands.
    volumes
        The volumes that plug-ins may cut, by the indices of their bodies.
    """

    def __init__(
        self,
        scene: Scene,
        dt: float,
        bodies: Bodies,
        joint: Callable[[int], Array],
        tick: Callable[[], int],
        apply: Callable[[Command], None],
        volumes: Mapping[int, Voxels],
    ) -> None:
        self.scene, self.dt = scene, dt
        self._bodies, self._joint, self._tick, self._apply = bodies, joint, tick, apply
        self._body_names = [body.identity.identifier for body in scene.bodies]
        self._joint_names = [joint.identity.identifier for joint in scene.joints]
        self._volumes = {body: Volume(self, body, voxels) for body, voxels in volumes.items()}
        self._pushed: set[int] = set()
        self._before, self._ahead = False, 0

    @contextmanager
    def before_step(self) -> Iterator[None]:
        """A context in which pushes and cuts are accepted."""
        self._before = True
        try:
            yield
        finally:
            self._before = False

    @contextmanager
    def after_step(self) -> Iterator[None]:
        """A context in which `time` is the end of the tick."""
        self._ahead = 1
        try:
            yield
        finally:
            self._ahead = 0

    def take_pushed(self) -> set[int]:
        """The bodies that were pushed since the last call."""
        pushed, self._pushed = self._pushed, set()
        return pushed

    @property
    def time(self) -> float:
        """Simulated seconds since the start, including the tick that has just ended."""
        return (self._tick() + self._ahead) * self.dt

    def body(self, text: str) -> int:
        """Index of the body with this identifier, or with a part of it that no other has; raises LookupError."""
        return _found("body", self._body_names, text)

    def volume(self, text: str) -> Volume:
        """The volume with this identifier, or with a part of it that no other volume has; raises LookupError."""
        bodies = list(self._volumes)
        return self._volumes[bodies[_found("volume", [self._body_names[body] for body in bodies], text)]]

    def joint(self, text: str) -> int:
        """Index of the joint with this identifier, or with a part of it that no other has; raises LookupError."""
        return _found("joint", self._joint_names, text)

    def pose(self, body: int) -> Array:
        """Pose (7,) of the frame of a body or thread element: x y z qx qy qz qw, world, metres."""
        return self._bodies.pose7(body)

    def twist(self, body: int) -> Array:
        """Linear velocity of the centre of mass and angular velocity, (6,) in world axes, m/s and rad/s."""
        return self._bodies.twist(body)

    def joint_state(self, joint: int) -> tuple[float, float]:
        """Position and velocity of a joint, rad or m, and per second; raises LookupError if it closes a loop."""
        position, velocity = self._joint(joint)[:2].tolist()
        return position, velocity

    def contacts(self, body: int, threshold: float = 0.0) -> list[Contact]:
        """Contact points of ``body`` with others, up to a gap of ``threshold`` metres: points and normals on these."""
        return self._bodies.contacts(body, threshold)

    def rays(self, starts: Array, ends: Array) -> RayHits:
        """The closest hit of each segment from ``starts`` to ``ends``, (n, 3) in the world; body -1 for no hit."""
        return self._bodies.ray_test(np.asarray(starts, dtype=float), np.asarray(ends, dtype=float))

    def push(self, body: int, force: Sequence[float] | Array, point: Sequence[float] | Array | None = None) -> None:
        """Push a body in this tick.

        Parameters
        ----------
        body
            Index of the body or thread element.
        force
            Force (3,) in world axes, newtons, at most `MAX_FORCE`.
        point
            Where the force acts, (3,) in the world, metres; by default the origin of the body frame.

        Raises
        ------
        RuntimeError
            Outside `Plugin.before_step`.
        ValueError
            If force or point are not three finite numbers, or the force is too large.
        """
        self._check_before("bodies are pushed in before_step")
        where = self.pose(body)[:3] if point is None else np.asarray(point, dtype=float)
        how = np.asarray(force, dtype=float)
        if how.shape != (3,) or where.shape != (3,) or not np.isfinite([how, where]).all():
            raise ValueError(f"a force and a point have three finite numbers each, not {force} and {point}")
        if np.linalg.norm(how) > MAX_FORCE:
            raise ValueError(f"a force is at most {MAX_FORCE:g} N, not {np.linalg.norm(how):g}")
        self._bodies.push(body, how, where, np.zeros((3, 3)))
        self._pushed.add(body)

    def _check_before(self, what: str) -> None:
        if not self._before:
            raise RuntimeError(f"{what}, where actions apply to one tick")

    def apply(self, command: Command) -> None:
        """Apply a ``command`` of `ligature.model.commands` or `ligature.robots.commands`, as front ends do.

        Raises ValueError for an invalid command, and for a reset, which is possible between ticks only.
        """
        if isinstance(command, Reset):
            raise ValueError("a plug-in cannot reset the simulation that it is part of")
        self._apply(command)


def _found(kind: str, names: Sequence[str], text: str) -> int:
    index = find_by_text(names, text)
    if index is None:
        raise LookupError(f"'{text}' does not name exactly one {kind}; the scene has {', '.join(names) or 'none'}")
    return index
