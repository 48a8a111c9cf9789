"""The operator's keys, game pad and drags in the picture: where the selected arm's tip is to go. World axes, metres.

Keys and sticks move the tip right, up and into what the operator looks at; a drag moves it in the picture's plane.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.cockpit.arm_facts import ArmFacts
from ligature.cockpit.deadman import GONE
from ligature.cockpit.orders import MODES, Drag
from ligature.cockpit.pursuit import ANGULAR, LINEAR, ArmPursuits
from ligature.cockpit.rhythm import Rhythm
from ligature.model.frames import pose7_matrix
from ligature.model.scene import ArmKind, Camera
from ligature.render.camera import view_of

Array = NDArray[np.float64]

NEAREST = 0.01
"""Least depth in metres from a camera of positions dragged in its picture."""

ASIDE, BEFORE = 0.25, 0.6
"""Where tips are brought into view: heights of the picture beside its middle, and share of the depth of the work."""

NEAR = 0.15
"""Picture heights from a tip within which a drag takes its arm; farther away it takes the selected one."""


@dataclass(frozen=True, eq=False)
class Sightline:
    """How somebody looks: columns of ``R`` (3, 3) are right, up and into the picture, in world axes.

    ``eye`` (3,) is where a camera stands, ``spread`` how many metres the picture is high at a metre from there; 0 with
    ``height`` metres everywhere for parallel rays.
    """

    R: Array
    eye: Array
    spread: float = 0.0
    height: float = 0.0

    @classmethod
    def of(cls, camera: Camera, pose: Array) -> Sightline:
        """That of ``camera`` at ``pose`` (7,)."""
        T = pose7_matrix(pose)
        R = np.column_stack([T[:3, 1], T[:3, 2], -T[:3, 0]])
        if camera.orthographic_width is not None:
            width, height = camera.resolution
            return cls(R, T[:3, 3], 0.0, camera.orthographic_width * height / width)
        view = view_of(camera, pose)
        return cls(R, T[:3, 3], view.height / float(view.intrinsics[1, 1]))

    @classmethod
    def browser(cls, wxyz: Array) -> Sightline:
        """That of a page's 3D view, whose axes are right, down and into the picture."""
        w, x, y, z = np.asarray(wxyz, dtype=float).tolist()
        R = pose7_matrix(np.array([0.0, 0.0, 0.0, x, y, z, w]))[:3, :3]
        return cls(np.column_stack([R[:, 0], -R[:, 1], R[:, 2]]), np.zeros(3))

    def depth(self, point: Array) -> float:
        """Metres from the camera to ``point`` (3,) along the optical axis."""
        return float((point - self.eye) @ self.R[:, 2])

    def metres(self, point: Array) -> float:
        """Height of the picture in metres where ``point`` (3,) is, or where it begins for what lies before that."""
        return self.height + self.spread * max(self.depth(point), NEAREST)

    def place(self, point: Array) -> Array:
        """Where ``point`` (3,) is seen: (2,) heights of the picture right and up from its middle; NaN behind it."""
        if self.depth(point) < NEAREST:
            return np.full(2, np.nan)
        return (point - self.eye) @ self.R[:, :2] / self.metres(point)

    def point(self, right: float, up: float, depth: float) -> Array:
        """What (3,) is seen ``right`` and ``up`` of the middle, in heights, ``depth`` metres from the camera."""
        height = self.height + self.spread * depth
        return self.eye + self.R @ np.array([right * height, up * height, depth])


