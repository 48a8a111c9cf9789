"""Moves arms for the operator, by hand or by a plan, and holds them when the operator's browser is silent.

Goals move in simulated time. Metres, radians, seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from viser import ClientHandle

from ligature.bus.codec import Message
from ligature.cockpit.arm_panel import ArmControls, ArmStatus
from ligature.cockpit.assist import Assist
from ligature.cockpit.deadman import AWAKE, GONE, LEFT, DeadMan
from ligature.cockpit.hands import Hands, Sightline
from ligature.cockpit.pursuit import ArmPursuits
from ligature.cockpit.stage import work_place
from ligature.cockpit.starter import Starter
from ligature.cockpit.views import Views
from ligature.model.scene import Scene
from ligature.robots.commands import Hold, StateCommand

AGAIN = "Press again to continue from here."
BY_HAND = f"Your hand took over. {AGAIN}"
"""Why the assistance has stopped, and how to continue."""


class Motion:
    """All motion that the operator starts, of the ``arms`` on the page.

    Parameters
    ----------
    scene
        The scene of the run.
    state
        The record that the page reads into, (1,).
    arms
        What everybody sees of each arm.
    deadman
        Watches the operator's browser.
    push
        Takes commands.
    warn
        Takes lines for the terminal.
    """

    def __init__(
        self,
        scene: Scene,
        state: Any,
        arms: Sequence[ArmStatus],
        deadman: DeadMan,
        push: Callable[[Message], None],
        warn: Callable[[str], None],
    ) -> None:
        self._scene, self._record, self._arms = scene, state, arms
        self._deadman, self._push, self._warn = deadman, push, warn
        facts = [arm.facts for arm in arms]
        self.pursuits = [ArmPursuits(index) for index in range(len(arms))]
        self.hands = Hands(facts, self.pursuits)
        self.assist = Assist(scene, facts, self.pursuits)
        self.starter = Starter(facts, push)
        self.controls: list[ArmControls] = []
        """The operator's controls of each arm; empty while nobody operates."""
        self._resets, self._followed = 0, float(state["sim_time"][0])

    @property
    def _state(self) -> Any:
        return self._record[0]

    # --- what the operator does ----------------------------------------------------------------

    def obey_hand(self, word: str, value: Any, now: float, sight: Sightline | None) -> None:
        """Do what keys, pads, drags and the steps of a throw ask for; ``sight`` is that of the camera's picture."""
        state, hands = self._state, self.hands
        if word in ("next", "drag") or (word == "move" and any(value)):
            self.assist.stop(BY_HAND)
        if word == "move":
            self._forget_note(hands.selected)
            hands.move(value, now)
        elif word == "silent":
            hands.rest()
        elif word == "hold":
            self._hold()
        elif word == "next":
            hands.next()
        elif word == "speed":
            hands.mode = value
        elif word == "assist":
            self._forget_note(hands.selected)
            hands.rest()
            self.assist.begin(value, hands.selected, state)
        elif word == "drive":
            self.assist.drive(value, hands.selected, state)
        elif word == "drag":
            arm = None if sight is None else hands.drag(state, value, sight)
            if arm is not None:
                self._forget_note(arm)

    def obey_control(self, word: str, arm: int, value: Any) -> None:
        """Do what the buttons, sliders and the gizmo of an arm ask for."""
        state, facts, pursuits = self._state, self._arms[arm].facts, self.pursuits[arm]
        if word == "gizmo":
            self.controls[arm].show_gizmo(value)
            return
        self._forget_note(arm)
        self.assist.stop(BY_HAND)
        if word == "command":
            pursuits.stop()
            self._push(Hold(arm) if value == "Hold" else StateCommand(arm, value.lower()))
        elif word == "joint":
            joint, target = value
            pursuits.joint(facts.setpoints(state), joint, target, facts.speed)
        elif word == "grip":
            pursuits.jaw(float(state["arm"][arm]["jaw_setpoint_js"][0]), value, facts.grip_verb)
        elif word == "drag":
            self.controls[arm].lost_gizmo()
            start = facts.in_reference(state, facts.tip_in_world(state))
            pursuits.pose(start, facts.in_reference(state, value))

    def _forget_note(self, arm: int) -> None:
        if 0 <= arm < len(self._arms):
            self._arms[arm].note = ""

    # --- the loop ------------------------------------------------------------------------------

    def follow(self, client: ClientHandle | None, views: Views, now: float, dt: float) -> None:
        """Send the next goals of motions in progress, slowed or stopped while the operator's browser is silent."""
        state = self._state
        # goals move in simulated time: an arm keeps a hand's speed in a simulation that is slow, held up, or paused
        step = float(np.clip(state["sim_time"] - self._followed, 0.0, AWAKE))
        self._followed = float(state["sim_time"])
        if client is not None:
            self._advance(client, views, now, dt)
        driven = [i for i, pursuits in enumerate(self.pursuits) if pursuits.active]
        following = bool(driven or self.assist.busy or self._dragged)
        self._deadman.watch(None if client is None else client.client_id, following, dt)
        by_hand, by_plan = self._deadman.paces(dt)
        self._stop_when_silent(self._deadman.silence)
        for arm in driven:
            pace = by_plan if self.pursuits[arm].planned else by_hand
            if pace * step > 0.0:
                for command in self.pursuits[arm].advance(pace * step):
                    self._push(command)

    def _advance(self, client: ClientHandle, views: Views, now: float, dt: float) -> None:
        """Advance what the operator has started: powering up, the steps of a throw, the hands."""
        state = self._state
        if self.starter.advance(state) and views.camera is not None:
            self.hands.bring(state, work_place(self._scene, self._record), views.camera, self.assist.arm)
        if int(state["resets"]) != self._resets:
            self._resets = int(state["resets"])
            self.assist.forget()
        self.assist.advance(state)
        if self.assist.busy:
            self.hands.selected = self.assist.arm  # it takes the arm that reaches the needle
        if self.hands.busy:
            self.hands.advance(state, views.of(client), now, dt)

    def _stop_when_silent(self, silence: float) -> None:
        if silence > LEFT:
            self.stop_all(f"the operator's browser has not answered for {silence:.0f} s")
        elif silence > GONE:
            self._give_up(f"the operator's browser has not answered for {1e3 * silence:.0f} ms")

    @property
    def _dragged(self) -> set[int]:
        """The arms whose tips are dragged."""
        dragged = {arm for arm, controls in enumerate(self.controls) if controls.dragging}
        return dragged if self.hands.dragging is None else dragged | {self.hands.dragging}

    # --- how motion ends -----------------------------------------------------------------------

    def stop_all(self, why: str) -> None:
        """Hold every arm that the operator drives, by hand or by a plan, and show why."""
        for pursuits in self.pursuits:
            pursuits.planned = False
        self._give_up(why)
        self.assist.stop(f"It stopped: {why}. {AGAIN}" if why else "")

    def stop_rejected(self, arm: int, why: str) -> None:
        """End the motion of an arm that has rejected a goal."""
        self.pursuits[arm].stop()
        if arm == self.assist.arm:
            self.assist.stop(f"It stopped: {why}. {AGAIN}")

    def end(self) -> None:
        """Nobody operates any more: forget the controls, and what they asked for."""
        self.controls = []
        self.starter.end()
        self.hands.rest()

    def _hold(self) -> None:
        """Hold all arms where they are."""
        self.hands.rest()
        for arm, pursuits in enumerate(self.pursuits):
            if pursuits.stop():
                self._push(Hold(arm))
        self.assist.stop(f"Every arm holds. {AGAIN}")

    def _give_up(self, why: str) -> None:
        """Hold all arms that are driven by hand, and show why."""
        dragged = self._dragged
        for arm, (status, pursuits) in enumerate(zip(self._arms, self.pursuits, strict=True)):
            steered = pursuits.active and not pursuits.planned
            if steered or arm in dragged:
                pursuits.stop()
                self._push(Hold(arm))
                if why and status.note != f"hold: {why}":
                    status.note = f"hold: {why}"
                    self._warn(f"{status.facts.name} holds: {why}")
        self.hands.rest()
