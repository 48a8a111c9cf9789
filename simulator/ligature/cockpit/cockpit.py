"""The cockpit's loop: snapshots to browsers, what the operator does to the bus, and the hand that must not slip.

Browsers speak on the network's thread; whatever they say waits in one queue for the loop, so that all decisions are
made on one thread. Metres, radians, seconds.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from viser import ClientHandle

from ligature.bus import Block, Outbox
from ligature.cockpit.address import Address
from ligature.cockpit.arm_facts import ArmFacts
from ligature.cockpit.arm_panel import ArmControls, ArmStatus
from ligature.cockpit.curves import Curves
from ligature.cockpit.deadman import PATIENCE, DeadMan
from ligature.cockpit.desk import Desk
from ligature.cockpit.gate import Gate
from ligature.cockpit.page import LEFT_WIDTH, Header, look_from, serve
from ligature.cockpit.pictures import Pictures, sights
from ligature.cockpit.pursuit import ArmPursuits
from ligature.cockpit.simulation_panel import Clockwork, SimulationControls, SimulationPanel
from ligature.cockpit.stage import Stage, first_view
from ligature.cockpit.statelog import StateLog
from ligature.model.commands import ArmCommand
from ligature.model.scene import ArmKind, Scene
from ligature.model.state import new_state

PERIOD = 0.01
STAGE_PERIOD, WORDS_PERIOD, CURVES_PERIOD = 0.05, 0.2, 0.4
"""Seconds between turns of the loop, poses, words and controls, and curves."""

KEY = "ligature_operator"
KEY_PATIENCE = 10.0
TOLD = ("warning", "error")
"""Events of an arm that are shown beside it."""

NO_PICTURES = "off"


class Cockpit:
    """The page of one running simulation; `turn` does everything that is due."""

    def __init__(
        self, scene: Scene, block: Block, pictures: Pictures, address: Address, token: str, warn: Callable[[str], None]
    ) -> None:
        self._scene, self._block, self._pictures, self._warn = scene, block, pictures, warn
        self._ring, self._outbox = block.rings["cockpit"], Outbox(block.rings["cockpit"])
        self._state = new_state(scene)
        block.read(self._state)
        block.events.skip()
        self._address = address
        self.server = serve(address, Gate(address, token))
        self._desk, self._deadman = Desk(), DeadMan(self.server)
        self._inbox: deque[tuple[str, int, Any]] = deque()
        self._clients: dict[int, ClientHandle] = {}
        self._seats: dict[int, list[Any]] = {}
        self._clockwork = Clockwork(self._outbox.push)
        self._speed = "1"
        self._log: StateLog | None = None
        self._logged = ""
        facts = [ArmFacts.of(scene, index) for index in range(len(scene.arms))]
        self._pursuits = [ArmPursuits(index) for index in range(len(facts))]
        self._lay_out(facts)
        self._controls: list[ArmControls] = []
        self._run_controls: SimulationControls | None = None
        self._due = {self._show_stage: 0.0, self._show_words: 0.0, self._show_curves: 0.0}
        self._last = time.monotonic()
        self._moved_at, self._tick = self._last, -1
        self.server.on_client_connect(self._on_connect)
        self.server.on_client_disconnect(self._on_disconnect)

    def _lay_out(self, facts: list[ArmFacts]) -> None:
        server, scene = self.server, self._scene
        look_from(server, *first_view(scene, self._state))
        self._header = Header(server, _title(scene))
        self._panel = SimulationPanel(server)
        first = next((f.index for f in facts if f.description.kind is ArmKind.PSM), 0)
        self._arms = [ArmStatus(server, f, f.index == first) for f in facts]
        left = server.gui.add_panel()
        self._sights = {sight.name: sight for sight in sights(scene)}
        self._sight = next(iter(self._sights), NO_PICTURES)
        if self._sights:
            with left.add_tab("Cameras"):
                self._camera_folder = server.gui.add_folder("View")
                self._picture = server.gui.add_image(np.zeros((2, 2, 3), np.uint8), format="jpeg", jpeg_quality=80)
                self._camera_words = server.gui.add_html("")
        self._curves = Curves(scene)
        with left.add_tab("Curves"):
            self._curves.show(server.gui)
        left.dock_left()
        left.set_width(LEFT_WIDTH)
        self._stage = Stage(server, scene)

    # --- browsers, on the network's thread -----------------------------------------------------

    async def _on_connect(self, client: ClientHandle) -> None:
        self._put("connect", client.client_id, client)

    async def _on_disconnect(self, client: ClientHandle) -> None:
        self._put("disconnect", client.client_id, None)

    def _put(self, word: str, client: int, value: Any) -> None:
        self._inbox.append((word, client, value))

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
            self._hear(*self._inbox.popleft(), now)
        self._follow(now, now - self._last)
        self._last = now
        self._curves.observe(self._state[0])
        self._record()
        for show, due in self._due.items():
            if now >= due:
                self._due[show] = now + show(now)
        self._outbox.flush()
        time.sleep(max(PERIOD - (time.monotonic() - now), 0.0))

    def close(self) -> None:
        """End the page, and finish what is recorded."""
        if self._log is not None:
            self._log.close()
        self._pictures.close()
        self.server.stop()

    # --- what browsers do ----------------------------------------------------------------------

    def _hear(self, word: str, client: int, value: Any, now: float) -> None:
        if word == "connect":
            self._clients[client] = value
            threading.Thread(target=self._ask_key, args=(value,), daemon=True).start()
            self._seat(client)
        elif word == "disconnect":
            self._clients.pop(client, None)
            self._seats.pop(client, None)
            if self._desk.leaves(client, now):
                self._stop_all("the operator's browser is gone")
                self._forget_controls()
        elif client not in self._clients:
            return
        elif word == "key":
            if self._desk.comes_back(client, value, now):
                self._begin_operating(client)
        elif word == "claim":
            self._claim(client, value, now)
        elif word == "release" and self._desk.releases(client):
            self._stop_all("the operator gave up control")
            self._end_operating(client)
        elif client == self._desk.operator:
            self._obey(word, value)

    def _ask_key(self, client: ClientHandle) -> None:
        """Ask the browser for the key that it was given as operator, on a thread of its own: it may take a while."""
        with suppress(RuntimeError, TimeoutError):
            key = client.local_storage.get_item(KEY, timeout=KEY_PATIENCE)
            if key:
                self._put("key", client.client_id, key)

    def _claim(self, client: int, key: str, now: float) -> None:
        before = self._desk.operator
        new = self._desk.claim(client, now, key)
        if new is None:
            kept = self._desk.kept(now)
            why = f"The desk is kept for its operator for {kept:.0f} s." if kept else "Somebody operates already."
            self._clients[client].add_notification("Watching only", why, auto_close_seconds=5.0, color="yellow")
            return
        if before is not None and before != client:
            self._stop_all("the operator went to another page")
            self._end_operating(before)
        self._clients[client].local_storage.set_item(KEY, new)
        self._begin_operating(client)

    def _seat(self, client: int) -> None:
        """Tell a browser what it may do, and let it ask for more."""
        handle = self._clients[client]
        for shown in self._seats.pop(client, []):
            shown.remove()
        operates = client == self._desk.operator
        if operates:
            button = handle.gui.add_button("Give up control", color="gray", order=1)
            button.on_click(partial(self._on_release, client))
        else:
            button = handle.gui.add_button("Operate", color="green", order=1, hint="One browser operates, others watch")
            button.on_click(partial(self._on_claim, client))
        self._seats[client] = [button]

    async def _on_release(self, client: int, _: Any) -> None:
        self._put("release", client, None)

    async def _on_claim(self, client: int, _: Any) -> None:
        threading.Thread(target=self._claim_with_key, args=(client,), daemon=True).start()

    def _claim_with_key(self, client: int) -> None:
        handle, key = self._clients.get(client), ""
        if handle is not None:
            with suppress(RuntimeError, TimeoutError):
                key = handle.local_storage.get_item(KEY, timeout=1.0) or ""
        self._put("claim", client, key)

    def _begin_operating(self, client: int) -> None:
        handle, state = self._clients[client], self._state[0]
        self._forget_controls()
        self._seat(client)
        self._controls = [
            ArmControls(handle, status, state, lambda word, arm, value: self._put(word, client, (arm, value)))
            for status in self._arms
        ]
        self._run_controls = SimulationControls(
            handle, self._panel, self._clockwork.paused, self._speed, self._log is not None,
            lambda word, value: self._put(word, client, value),
        )  # fmt: skip
        if self._sights:
            with self._camera_folder:
                choice = handle.gui.add_dropdown("Camera", (*self._sights, NO_PICTURES), initial_value=self._sight)
            choice.on_update(partial(self._on_sight, client))
            self._seats[client].append(choice)

    async def _on_sight(self, client: int, event: Any) -> None:
        self._put("sight", client, event.target.value)

    def _end_operating(self, client: int) -> None:
        for controls in self._controls:
            controls.remove()
        if self._run_controls is not None:
            self._run_controls.remove()
        self._forget_controls()
        if client in self._clients:
            self._seat(client)

    def _forget_controls(self) -> None:
        """The controls went with their browser."""
        self._controls, self._run_controls = [], None

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
        elif word == "record":
            self._switch_log(bool(value))
        elif word == "sight":
            self._sight = value

    def _obey_arm(self, word: str, arm: int, value: Any) -> None:
        state, facts, pursuits = self._state[0], self._arms[arm].facts, self._pursuits[arm]
        if word == "gizmo":
            self._controls[arm].show_gizmo(value)
            return
        self._arms[arm].note = ""
        if word == "command":
            pursuits.stop()
            if value == "Hold":
                self._outbox.push(ArmCommand(arm, "hold"))
            else:
                self._outbox.push(ArmCommand(arm, "state_command", (), value.lower()))
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
        led = [i for i, pursuits in enumerate(self._pursuits) if pursuits.active]
        dragged = any(controls.dragging for controls in self._controls)
        self._deadman.watch(self._desk.operator if led or dragged else None)
        if self._deadman.silence > PATIENCE:
            silent = 1e3 * self._deadman.silence
            self._stop_all(f"the operator's browser has not answered for {silent:.0f} ms")
            return
        for arm in led:
            for command in self._pursuits[arm].advance(min(dt, 0.05)):
                self._outbox.push(command)

    def _stop_all(self, why: str) -> None:
        """Hold every arm that the operator leads, and say why."""
        for arm, (status, pursuits) in enumerate(zip(self._arms, self._pursuits, strict=True)):
            dragged = arm < len(self._controls) and self._controls[arm].dragging
            if pursuits.stop() or dragged:
                self._outbox.push(ArmCommand(arm, "hold"))
                if why and status.note != f"hold: {why}":
                    status.note = f"hold: {why}"
                    self._warn(f"{status.facts.name} holds: {why}")
        self._deadman.watch(None)

    # --- recording -----------------------------------------------------------------------------

    def _switch_log(self, on: bool) -> None:
        if on and self._log is None:
            try:
                self._log = StateLog(self._scene, self._state.dtype, Path("recordings"))
            except OSError as error:
                self._logged = f"recording failed: {error}"
        elif not on and self._log is not None:
            path, self._log = self._log.close(), None
            self._logged = f"recorded to {path}"

    def _record(self) -> None:
        if self._log is None:
            return
        try:
            self._log.observe(self._state)
        except OSError as error:
            self._log, self._logged = None, f"recording failed: {error}"

    # --- what is shown -------------------------------------------------------------------------

    def _show_stage(self, now: float) -> float:
        if self._clients:
            self._stage.update(self._state)
            for arm, controls in enumerate(self._controls):
                if not self._pursuits[arm].active:
                    controls.place_gizmo(self._state[0])
        return STAGE_PERIOD

    def _show_words(self, now: float) -> float:
        state = self._state[0]
        for event in self._block.events.read():
            if event.name in TOLD:
                self._arms[event.arm].note = str(event.value)
                if "servo" in str(event.value):
                    self._pursuits[event.arm].stop()
        if self._tick != int(state["tick"]):
            self._tick, self._moved_at = int(state["tick"]), now
        if self._clients:
            self._show_header(now)
            self._panel.refresh(self._run_words())
            for arm in self._arms:
                arm.refresh(state)
            for controls, pursuits in zip(self._controls, self._pursuits, strict=False):
                controls.refresh(state, not pursuits.active)
            self._show_picture()
        self._pictures.want(self._sights.get(self._sight) if self._clients else None)
        return WORDS_PERIOD

    def _show_header(self, now: float) -> None:
        factor = float(self._block.figures["real_time_factor"][0])
        running = "paused" if self._clockwork.paused else "running" if now - self._moved_at < 1.0 else "standing still"
        kept = self._desk.kept(now)
        operated = (
            "operated"
            if self._desk.operator is not None
            else f"operator away, desk kept {kept:.0f} s"
            if kept
            else "nobody operates"
        )
        self._header.refresh(float(self._state["sim_time"][0]), factor, running, operated, len(self._clients))

    def _run_words(self) -> list[str]:
        figures = self._block.figures
        p50, p99 = 1e3 * float(figures["tick_p50"][0]), 1e3 * float(figures["tick_p99"][0])
        lines = [f"update {p50:.2f} ms, p99 {p99:.2f} ms · {float(figures['behind'][0]):.1f} s behind"]
        lines.append(f"commands {int(figures['received'][0])}, rejected {int(figures['rejected'][0])}")
        if self._log is not None:
            lines.append(f"recording to {self._log.path.name}: {self._log.rows} rows")
        elif self._logged:
            lines.append(self._logged)
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
        if self._clients:
            self._curves.refresh(self._state[0])
        return CURVES_PERIOD


def _title(scene: Scene) -> str:
    """What a person calls the scene: launch files are mostly named alike, their folders are not."""
    folder = scene.models[0].path.parent.name if scene.models else ""
    return f"{folder}/{scene.name}" if folder else scene.name
