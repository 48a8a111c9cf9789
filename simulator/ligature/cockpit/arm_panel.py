"""An arm on the page: its state for all viewers, and its controls for the operator, in millimetres and degrees."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray
from viser import ClientHandle, GuiEvent, TransformControlsEvent, ViserServer

from ligature.cockpit.arm_facts import ArmFacts, JointFacts
from ligature.cockpit.page import badge
from ligature.model.frames import matrix_pose7, pose7_matrix
from ligature.robots.operating_state import State

Array = NDArray[np.float64]

TOUCHED = 1.0
"""Seconds after the operator's last touch for which a control does not follow the arm."""

STEP = 1.0
"""Millimetres or degrees by which an arrow key moves a slider; its field takes tenths."""

GIZMO_SIZE = 0.035
"""Metres from the middle of a gizmo to the ends of its arrows."""

COMMANDS = ("Enable", "Home", "Hold", "Disable")
COLOURS = {State.DISABLED: "#5c636a", State.ENABLED: "#237032", State.PAUSED: "#9c5100", State.FAULT: "#c92a2a"}
"""Background colours with enough contrast for white text (4.5 : 1)."""

Act = Callable[[str, int, Any], None]
"""Handles an input of the operator: its kind, the number of the arm, and a value."""


class ArmStatus:
    """What everybody sees of an arm, in the folder that is given to it."""

    def __init__(self, server: ViserServer, facts: ArmFacts, open_: bool) -> None:
        self.facts = facts
        self.note = ""
        self.folder = server.gui.add_folder(facts.name, expand_by_default=open_, order=3 + facts.index)
        with self.folder:
            self._html = server.gui.add_html("")
        self._shown = ""

    def refresh(self, state: Any) -> None:
        """Show a state (one element of the record)."""
        record = state["arm"][self.facts.index]
        words = self._words(record)
        if words != self._shown:
            self._shown = self._html.content = words

    def _words(self, record: Any) -> str:
        operating = State(int(record["operating"]))
        badges = [(operating.name, COLOURS[operating])]
        badges += [("HOMED", "#1864ab")] if record["homed"] else [("NOT HOMED", "#5c636a")]
        badges += [("BUSY", "#9c5100")] if record["busy"] else []
        marks = " ".join(badge(word, colour) for word, colour in badges)
        x, y, z = (np.round(1e3 * record["measured_cp"][:3], 1) + 0.0).tolist()  # and no -0.0
        force = float(np.linalg.norm(record["spatial_measured_cf"][:3]))
        tip = f"tip {x:.1f} {y:.1f} {z:.1f} mm · {force:.2f} N"
        note = f'<br><span class="ligature-note">{escape(self.note)}</span>' if self.note else ""
        return f'<div id="arm-{self.facts.name}" style="font-size:12px;padding:2px 8px">{marks}<br>{tip}{note}</div>'


