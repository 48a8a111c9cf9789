"""The cockpit's loop: snapshots to browsers, what the operator does to the bus, and the hand that must not slip.

Browsers speak on the network's thread; whatever they send waits in one queue for the loop, so that all decisions are
made on one thread. Metres, radians, seconds.
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
from ligature.cockpit.assist import Assist
from ligature.cockpit.audience import Audience
from ligature.cockpit.camera_panel import MOST_CUT, NO_PICTURES, CameraControls
from ligature.cockpit.curves import Curves
from ligature.cockpit.deadman import AWAKE, GONE, LEFT, DeadMan
from ligature.cockpit.gate import Gate
from ligature.cockpit.hands import NEAREST, Hands, Sightline
from ligature.cockpit.orders import Order, View
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
from ligature.cockpit.pictures import HEIGHT, Pictures, Wish, sights
from ligature.cockpit.pursuit import ArmPursuits
from ligature.cockpit.ros_panel import Health, Remote, RosPanel, TeleopControls, obey_teleop
from ligature.cockpit.simulation_panel import Clockwork, SimulationControls, SimulationPanel
from ligature.cockpit.stage import Stage, first_view, work_place
from ligature.cockpit.starter import Starter
from ligature.cockpit.wire import Wire
from ligature.model.scene import ArmKind, Scene
from ligature.model.state import new_state
from ligature.robots.commands import Hold, StateCommand

PERIOD = 0.01
STAGE_PERIOD, WORDS_PERIOD, CURVES_PERIOD, PICTURE_PERIOD = 0.05, 0.2, 0.4, 0.02
"""Seconds between turns of the loop, poses, words and controls, curves, and looks for a new picture."""

SMALL_VIEW = View(False, HEIGHT)
"""View of a browser that has not reported one yet."""

AFTER_FAILURE = 1.0
"""Seconds after which a part of the page that failed is tried again."""

CLAIM_TIMEOUT = 30.0
"""Seconds after *Start* was pressed in which a browser gets control; later it has to be pressed again."""

AGAIN = "Press again to continue from here."
BY_HAND = f"Your hand took over. {AGAIN}"
"""Why the assistance has stopped, and how to continue."""

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
        self._deadman = DeadMan(self.server, self._wire)
        self._inbox: deque[tuple[str, int, Any]] = deque()
        self._clockwork = Clockwork(self._outbox.push)
        self._speed = "1"
        self._record_as, self._recorded, self._reported = "", "", ""
        self._phase = ""
        facts = [ArmFacts.of(scene, index) for index in range(len(scene.arms))]
        self._pursuits = [ArmPursuits(index) for index in range(len(facts))]
        self._hands = Hands(facts, self._pursuits)
        self._starter = Starter(facts, self._outbox.push)
        self._assist = Assist(scene, facts, self._pursuits)
        self._resets, self._followed = 0, float(self._state["sim_time"][0])
        self._views: dict[int, View] = {}
        self._begins = (-1, 0.0)
        self._curves = Curves(scene, task)
        self._lay_out(facts, ros, title)
        self._controls: list[ArmControls] = []
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
        self._sights = {sight.name: sight for sight in sights(scene)}
        self._sight = next(iter(self._sights), NO_PICTURES)
        if self._sights:
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
        self._follow(now, now - self._last)
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

        self._controls = [
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
        if self._sights:
            names = tuple(self._sights)
            self._camera_controls = CameraControls(client, self._camera_folder, names, self._sight, self._tube, act)
        if self._ros is not None:
            self._teleop_controls = TeleopControls(client, self._ros, act)
        if self._begins[0] == own and time.monotonic() - self._begins[1] < CLAIM_TIMEOUT:
            self._starter.begin()
        self._begins = (-1, 0.0)

    def _end_operating(self, why: str, there: bool) -> None:
        """The operator is gone; ``there``: whether the browser still shows the controls."""
        self._stop_all(why)
        if there:
            for controls in (*self._controls, self._run_controls, self._camera_controls, self._teleop_controls):
                if controls is not None:
                    controls.remove()
        self._controls, self._run_controls, self._camera_controls, self._teleop_controls = [], None, None, None

        self._starter.end()
        self._hands.rest()

    # --- the page's own script -------------------------------------------------------------------

    def _handle_order(self, client: int, order: Order) -> None:
        """Handle the orders of a browser's script: a few are open to all, the others to the operator alone."""
        handle = self._audience.clients.get(client)
        if handle is None:
            return
        word, value = order
        if word == "view":
            self._views[client] = value
        elif word == "dark":
            paint(handle.gui, value)
        elif word == "csv":
            name = time.strftime("ligature-curves-%Y-%m-%d-%H%M%S.csv")
            handle.send_file_download(name, self._curves.table().encode(), save_immediately=True)
        elif word == "start":
            self._start(handle)
        elif client == self._audience.desk.operator:
            self._handle_hand_order(word, value, handle)

    def _start(self, client: ClientHandle) -> None:
        look_now(client, *first_view(self._scene, self._state))
        if self._audience.desk.operator == client.client_id:
            self._starter.begin()
        else:
            self._begins = client.client_id, time.monotonic()
            self._audience.claim(client.client_id)

    def _handle_hand_order(self, word: str, value: Any, client: ClientHandle) -> None:
        state, hands = self._state[0], self._hands
        if word in ("next", "drag") or (word == "move" and any(value)):
            self._assist.stop(BY_HAND)
        if word == "move":
            self._forget_note(hands.selected)
            hands.move(value, time.monotonic())
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
            self._assist.begin(value, hands.selected, state)
        elif word == "drive":
            self._assist.drive(value, hands.selected, state)
        elif word == "drag":
            sight = self._camera_sight
            arm = None if sight is None else hands.drag(state, value, sight)
            if arm is not None:
                self._forget_note(arm)

    def _hold(self) -> None:
        """Hold all arms where they are."""
        self._hands.rest()
        for arm, pursuits in enumerate(self._pursuits):
            if pursuits.stop():
                self._outbox.push(Hold(arm))
        self._assist.stop(f"Every arm holds. {AGAIN}")

    def _forget_note(self, arm: int) -> None:
        if 0 <= arm < len(self._arms):
            self._arms[arm].note = ""

    @property
    def _camera_sight(self) -> Sightline | None:
        """Line of sight of the camera whose picture is shown, of the first of two."""
        sight = self._sights.get(self._sight)
        if sight is None:
            return None
        index = sight.eyes[0][0]
        return Sightline.of(self._scene.cameras[index], self._state["camera_world"][0, index])

    def _sightline(self, client: ClientHandle) -> Sightline:
        """Line of sight of a browser: the camera's if its picture is large, else that of the 3D view."""
        if self._views.get(client.client_id, SMALL_VIEW).large and self._camera_sight is not None:
            return self._camera_sight
        try:
            return Sightline.browser(client.camera.wxyz)
        except AssertionError:  # a browser that has not shown anything yet
            return self._camera_sight or Sightline(np.eye(3), np.zeros(3))

    def _inform(self) -> None:
        """Send each script the values that it shows."""
        desk = self._audience.desk
        ready = [arm.facts.ready(self._state[0]) for arm in self._arms]
        hands = self._hands
        chosen = self._arms[hands.selected].facts.name if hands.selected >= 0 else ""
        wish = self._wish()
        sight = self._camera_sight
        aim = None if sight is None or chosen == "" else self._aim(sight)
        help_ = self._assist.facts(hands.selected, self._state[0])
        for client in self._audience.clients:
            self._wire.inform(
                client,
                {
                    "operates": client == desk.operator,
                    "free": desk.operator is None and not desk.kept(time.monotonic()),
                    "starting": self._starter.active,
                    "ready": hands.selected >= 0 and ready[hands.selected],
                    "arm": chosen,
                    "speed": hands.mode,
                    "eyes": 0 if wish is None else len(wish.sight.eyes),
                    "pair": wish is not None and len(self._sights[self._sight].eyes) > 1,
                    "assist": help_,
                    "aim": aim,
                },
            )

    def _aim(self, sight: Sightline) -> list[float] | None:
        """Where the selected arm has to go next: from and to in the picture, then millimetres apart and in depth."""
        ends = self._assist.aim(self._hands.selected, self._state[0])
        if ends is None:
            return None
        away, deeper = float(np.linalg.norm(ends[1] - ends[0])), sight.depth(ends[1]) - sight.depth(ends[0])
        places = np.concatenate([sight.place(end) for end in ends])
        shown = [*places.round(4).tolist(), round(1e3 * away, 1), round(1e3 * deeper, 1)]
        return shown if np.isfinite(places).all() else None

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
        elif word == "phase":
            self._mark(str(value))
        elif word == "sight":
            self._sight = value
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

    def _obey_arm(self, word: str, arm: int, value: Any) -> None:
        state, facts, pursuits = self._state[0], self._arms[arm].facts, self._pursuits[arm]
        if word == "gizmo":
            self._controls[arm].show_gizmo(value)
            return
        self._arms[arm].note = ""
        self._assist.stop(BY_HAND)
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
        """Send the next goals of motions in progress, slowed or stopped while the operator's browser is silent."""
        client, state = self._operating, self._state[0]
        # goals move in simulated time: an arm keeps a hand's speed in a simulation that is slow, held up, or paused
        step = float(np.clip(state["sim_time"] - self._followed, 0.0, AWAKE))
        self._followed = float(state["sim_time"])
        if client is not None:
            if self._starter.advance(state) and self._camera_sight is not None:
                place = work_place(self._scene, self._state)
                self._hands.bring(state, place, self._camera_sight, self._assist.arm)
            if int(state["resets"]) != self._resets:
                self._resets = int(state["resets"])
                self._assist.forget()
            self._assist.advance(state)
            if self._assist.busy:
                self._hands.selected = self._assist.arm  # it takes the arm that reaches the needle
            if self._hands.busy:
                self._hands.advance(state, self._sightline(client), now, dt)
        driven = [i for i, pursuits in enumerate(self._pursuits) if pursuits.active]
        following = bool(driven or self._assist.busy or self._dragged)
        self._deadman.watch(None if client is None else client.client_id, following, dt)
        by_hand, by_plan = self._deadman.paces(dt)
        silence = self._deadman.silence
        if silence > LEFT:
            self._stop_all(f"the operator's browser has not answered for {silence:.0f} s")
        elif silence > GONE:
            self._give_up(f"the operator's browser has not answered for {1e3 * silence:.0f} ms")
        for arm in driven:
            pace = by_plan if self._pursuits[arm].planned else by_hand
            if pace * step > 0.0:
                for command in self._pursuits[arm].advance(pace * step):
                    self._outbox.push(command)

    @property
    def _operating(self) -> ClientHandle | None:
        """The operator's browser."""
        operator = self._audience.desk.operator
        return None if operator is None else self._audience.clients.get(operator)

    @property
    def _dragged(self) -> set[int]:
        """The arms whose tips are dragged."""
        dragged = {arm for arm, controls in enumerate(self._controls) if controls.dragging}
        return dragged if self._hands.dragging is None else dragged | {self._hands.dragging}

    def _give_up(self, why: str) -> None:
        """Hold all arms that are driven by hand, and show why."""
        dragged = self._dragged
        for arm, (status, pursuits) in enumerate(zip(self._arms, self._pursuits, strict=True)):
            steered = pursuits.active and not pursuits.planned
            if steered or arm in dragged:
                pursuits.stop()
                self._outbox.push(Hold(arm))
                if why and status.note != f"hold: {why}":
                    status.note = f"hold: {why}"
                    self._warn(f"{status.facts.name} holds: {why}")
        self._hands.rest()

    def _stop_all(self, why: str) -> None:
        """Hold every arm that the operator drives, and what is done for the operator, and show why."""
        for pursuits in self._pursuits:
            pursuits.planned = False
        self._give_up(why)
        self._assist.stop(f"It stopped: {why}. {AGAIN}" if why else "")

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
            self._stage.show_aim(self._assist.aim(self._hands.selected, self._state[0]) if operated else None)
            for arm, controls in enumerate(self._controls):
                if not self._pursuits[arm].active:
                    controls.place_gizmo(self._state[0])
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
                    self._pursuits[event.arm].stop()
                    if event.arm == self._assist.arm:
                        self._assist.stop(f"It stopped: {event.value}. {AGAIN}")
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
            self._inform()
            self._show_ros()
        self._pictures.want(self._wish())
        return WORDS_PERIOD

    def _wish(self) -> Wish | None:
        """The picture to draw for the browsers: as large as the largest request."""
        sight = self._sights.get(self._sight)
        self._views = {client: view for client, view in self._views.items() if client in self._audience.clients}
        views = [self._views.get(client, SMALL_VIEW) for client in self._audience.clients]
        seen = [view for view in views if view.height > 0]
        large = [view for view in seen if view.large]
        if sight is None or not seen:
            return None
        if large and not any(view.stereo for view in large):
            sight = sight.mono
        return Wish(sight, max([HEIGHT, *(view.height for view in large)]), bool(large))

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
        if self._sights:
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
