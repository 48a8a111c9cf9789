"""Notices bodies that move as nothing commanded should: faster than 50 m/s, or with energy from nowhere.

Reads states only, so that physics has the same bits with it. World axes, SI units.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.adf import Diagnostic, Severity
from ligature.adf.diagnostics import length
from ligature.kernels import compiled
from ligature.model.frames import pose7_matrix
from ligature.model.scene import Body, Joint, JointType, Scene, SensorType
from ligature.model.state import StateRecord
from ligature.physics.inertias import LEAST_MASS, inertia_of
from ligature.physics.overlaps import DEEP
from ligature.physics.world import World

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

MAX_SPEED = 50.0
"""Speed in m/s that nothing in an operating room has."""

LEAP = 10.0
"""Gain of speed in m/s within an update, beyond what gravity gives, that nothing without a command has."""

OPEN = 0.001
"""Gap in metres from which it is a likely cause."""

STRONG_GRAVITY = 100.0
"""Gravity in m/s² from which it is a likely cause."""

FALLS = 0.99
"""Cosine between velocity and gravity from which a body falls: within 8°."""

UNEQUAL = 1e4
"""Ratio of masses within a tree from which it is a likely cause."""


@compiled
def _suspect(twist: Array, gyration: Array, mass: Array, rigid: Flags, before: Array, leap: float) -> int:
    """The body to report, -1 for none.

    ``twist`` (n, 6) of all bodies; ``gyration`` (n,) is moment of inertia over mass; ``before`` (n,) holds v² + k² ω²
    of the last call and takes that of this one. A body leaps when the energy of all bodies grew with its own: what
    another one hits does not.
    """
    worst, max_velocity, gained = -1, MAX_SPEED * MAX_SPEED, 0.0
    leaper, farthest, share = -1, leap, 0.0
    for i in range(mass.shape[0]):
        v = twist[i, 0] * twist[i, 0] + twist[i, 1] * twist[i, 1] + twist[i, 2] * twist[i, 2]
        w = twist[i, 3] * twist[i, 3] + twist[i, 4] * twist[i, 4] + twist[i, 5] * twist[i, 5]
        if v > max_velocity and mass[i] > 0.0:
            worst, max_velocity = i, v
        now = v + gyration[i] * w
        gained += mass[i] * (now - before[i])
        # nearly all bodies are slow: no root is taken of theirs
        if now > leap * leap and rigid[i] and np.sqrt(now) - np.sqrt(before[i]) > farthest:
            leaper, farthest, share = i, np.sqrt(now) - np.sqrt(before[i]), mass[i] * (now - before[i])
        before[i] = now
    if worst < 0 and leaper >= 0 and gained > 0.5 * share:
        return leaper
    return worst


def findings(scene: Scene) -> list[Diagnostic]:
    """Warnings of what moves bodies at `MAX_SPEED` by the numbers of the files alone."""
    return [*_of_gravity(scene), *_of_resistance(scene)]


def _of_gravity(scene: Scene) -> list[Diagnostic]:
    """One for each gravity above `STRONG_GRAVITY`, at the first of the bodies that feel it."""
    strong: dict[float, list[Body]] = {}
    for body in scene.bodies:
        gravity = float(np.linalg.norm(body.gravity))
        if not body.static and gravity > STRONG_GRAVITY:
            strong.setdefault(gravity, []).append(body)
    found = []
    for gravity, bodies in strong.items():
        first, others = bodies[0].identity, len(bodies) - 1
        who = f"'{first.identifier}'" + (f" and {others} more" if others else "")
        message = f"gravity of {gravity:g} m/s² moves {who} at {MAX_SPEED:g} m/s after {MAX_SPEED / gravity:.2g} s"
        found.append(Diagnostic(Severity.WARNING, message, first.mark, "write gravity in m/s²", "speed"))
    return found


def _of_resistance(scene: Scene) -> list[Diagnostic]:
    """One for each resistance sensor whose rays, pressed in whole, hold the energy to move its body so fast."""
    found = []
    for sensor in scene.sensors:
        body, stiffness = scene.bodies[sensor.parent], sensor.resistance.contact_stiffness
        if sensor.type is not SensorType.RESISTANCE or body.static or body.index in scene.rod_bodies:
            continue
        way = float(np.linalg.norm(sensor.rays[:, 1] - sensor.rays[:, 0], axis=1).sum())
        speed = (stiffness * way / body.mass) ** 0.5  # the force falls from `stiffness` to 0 along a ray
        if speed >= MAX_SPEED:
            message = (
                f"resistance sensor '{sensor.identity.key}' can throw '{body.identity.identifier}' "
                f"({body.mass:.3g} kg) at {speed:.3g} m/s: its rays push with up to {stiffness:g} N each, "
                f"along {length(way)} in all"
            )
            hint = "make 'range' or 'contact stiffness' smaller"
            found.append(Diagnostic(Severity.WARNING, message, sensor.identity.mark, hint, "speed"))
    return found


class Guard:
    """Watches the bodies of a world by its state record; every tree is reported once."""

    def __init__(self, scene: Scene, world: World, state: StateRecord) -> None:
        self._scene, self._world = scene, world
        self._state = state
        self._twist = state["body_twist"][0]
        self._mass = np.array([body.mass for body in scene.bodies])
        inertia = np.array([inertia_of(body).max() for body in scene.bodies])
        self._gyration = np.divide(inertia, self._mass, out=np.zeros(len(inertia)), where=self._mass >= LEAST_MASS)
        self._rigid = np.array([b.index not in scene.rod_bodies and not b.static for b in scene.bodies], dtype=bool)
        self._before = np.zeros(len(scene.bodies))
        gravity = np.array([body.gravity for body in scene.bodies]).reshape(-1, 3)
        self._gravity = float(np.linalg.norm(gravity, axis=1).max(initial=0.0))
        self._reported: set[int] = set()
        self._acted: dict[int, str] = {}

    def reset(self) -> None:
        """Bodies were put elsewhere: they start from the motion that the state has."""
        self._acted.clear()
        _suspect(self._twist, self._gyration, self._mass, self._rigid, self._before, np.inf)

    def check(self, seconds: float) -> Diagnostic | None:
        """What the state shows that was not reported; ``seconds`` have passed since the last check."""
        leap = LEAP + 2.0 * self._gravity * seconds
        suspect = _suspect(self._twist, self._gyration, self._mass, self._rigid, self._before, leap)
        if suspect >= 0:
            return self._report(suspect)
        if self._acted:  # what is slow now will owe its speed to nothing that has ended
            self._acted = {body: who for body, who in self._acted.items() if self._world.commanded({body})}
        return None

    def note(self, body: int, who: str = "a command") -> None:
        """``who`` acts on a body: the likely cause of what is fast from now on, also when it has ended."""
        self._acted[body] = who

    def _linked(self, index: int) -> set[int]:
        """The bodies of a tree or rod, and those that threads link to it."""
        linked, size = self._world.kin(index), 0
        while len(linked) > size:
            size = len(linked)
            for rod in self._scene.rods:
                ends = {b for j in rod.anchors for b in (self._scene.joints[j].parent, self._scene.joints[j].child)}
                if not linked.isdisjoint(ends):
                    linked |= ends.union(*map(self._world.kin, ends))
        return linked

    def _report(self, index: int) -> Diagnostic | None:
        members = self._linked(index)
        if index in self._reported or self._world.commanded(members):
            return None
        self._reported |= members
        body = self._scene.bodies[index]
        speed, turn = np.linalg.norm(self._twist[index, :3]), np.linalg.norm(self._twist[index, 3:])
        what = f"moves at {speed:.3g} m/s" if speed > LEAP else f"turns at {turn:.3g} rad/s"
        cause, remedy = self._cause(body, members)
        message = f"'{body.identity.identifier}' {what}, without a command for it; likely cause: {cause}"
        return Diagnostic(Severity.WARNING, message, body.identity.mark, remedy, "speed")

    def _cause(self, body: Body, members: set[int]) -> tuple[str, str]:
        """Likely cause and remedy."""
        scene = self._scene
        acted = next((i for i in (body.index, *sorted(members)) if i in self._acted), None)
        if acted is not None:
            name = scene.bodies[acted].identity.identifier
            return f"{self._acted[acted]} that pushed '{name}'", "push less, or slow it down before the push ends"
        if body.index in scene.rod_bodies:
            return "a rod that is pulled or squeezed too hard", "check its joints and attachments"
        strong = float(np.linalg.norm(body.gravity))
        if strong > STRONG_GRAVITY:
            return f"gravity of {strong:g} m/s²", "write gravity in m/s²"
        velocity = self._twist[body.index, :3]
        if strong > 0.0 and velocity @ body.gravity > FALLS * strong * np.linalg.norm(velocity):
            return (
                "it falls, and nothing is below it",
                "put a floor below it, hold it by a joint, or set its gravity to 0",
            )
        gaps = [(self._gap(scene.joints[j]), j) for j in scene.loops if self._touches(scene.joints[j], members)]
        gap, loop = max(gaps, default=(0.0, -1))
        if gap > OPEN:
            name = scene.joints[loop].identity.key
            return f"joint '{name}' closes a loop that gapes by {length(gap)}", "let its pivots meet"
        depth, one, other = self._world.queries.overlap(members)
        if depth > DEEP:
            name = scene.bodies[other].identity.identifier
            who = "it" if one == body.index else f"'{scene.bodies[one].identity.identifier}'"
            return f"{who} overlaps '{name}' by {length(depth)}", "move them apart, or disable their collision"
        masses = [scene.bodies[i].mass for i in members if scene.bodies[i].mass > 0.0]
        if max(masses) > UNEQUAL * min(masses):
            return f"joined bodies of {min(masses):g} kg and {max(masses):g} kg", "give them masses that are closer"
        sprung = next((j for j in scene.joints if self._touches(j, members) and _is_sprung(j)), None)
        if sprung is not None:
            return f"the spring of joint '{sprung.identity.key}'", "soften it, or start nearer to its rest position"
        if gaps:
            return f"joint '{scene.joints[loop].identity.key}' that closes a loop", "look at its axes"
        return "not found", "look at its shapes, joints and masses"

    def _touches(self, joint: Joint, members: set[int]) -> bool:
        return joint.parent in members or joint.child in members

    def _gap(self, joint: Joint) -> float:
        """Distance in metres between the two pivots of a joint."""
        ends = []
        for index, T in ((joint.parent, joint.T_parent_a), (joint.child, joint.T_child_b)):
            pose = pose7_matrix(self._state["body_pose"][0, index])
            ends.append((pose @ self._scene.bodies[index].T_body_inertial @ T)[:3, 3])
        apart = ends[0] - ends[1]
        if joint.type is JointType.PRISMATIC:
            return 0.0
        return float(np.linalg.norm(apart))


def _is_sprung(joint: Joint) -> bool:
    return joint.stiffness > 0.0 or (joint.six_dof is not None and bool(joint.six_dof.stiffness.any()))