class ArmControls:
    """The operator's controls of one arm, on the operator's page alone; ``act`` takes what is done with them."""

    def __init__(self, client: ClientHandle, status: ArmStatus, state: Any, act: Act) -> None:
        self.facts = status.facts
        self._act, self._touched, self._astray = act, 0.0, False
        self._ready: bool | None = None
        gui = client.gui
        with status.folder:
            buttons = gui.add_button_group("Arm", COMMANDS)
            buttons.on_click(self._on_command)
            self._shows_gizmo = gui.add_checkbox("Gizmo", False, hint="Drag the tip in the 3D view")
            self._shows_gizmo.on_update(self._on_gizmo_shown)
            values = self.facts.setpoints(state)
            self._sliders = [_slider(gui, joint, float(v)) for joint, v in zip(self.facts.joints, values, strict=True)]
            self._grip = None
            if self.facts.grip is not None:
                self._grip = _slider(gui, self.facts.grip, self._opening(state))
                self._grip.on_update(partial(_forward, self._on_grip))
        for i, slider in enumerate(self._sliders):
            slider.on_update(partial(_forward, partial(self._on_joint, i)))
        self._handles: list[Any] = [buttons, self._shows_gizmo, *self._sliders, *([self._grip] if self._grip else [])]
        self._gizmo = client.scene.add_transform_controls(
            f"/gizmo/{self.facts.name}", GIZMO_SIZE, depth_test=False, visible=False, line_width=3.0
        )
        self._gizmo.on_update(self._on_drag)
        self.dragging = False
        self._at: Array | None = None

    # --- what the operator does, on the network's thread --------------------------------------

    async def _on_command(self, event: GuiEvent[Any]) -> None:
        self._act("command", self.facts.index, event.target.value)

    async def _on_gizmo_shown(self, event: GuiEvent[Any]) -> None:
        self._act("gizmo", self.facts.index, bool(event.target.value))

    async def _on_joint(self, joint: int, value: float) -> None:
        self._touched, self._astray = time.monotonic(), True
        self._act("joint", self.facts.index, (joint, _inside(self.facts.joints[joint], value)))

    async def _on_grip(self, value: float) -> None:
        assert self.facts.grip is not None
        self._touched, self._astray = time.monotonic(), True
        self._act("grip", self.facts.index, _inside(self.facts.grip, value))

    async def _on_drag(self, event: TransformControlsEvent) -> None:
        self.dragging = event.phase != "end"
        w, x, y, z = np.asarray(event.target.wxyz, dtype=float).tolist()
        pose = np.array([*np.asarray(event.target.position, dtype=float).tolist(), x, y, z, w])
        if np.isfinite(pose).all() and 0.5 < np.linalg.norm(pose[3:]) < 2.0:
            self._act("drag", self.facts.index, pose7_matrix(pose))

    # --- what the page shows -------------------------------------------------------------------

    def show_gizmo(self, shown: bool) -> None:
        """Show or hide the gizmo."""
        self._gizmo.visible = shown

    def refresh(self, state: Any, idle: bool) -> None:
        """Follow a state; sliders stay where the operator has them unless the arm is ``idle``."""
        ready = self.facts.ready(state)
        if ready != self._ready:
            self._ready = ready
            for handle in self._handles[1:]:
                handle.disabled = not ready
        if not idle or time.monotonic() - self._touched < TOUCHED:
            return
        for slider, joint, value in zip(self._sliders, self.facts.joints, self.facts.setpoints(state), strict=True):
            _follow(slider, joint, float(value), self._astray)
        if self._grip is not None and self.facts.grip is not None:
            _follow(self._grip, self.facts.grip, self._opening(state), self._astray)
        self._astray = False

    def place_gizmo(self, state: Any) -> None:
        """Take the gizmo to the tip, unless it is dragged."""
        pose = matrix_pose7(self.facts.tip_in_world(state))
        if self.dragging or (self._at is not None and np.abs(pose - self._at).max() < 1e-5):
            return
        self._at = pose
        x, y, z, qx, qy, qz, qw = pose.tolist()
        self._gizmo.position, self._gizmo.wxyz = (x, y, z), (qw, qx, qy, qz)

    def lost_gizmo(self) -> None:
        """The gizmo is elsewhere than where it was last put: the operator dragged it."""
        self._at = None

    def _opening(self, state: Any) -> float:
        return float(state["arm"][self.facts.index]["jaw_setpoint_js"][0])

    def remove(self) -> None:
        """Take the controls off the page."""
        for handle in self._handles:
            handle.remove()
        self._gizmo.remove()


def _slider(gui: Any, joint: JointFacts, value: float) -> Any:
    low, high = round(joint.scale * joint.low, 1), round(joint.scale * joint.high, 1)
    shown = float(np.clip(round(joint.scale * value, 1), low, high))
    slider = gui.add_slider(f"{joint.name.replace('_', ' ')} {joint.unit}", low, high, STEP, shown)
    slider.precision = 1
    return slider


def _follow(slider: Any, joint: JointFacts, value: float, astray: bool) -> None:
    """Set a slider to a value; when it is ``astray``, also if the server's copy has that value already.

    What the browser sends of a drag and what it is sent cross on their way, and it keeps the older of the two.
    """
    shown = float(np.clip(round(joint.scale * value, 1), slider.min, slider.max))
    if astray and abs(shown - slider.value) <= 0.05:
        slider.value = shown + (0.1 if shown < slider.max else -0.1)
    if abs(shown - slider.value) > 0.05:
        slider.value = shown


def _inside(joint: JointFacts, shown: float) -> float:
    return float(np.clip(shown / joint.scale, joint.low, joint.high))


async def _forward(take: Any, event: GuiEvent[Any]) -> None:
    """Forward an input of a person; changes by the page itself have no client."""
    value = float(event.target.value)
    if event.client_id is not None and np.isfinite(value):
        await take(value)
