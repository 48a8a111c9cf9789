"""The run on the page: pause, step, reset, speed, recording, and how the loop does."""

from __future__ import annotations

import time
from collections.abc import Callable
from html import escape
from typing import Any

from viser import ClientHandle, GuiEvent, ViserServer

from ligature.bus import Pace, Recording, Throttle
from ligature.bus.codec import Message
from ligature.bus.recording import SUFFIX, file_name
from ligature.model.commands import MarkPhase, Reset

SPEEDS = ("0.1", "0.25", "0.5", "1", "2")
STEPS = ("Step 1", "Step 10", "Step 100")

ANSWERED = 1.0
"""Seconds that the simulation is given to begin or end a recording, before the page shows what it does."""


class Clockwork:
    """Pauses, steps and paces the simulation; ``send`` takes the commands."""

    def __init__(self, send: Callable[[Message], None]) -> None:
        self._send = send
        self._clock = False
        self.paused = False

    def pause(self, paused: bool) -> None:
        """Pause or resume."""
        self.paused = paused
        self._send(Throttle(paused, self._clock, 1 if paused else 0))

    def step(self, updates: int) -> None:
        """Run so many updates, then rest; pauses a simulation that runs."""
        if not self.paused:
            self.pause(True)
        self._clock = not self._clock
        self._send(Throttle(True, self._clock, updates))

    def reset(self) -> None:
        """Put everything back to where the scene starts."""
        self._send(Reset())

    def pace(self, speed: float) -> None:
        """Simulated time over wall time."""
        self._send(Pace(speed))

    def record(self, name: str) -> None:
        """Record to the file ``name``, or to one with the date; raises ValueError for what is no name."""
        self._send(Recording(file_name(name) or time.strftime(f"%Y-%m-%d-%H%M%S{SUFFIX}")))

    def mark(self, phase: str) -> None:
        """Mark that a phase of the work begins; raises ValueError for what is no name of one."""
        self._send(MarkPhase.of(phase))

    def end_record(self) -> None:
        """Record no longer."""
        self._send(Recording(""))


class SimulationPanel:
    """What everybody sees; the folder takes the operator's controls."""

    def __init__(self, server: ViserServer) -> None:
        self.folder = server.gui.add_folder("Simulation", order=2)
        with self.folder:
            self._html = server.gui.add_html("")
        self._shown = ""

    def refresh(self, lines: list[str]) -> None:
        """Show lines of plain text."""
        words = "<br>".join(escape(line) for line in lines)
        words = f'<div id="simulation" style="font-size:12px;padding:2px 8px">{words}</div>'
        if words != self._shown:
            self._shown = self._html.content = words


class SimulationControls:
    """The operator's; ``act`` takes a word and a value, on the network's thread."""

    def __init__(
        self, client: ClientHandle, panel: SimulationPanel, paused: bool, speed: str, recording: bool,
        record_as: str, phase: str, act: Callable[[str, Any], None],
    ) -> None:  # fmt: skip
        self._act = act
        gui = client.gui
        with panel.folder:
            self._paused: Any = gui.add_checkbox("Paused", paused)
            steps = gui.add_button_group("Step", STEPS, hint="Updates to run while paused")
            self._speed = gui.add_dropdown(
                "Speed", SPEEDS, initial_value=speed if speed in SPEEDS else "1", hint="Simulated time over wall time"
            )
            reset = gui.add_button("Reset the scene", color="red")
            name = gui.add_text(
                "Record as", record_as, hint="File name in the folder of recordings; empty uses the date"
            )
            self._recorded: Any = gui.add_checkbox(
                "Record", recording, hint="'ligature replay' simulates the recording again, bit for bit"
            )
            self._phase: Any = gui.add_text(
                "Phase", phase, hint="Phase of the work that begins next, such as 'G3 push the needle'; empty for none"
            )
            mark = gui.add_button(
                "Mark the phase", color="gray", hint="From now on recordings and their datasets have this label"
            )
        self._paused.on_update(self._of("pause"))
        steps.on_click(self._of("step"))
        self._speed.on_update(self._of("speed"))
        reset.on_click(self._of("reset"))
        name.on_update(self._of("record as"))
        self._recorded.on_update(self._of("record"))
        mark.on_click(self._mark)
        self._asked = 0.0
        self._handles: list[Any] = [self._paused, steps, self._speed, reset, name, self._recorded, self._phase, mark]

    def _of(self, word: str) -> Any:
        async def take(event: GuiEvent[Any]) -> None:
            if event.client_id is not None:
                if word == "record":
                    self._asked = time.monotonic()
                self._act(word, event.target.value)

        return take

    async def _mark(self, event: GuiEvent[Any]) -> None:
        if event.client_id is not None:
            self._act("phase", self._phase.value)

    def show_recording(self, recording: bool) -> None:
        """Whether the simulation records, once it has had time to do what was asked for."""
        if time.monotonic() - self._asked > ANSWERED and self._recorded.value != recording:
            self._recorded.value = recording

    def show_paused(self, paused: bool) -> None:
        """The simulation rests, or runs."""
        self._paused.value = paused

    def remove(self) -> None:
        """Take the controls off the page."""
        for handle in self._handles:
            handle.remove()