class Hands:
    """What keys, pads and drags want of the ``arms``; goals go to ``pursuits``."""

    def __init__(self, arms: Sequence[ArmFacts], pursuits: Sequence[ArmPursuits]) -> None:
        self._arms, self._pursuits = arms, pursuits
        kinds = [arm.description.kind for arm in arms]
        self._choices = [i for i, kind in enumerate(kinds) if kind is ArmKind.PSM] or list(range(len(kinds)))
        self.selected = self._choices[0] if self._choices else -1
        self.mode = "normal"
        self._motion = np.zeros(7)
        self._heard = 0.0
        self._rhythm = Rhythm()
        self._lost = False
        """Whether what is held was given up, until everything is let go."""
        self._grabbed: tuple[int, Array, Array, Sightline] | None = None
        """The arm that is dragged, its tip, the pointer, and how the picture looked when it was taken."""
        self._gripping = False

    def next(self) -> None:
        """Select the next arm."""
        self.rest()
        if self._choices:
            at = self._choices.index(self.selected) if self.selected in self._choices else -1
            self.selected = self._choices[(at + 1) % len(self._choices)]

    @property
    def moving(self) -> bool:
        """Whether a key or stick is held."""
        return bool(self._motion.any())

    @property
    def busy(self) -> bool:
        """Whether something is held, or has yet to come to rest."""
        return self.moving or self._gripping or (self.selected >= 0 and self._pursuits[self.selected].twists)

    @property
    def dragging(self) -> int | None:
        """The arm whose tip is dragged in the picture."""
        return None if self._grabbed is None else self._grabbed[0]

    def move(self, motion: Sequence[float], now: float) -> None:
        """Keys and sticks are held so: shares (7,) right, up, in, turns about these, and the jaw's opening."""
        if self.moving:
            self._rhythm.note(now - self._heard)
        self._lost = self._lost and any(motion)
        self._motion, self._heard = np.zeros(7) if self._lost else np.array(motion), now

    def rest(self) -> None:
        """Nothing is held any more."""
        self._motion, self._grabbed = np.zeros(7), None

    def bring(self, state: Any, work: Array, sight: Sightline, but: int = -1) -> None:
        """Bring tips that are not in the picture into it, side by side before ``work`` (3,), all ``but`` one."""
        depth = BEFORE * sight.depth(work)
        tips = {i: self._arms[i].tip_in_world(state) for i in self._choices if self._arms[i].ready(state)}
        if depth < NEAREST:
            return
        beside = sorted(tips, key=lambda i: float(tips[i][:3, 3] @ sight.R[:, 0]))
        for place, arm in zip(
            np.linspace(-ASIDE, ASIDE, len(beside)) if len(beside) > 1 else (0.0,), beside, strict=False
        ):
            if arm == but or np.abs(sight.place(tips[arm][:3, 3])).max() < 0.5:  # it is seen already
                continue
            target = tips[arm].copy()
            target[:3, 3] = sight.point(float(place), 0.0, depth)
            facts = self._arms[arm]
            self._pursuits[arm].pose(facts.in_reference(state, tips[arm]), facts.in_reference(state, target), True)

    def drag(self, state: Any, drag: Drag, sight: Sightline) -> int | None:
        """Take the tip along; returns the arm whose tip is taken, None for none."""
        if drag.phase == "start":
            self._grab(state, np.array([drag.right, drag.up]), sight)
        if self._grabbed is None:
            return None
        arm, T, begin, sight = self._grabbed
        target = T.copy()
        way = (np.array([drag.right, drag.up]) - begin) * sight.metres(T[:3, 3])
        target[:3, 3] += sight.R[:, :2] @ way
        facts = self._arms[arm]
        start = facts.in_reference(state, facts.tip_in_world(state))
        self._pursuits[arm].pose(start, facts.in_reference(state, target))
        if drag.phase == "end":
            self._grabbed = None
        return arm

    def _grab(self, state: Any, at: Array, sight: Sightline) -> None:
        self._motion = np.zeros(7)
        tips = {i: self._arms[i].tip_in_world(state) for i in self._choices if self._arms[i].ready(state)}
        if not tips:
            return
        away = {
            i: float(np.nan_to_num(np.linalg.norm(sight.place(T[:3, 3]) - at), nan=np.inf)) for i, T in tips.items()
        }
        nearest = min(away, key=lambda i: away[i])
        if away[nearest] < NEAR or self.selected not in tips:
            self.selected = nearest
        self._grabbed = (self.selected, tips[self.selected], at, sight)

    def advance(self, state: Any, sight: Sightline, now: float, dt: float) -> None:
        """Pursue what is held, slower while the browser that holds it is silent."""
        if self.selected < 0:
            return
        facts, pursuits = self._arms[self.selected], self._pursuits[self.selected]
        silence = now - self._heard if self.moving else 0.0
        pace = self._rhythm.pace(silence, dt)
        if silence > GONE:
            self._motion, self._lost = np.zeros(7), True
        if not facts.ready(state):
            return
        share = pace * MODES[self.mode] * self._motion
        if share[:6].any() or pursuits.twists:
            R = self._reference(facts, state) @ sight.R
            twist = np.concatenate([R @ (LINEAR * share[:3]), R @ (ANGULAR * share[3:6])])
            pursuits.twist(facts.in_reference(state, facts.tip_in_world(state)), twist)
        self._grip(facts, pursuits, state, float(self._motion[6]) * pace)

    def _grip(self, facts: ArmFacts, pursuits: ArmPursuits, state: Any, way: float) -> None:
        if facts.grip is None:
            return
        if way:
            now = float(state["arm"][facts.index]["jaw_setpoint_js"][0])
            pursuits.jaw(now, facts.grip.high if way > 0.0 else facts.grip.low, facts.grip_verb)
            self._gripping = True
        elif self._gripping:
            pursuits.rest_jaw()
            self._gripping = False

    @staticmethod
    def _reference(facts: ArmFacts, state: Any) -> Array:
        """From world axes to those of the frame that ``servo_cp`` takes (3, 3)."""
        return facts.in_reference(state, np.eye(4))[:3, :3]
