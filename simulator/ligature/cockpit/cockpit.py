"""The cockpit's loop: states to browsers, and what the operator does to the bus.

Browsers speak on the network's thread; whatever they send waits in one queue for the loop, so that all decisions are
made on one thread. Seconds.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from html import escape
from typing import Any

import numpy as np
from viser import ClientHandle

from ligature.bus import Block, Outbox
from ligature.bus.events import PHASE, RUN
from ligature.cockpit.address import Address
from ligature.cockpit.arm_facts import ArmFacts
from ligature.cockpit.arm_panel import ArmControls, ArmStatus
from ligature.cockpit.audience import Audience
from ligature.cockpit.camera_panel import MOST_CUT, CameraControls
from ligature.cockpit.curves import Curves
from ligature.cockpit.deadman import DeadMan
from ligature.cockpit.gate import Gate
from ligature.cockpit.hands import NEAREST
from ligature.cockpit.motion import Motion
from ligature.cockpit.orders import Order
from ligature.cockpit.page import (
    CAMERA_HEIGHT,
    LEFT_WIDTH,
    PICTURE,
    Header,
    behind,
    look_from,
    look_now,
    paint,
    serve,
)  # fmt: skip
from ligature.cockpit.pictures import Pictures
from ligature.cockpit.ros_panel import Health, Remote, RosPanel, TeleopControls, obey_teleop
from ligature.cockpit.simulation_panel import Clockwork, SimulationControls, SimulationPanel
from ligature.cockpit.stage import Stage, first_view
from ligature.cockpit.views import Views
from ligature.cockpit.wire import Wire
from ligature.model.scene import ArmKind, Scene
from ligature.model.state import new_state

PERIOD = 0.01
STAGE_PERIOD, WORDS_PERIOD, CURVES_PERIOD, PICTURE_PERIOD = 0.05, 0.2, 0.4, 0.02
"""Seconds between turns of the loop, poses, words and controls, curves, and looks for a new picture."""

AFTER_FAILURE = 1.0
"""Seconds after which a part of the page that failed is tried again."""

CLAIM_TIMEOUT = 30.0
"""Seconds after *Start* was pressed in which a browser gets control; later it has to be pressed again."""

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
        self._wire = Wire()
        self.server = serve(address, Gate(address, token, warn), self._wire)
        self._inbox: deque[tuple[str, int, Any]] = deque()
        self._clockwork = Clockwork(self._outbox.push)
        self._speed = "1"
        self._record_as, self._recorded, self._reported = "", "", ""
        self._phase = ""
        facts = [ArmFacts.of(scene, index) for index in range(len(scene.arms))]
        self._views = Views(scene, self._state)
        self._begins = (-1, 0.0)
        self._curves = Curves(scene, task)
        self._lay_out(facts, ros, title)
        deadman = DeadMan(self.server, self._wire)
        self._motion = Motion(scene, self._state, self._arms, deadman, self._outbox.push, warn)
        self._run_controls: SimulationControls | None = None
        self._camera_controls: CameraControls | None = None
        self._teleop_controls: TeleopControls | None = None
        shows = (self._show_stage, self._show_words, self._show_curves, self._show_picture)
        self._due: dict[Callable[[float], float], float] = dict.fromkeys(shows, 0.0)
        self._last = time.monotonic()
        self._moved_at, self._tick = self._last, -1
        self._audience = Audience(
            self.server, self._wire, lambda *what: self._inbox.append(what), self._begin_operating, self._end_operating
        )
        self._wire.begin(lambda *what: self._inbox.append(what), self.server.get_event_loop())

    def _lay_out(self, facts: list[ArmFacts], ros: tuple[Health, Remote] | None, title: str) -> None:
        server, scene = self.server, self._scene
        look_from(server, *first_view(scene, self._state))
        self._header = Header(server, title)
        self._panel = SimulationPanel(server)
        first = next((f.index for f in facts if f.description.kind is ArmKind.PSM), 0)
        self._arms = [ArmStatus(server, f, f.index == first) for f in facts]
        self._ros = None if ros is None else RosPanel(server, *ros)
        panels = []
        if self._views.sights:
            panels.append(server.gui.add_panel())
            with panels[-1].add_tab("Cameras"):
                self._camera_folder = server.gui.add_folder("View")
                server.gui.add_html(PICTURE)
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
        self._tube = False  # the first view is from behind it
        self._stage.show_endoscope(self._tube)

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
                if word == "wire":
                    self._handle_order(client, value)
                elif not self._audience.hear(word, client, value, now):
                    self._obey(word, value)
            except Exception as error:  # nothing that one browser does ends the page for the others
                self._report(f"'{word}' of a browser failed", error)
        self._motion.follow(self._operating, self._views, now, now - self._last)
        self._last = now
        self._curves.observe(self._state[0], float(self._block.figures["real_time_factor"][0]))
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

        self._motion.controls = [
            ArmControls(client, status, state, lambda word, arm, value: act(word, (arm, value)))
            for status in self._arms
        ]
        self._run_controls = SimulationControls(
            client,
            self._panel,
            self._clockwork.paused,
            self._speed,
            self._recording,
            self._record_as,
            self._phase,
            act,
        )
        if self._views.sights:
            names, chosen = tuple(self._views.sights), self._views.chosen
            self._camera_controls = CameraControls(client, self._camera_folder, names, chosen, self._tube, act)
        if self._ros is not None:
            self._teleop_controls = TeleopControls(client, self._ros, act)
        if self._begins[0] == own and time.monotonic() - self._begins[1] < CLAIM_TIMEOUT:
            self._motion.starter.begin()
        self._begins = (-1, 0.0)

    def _end_operating(self, why: str, there: bool) -> None:
        """The operator is gone; ``there``: whether the browser still shows the controls."""
        self._motion.stop_all(why)
        if there:
            for controls in (*self._motion.controls, self._run_controls, self._camera_controls, self._teleop_controls):
                if controls is not None:
                    controls.remove()
        self._run_controls, self._camera_controls, self._teleop_controls = None, None, None
        self._motion.end()

    # --- the page's own script -------------------------------------------------------------------

    def _handle_order(self, client: int, order: Order) -> None:
        """Handle the orders of a browser's script: a few are open to all, the others to the operator alone."""
        handle = self._audience.clients.get(client)
        if handle is None:
            return
        word, value = order
        if word == "view":
            self._views.report(client, value)
        elif word == "dark":
            paint(handle.gui, value)
        elif word == "csv":
            name = time.strftime("ligature-curves-%Y-%m-%d-%H%M%S.csv")
            handle.send_file_download(name, self._curves.table().encode(), save_immediately=True)
        elif word == "start":
            self._start(handle)
        elif client == self._audience.desk.operator:
            self._motion.obey_hand(word, value, time.monotonic(), self._views.camera)

    def _start(self, client: ClientHandle) -> None:
        look_now(client, *first_view(self._scene, self._state))
        if self._audience.desk.operator == client.client_id:
            self._motion.starter.begin()
        else:
            self._begins = client.client_id, time.monotonic()
            self._audience.claim(client.client_id)

    def _inform(self) -> None:
        """Send each script the values that it shows."""
        desk = self._audience.desk
        ready = [arm.facts.ready(self._state[0]) for arm in self._arms]
        hands, assist = self._motion.hands, self._motion.assist
        chosen = self._arms[hands.selected].facts.name if hands.selected >= 0 else ""
        wish = self._views.wish(self._audience.clients)
        aim = None if chosen == "" else self._views.aim(assist.aim(hands.selected, self._state[0]))
        help_ = assist.facts(hands.selected, self._state[0])
        for client in self._audience.clients:
            self._wire.inform(
                client,
                {
                    "operates": client == desk.operator,
                    "free": desk.operator is None and not desk.kept(time.monotonic()),
                    "starting": self._motion.starter.active,
                    "ready": hands.selected >= 0 and ready[hands.selected],
                    "arm": chosen,
                    "speed": hands.mode,
                    "eyes": 0 if wish is None else len(wish.sight.eyes),
                    "pair": wish is not None and self._views.is_stereo,
                    "assist": help_,
                    "aim": aim,
                },
            )

    # --- what the operator does ----------------------------------------------------------------

    def _obey(self, word: str, value: Any) -> None:
        if word in ("command", "gizmo", "joint", "grip", "drag"):
            self._motion.obey_control(word, *value)
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
            self._motion.stop_all("")
            self._clockwork.reset()
        elif word == "record as":
            self._record_as = str(value)
        elif word == "record":
            self._record(bool(value))
        elif word == "phase":
            self._mark(str(value))
        elif word == "sight":
            self._views.chosen = value
        elif word == "cut":
            self._cut(value)
        elif word == "tube":
            self._tube = bool(value)
            self._stage.show_endoscope(self._tube)
        elif self._ros is not None:
            obey_teleop(self._ros.remote, word, value)

    def _cut(self, distance: float) -> None:
        """Clip the operator's 3D view at ``distance`` metres."""
        client = self._operating
        if client is not None:
            client.camera.near = float(np.clip(distance, NEAREST, 1e-3 * MOST_CUT))

    @property
    def _operating(self) -> ClientHandle | None:
        """The operator's browser."""
        operator = self._audience.desk.operator
        return None if operator is None else self._audience.clients.get(operator)

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

    def _mark(self, phase: str) -> None:
        try:
            self._clockwork.mark(phase)
        except ValueError as error:
            self._recorded = f"cannot mark the phase: {error}"

    # --- what is shown -------------------------------------------------------------------------

    def _show_stage(self, now: float) -> float:
        if self._audience.clients:
            self._stage.update(self._state)
            operated = self._audience.desk.operator is not None
            motion, state = self._motion, self._state[0]
            self._stage.show_aim(motion.assist.aim(motion.hands.selected, state) if operated else None)
            for controls, pursuits in zip(motion.controls, motion.pursuits, strict=False):
                if not pursuits.active:
                    controls.place_gizmo(state)
        return STAGE_PERIOD

    def _show_words(self, now: float) -> float:
        state = self._state[0]
        for event in self._block.events.read():
            if event.arm == RUN and event.name == PHASE:
                self._phase = str(event.value)
            elif event.arm == RUN:
                self._recorded = str(event.value)
            elif event.name in REPORTED:
                self._arms[event.arm].note = str(event.value)
                if "servo" in str(event.value):
                    self._motion.stop_rejected(event.arm, str(event.value))
        if self._tick != int(state["tick"]):
            self._tick, self._moved_at = int(state["tick"]), now
        if self._audience.clients:
            self._show_header(now)
            self._panel.refresh(self._run_words())
            for arm in self._arms:
                arm.refresh(state)
            for controls, pursuits in zip(self._motion.controls, self._motion.pursuits, strict=False):
                controls.refresh(state, not pursuits.active)
            if self._run_controls is not None:
                self._run_controls.show_recording(self._recording)
            self._inform()
            self._show_ros()
        self._pictures.want(self._views.wish(self._audience.clients))
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
        lines = [f"update {p50:.2f} ms, p99 {p99:.2f} ms · {behind(float(figures['behind'][0]))}"]
        lines.append(f"commands {int(figures['received'][0])}, rejected {int(figures['rejected'][0])}")
        if self._phase:
            lines.append(f"phase: {self._phase}")
        if self._recorded or self._recording:
            lines.append(self._recorded or "recording")
        return lines

    def _show_picture(self, now: float) -> float:
        if self._views.sights:
            picture = self._pictures.newest()
            if picture is not None:
                self._wire.show(picture)
            words = f"<small>no pictures: {escape(self._pictures.problem)}</small>" if self._pictures.problem else ""
            if self._camera_words.content != words:
                self._camera_words.content = words
        return PICTURE_PERIOD

    def _show_curves(self, now: float) -> float:
        if self._audience.clients:
            self._curves.refresh(self._state[0])
        return CURVES_PERIOD
