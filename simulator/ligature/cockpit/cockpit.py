"""The cockpit's loop: snapshots to browsers, what the operator does to the bus, and the hand that must not slip.

Browsers speak on the network's thread; whatever they send waits in one queue for the loop, so that all decisions are
made on one thread. Metres, radians, seconds.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
from viser import ClientHandle

from ligature.bus import Block, Outbox
from ligature.bus.events import RUN
from ligature.cockpit.address import Address
from ligature.cockpit.arm_facts import ArmFacts
from ligature.cockpit.arm_panel import ArmControls, ArmStatus
from ligature.cockpit.audience import Audience
from ligature.cockpit.camera_panel import NO_PICTURES, CameraControls
from ligature.cockpit.curves import Curves
from ligature.cockpit.deadman import TIMEOUT, DeadMan
from ligature.cockpit.gate import Gate
from ligature.cockpit.page import CAMERA_HEIGHT, LEFT_WIDTH, Header, look_from, serve
from ligature.cockpit.pictures import Pictures, sights
from ligature.cockpit.pursuit import ArmPursuits
from ligature.cockpit.ros_panel import Health, Remote, RosPanel, TeleopControls, obey_teleop
from ligature.cockpit.simulation_panel import Clockwork, SimulationControls, SimulationPanel
from ligature.cockpit.stage import Stage, first_view
from ligature.model.scene import ArmKind, Scene
from ligature.model.state import new_state
from ligature.robots.commands import Hold, StateCommand

PERIOD = 0.01
STAGE_PERIOD, WORDS_PERIOD, CURVES_PERIOD = 0.05, 0.2, 0.4
"""Seconds between turns of the loop, poses, words and controls, and curves."""

AFTER_FAILURE = 1.0
"""Seconds after which a part of the page that failed is tried again."""

REPORTED = ("warning", "error")
"""Events of an arm that are shown beside it."""


class Cockpit:
    """The page of one running simulation; `turn` does everything that is due."""

    def __init__(
        self,
        scene: Scene,
        block: Block,
        pictures: Pictures,
        address: Address,
        token: str,
        warn: Callable[[str], None],
        ros: tuple[Health, Remote] | None = None,
        title: str = "",
        task: str = "",
    ) -> None:
        self._scene, self._block, self._pictures, self._warn = scene, block, pictures, warn
        self._ring, self._outbox = block.rings["cockpit"], Outbox(block.rings["cockpit"])
        self._state = new_state(scene)
        block.read(self._state)
        block.events.skip()
        self._address = address
        self.server = serve(address, Gate(address, token, warn))
        self._deadman = DeadMan(self.server)
        self._inbox: deque[tuple[str, int, Any]] = deque()
        self._clockwork = Clockwork(self._outbox.push)
        self._speed = "1"
        self._record_as, self._recorded, self._reported = "", "", ""
        facts = [ArmFacts.of(scene, index) for index in range(len(scene.arms))]
        self._pursuits = [ArmPursuits(index) for index in range(len(facts))]
        self._curves = Curves(scene, task)
        self._lay_out(facts, ros, title)
        self._controls: list[ArmControls] = []
        self._run_controls: SimulationControls | None = None
        self._camera_controls: CameraControls | None = None
        self._teleop_controls: TeleopControls | None = None
        self._due = {self._show_stage: 0.0, self._show_words: 0.0, self._show_curves: 0.0}
        self._last = time.monotonic()
        self._moved_at, self._tick = self._last, -1
        self._audience = Audience(
            self.server, lambda *what: self._inbox.append(what), self._begin_operating, self._end_operating
        )

    def _lay_out(self, facts: list[ArmFacts], ros: tuple[Health, Remote] | None, title: str) -> None:
        server, scene = self.server, self._scene
        look_from(server, *first_view(scene, self._state))
        self._header = Header(server, title)
        self._panel = SimulationPanel(server)
        first = next((f.index for f in facts if f.description.kind is ArmKind.PSM), 0)
        self._arms = [ArmStatus(server, f, f.index == first) for f in facts]
        self._ros = None if ros is None else RosPanel(server, *ros)
        panels = []
        self._sights = {sight.name: sight for sight in sights(scene)}
        self._sight = next(iter(self._sights), NO_PICTURES)
        if self._sights:
            panels.append(server.gui.add_panel())
            with panels[-1].add_tab("Cameras"):
                self._camera_folder = server.gui.add_folder("View")
                self._picture = server.gui.add_image(np.zeros((2, 2, 3), np.uint8), format="jpeg", jpeg_quality=80)
                self._camera_words = server.gui.add_html("")
        panels.append(server.gui.add_panel())
        with panels[-1].add_tab("Curves"):
            self._curves.show(server.gui)
        panels[0].dock_left()
        panels[0].set_width(LEFT_WIDTH)
        if len(panels) > 1:
            panels[1].dock_below(panels[0])
            panels[0].set_height(CAMERA_HEIGHT)
        self._stage = Stage(server, scene)

    @property
    def url(self) -> str:
        """What to open in a browser."""
        return Address(self._address.host, self.server.get_port()).url

    # --- the loop ------------------------------------------------------------------------------

    def turn(self) -> None:
        """Hear browsers, move what they move, show what is due, and sleep until the next turn."""
        now = time.monotonic()
        self._ring.beat()
        self._block.read(self._state)
        while self._inbox:
            word, client, value = self._inbox.popleft()
            try:
                if not self._audience.hear(word, client, value, now):
                    self._obey(word, value)
            except Exception as error:  # nothing that one browser does ends the page for the others
                self._report(f"'{word}' of a browser failed", error)
        self._follow(now, now - self._last)
        self._last = now
        self._curves.observe(self._state[0])
        for show, due in self._due.items():
            if now >= due:
                try:
                    self._due[show] = now + show(now)
                except Exception as error:
                    self._due[show] = now + AFTER_FAILURE
                    self._report(f"'{show.__name__}' of the page failed", error)
        self._outbox.flush()
        time.sleep(max(PERIOD - (time.monotonic() - now), 0.0))

    def _report(self, what: str, error: Exception) -> None:
        words = f"{what}: {type(error).__name__}: {error}"
        if words != self._reported:
            self._reported = words
            self._warn(words)

    def close(self) -> None:
        """End the page."""
        self._pictures.close()
        self.server.stop()

    # --- who operates --------------------------------------------------------------------------

    def _begin_operating(self, client: ClientHandle) -> None:
        state, own = self._state[0], client.client_id

        def act(word: str, value: Any) -> None:
            self._inbox.append((word, own, value))

        self._controls = [
            ArmControls(client, status, state, lambda word, arm, value: act(word, (arm, value)))
            for status in self._arms
        ]
        self._run_controls = SimulationControls(
            client, self._panel, self._clockwork.paused, self._speed, self._recording, self._record_as, act
        )
        if self._sights:
            self._camera_controls = CameraControls(client, self._camera_folder, tuple(self._sights), self._sight, act)
        if self._ros is not None:
            self._teleop_controls = TeleopControls(client, self._ros, act)

    def _end_operating(self, why: str, there: bool) -> None:
        """Nobody operates any more; ``there``: whether the browser still shows the controls."""
        self._stop_all(why)
        if there:
            for controls in (*self._controls, self._run_controls, self._camera_controls, self._teleop_controls):
                if controls is not None:
                    controls.remove()
        self._controls, self._run_controls, self._camera_controls, self._teleop_controls = [], None, None, None

    # --- what the operator does ----------------------------------------------------------------

    def _obey(self, word: str, value: Any) -> None:
        if word in ("command", "gizmo", "joint", "grip", "drag"):
            self._obey_arm(word, *value)
        elif word == "pause":
            self._clockwork.pause(bool(value))
        elif word == "step":
            self._clockwork.step(int(str(value).rpartition(" ")[2]))
            if self._run_controls is not None:
                self._run_controls.show_paused(True)
        elif word == "speed":
            self._speed = value
            self._clockwork.pace(float(value))
        elif word == "reset":
            self._stop_all("")
            self._clockwork.reset()
        elif word == "record as":
            self._record_as = str(value)
        elif word == "record":
            self._record(bool(value))
        elif word == "sight":
            self._sight = value
        elif self._ros is not None:
            obey_teleop(self._ros.remote, word, value)

    def _obey_arm(self, word: str, arm: int, value: Any) -> None:
        state, facts, pursuits = self._state[0], self._arms[arm].facts, self._pursuits[arm]
        if word == "gizmo":
            self._controls[arm].show_gizmo(value)
            return
        self._arms[arm].note = ""
        if word == "command":
            pursuits.stop()
            if value == "Hold":
                self._outbox.push(Hold(arm))
            else:
                self._outbox.push(StateCommand(arm, value.lower()))
        elif word == "joint":
            joint, target = value
            pursuits.joint(facts.setpoints(state), joint, target, facts.speed)
        elif word == "grip":
            pursuits.jaw(float(state["arm"][arm]["jaw_setpoint_js"][0]), value, facts.grip_verb)
        elif word == "drag":
            self._controls[arm].lost_gizmo()
            start = facts.in_reference(state, facts.tip_in_world(state))
            pursuits.pose(start, facts.in_reference(state, value))

    def _follow(self, now: float, dt: float) -> None:
        """Send the next goals of what is pursued, as long as the operator's browser answers."""
        driven = [i for i, pursuits in enumerate(self._pursuits) if pursuits.active]
        dragged = any(controls.dragging for controls in self._controls)
        self._deadman.watch(self._audience.desk.operator if driven or dragged else None)
        if self._deadman.silence > TIMEOUT:
            silent = 1e3 * self._deadman.silence
            self._stop_all(f"the operator's browser has not answered for {silent:.0f} ms")
            return
        for arm in driven:
            for command in self._pursuits[arm].advance(min(dt, 0.05)):
                self._outbox.push(command)

    def _stop_all(self, why: str) -> None:
        """Hold every arm that the operator drives, and show why."""
        for arm, (status, pursuits) in enumerate(zip(self._arms, self._pursuits, strict=True)):
            dragged = arm < len(self._controls) and self._controls[arm].dragging
            if pursuits.stop() or dragged:
                self._outbox.push(Hold(arm))
                if why and status.note != f"hold: {why}":
                    status.note = f"hold: {why}"
                    self._warn(f"{status.facts.name} holds: {why}")
        self._deadman.watch(None)

    @property
    def _recording(self) -> bool:
        """Whether the simulation records."""
        return bool(self._block.figures["recording"][0])

    def _record(self, on: bool) -> None:
        try:
            if on:
                self._clockwork.record(self._record_as)
            else:
                self._clockwork.end_record()
        except ValueError as error:
            self._recorded = f"cannot record: {error}"

    # --- what is shown -------------------------------------------------------------------------

    def _show_stage(self, now: float) -> float:
        if self._audience.clients:
            self._stage.update(self._state)
            for arm, controls in enumerate(self._controls):
                if not self._pursuits[arm].active:
                    controls.place_gizmo(self._state[0])
        return STAGE_PERIOD

    def _show_words(self, now: float) -> float:
        state = self._state[0]
        for event in self._block.events.read():
            if event.arm == RUN:
                self._recorded = str(event.value)
            elif event.name in REPORTED:
                self._arms[event.arm].note = str(event.value)
                if "servo" in str(event.value):
                    self._pursuits[event.arm].stop()
        if self._tick != int(state["tick"]):
            self._tick, self._moved_at = int(state["tick"]), now
        if self._audience.clients:
            self._show_header(now)
            self._panel.refresh(self._run_words())
            for arm in self._arms:
                arm.refresh(state)
            for controls, pursuits in zip(self._controls, self._pursuits, strict=False):
                controls.refresh(state, not pursuits.active)
            if self._run_controls is not None:
                self._run_controls.show_recording(self._recording)
            self._show_picture()
            self._show_ros()
        self._pictures.want(self._sights.get(self._sight) if self._audience.clients else None)
        return WORDS_PERIOD

    def _show_ros(self) -> None:
        if self._ros is None:
            return
        self._ros.refresh()
        old = self._teleop_controls
        if old is not None and old.outdated(self._ros):
            old.remove()
            self._teleop_controls = TeleopControls(old.client, self._ros, old.act)

    def _show_header(self, now: float) -> None:
        factor = float(self._block.figures["real_time_factor"][0])
        running = "paused" if self._clockwork.paused else "running" if now - self._moved_at < 1.0 else "standing still"
        operated = self._audience.words(now)
        self._header.refresh(float(self._state["sim_time"][0]), factor, running, operated, len(self._audience.clients))

    def _run_words(self) -> list[str]:
        figures = self._block.figures
        p50, p99 = 1e3 * float(figures["tick_p50"][0]), 1e3 * float(figures["tick_p99"][0])
        lines = [f"update {p50:.2f} ms, p99 {p99:.2f} ms · {float(figures['behind'][0]):.1f} s behind"]
        lines.append(f"commands {int(figures['received'][0])}, rejected {int(figures['rejected'][0])}")
        if self._recorded or self._recording:
            lines.append(self._recorded or "recording")
        return lines

    def _show_picture(self) -> None:
        if not self._sights:
            return
        picture = self._pictures.newest()
        if picture is not None:
            self._picture.image = picture
        if self._pictures.problem:
            self._camera_words.content = "<small>no pictures</small>"

    def _show_curves(self, now: float) -> float:
        if self._audience.clients:
            self._curves.refresh(self._state[0])
        return CURVES_PERIOD
