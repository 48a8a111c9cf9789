"""The run on the page: pause, step, reset, speed, recording, and how the loop does."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from typing import Any

from viser import ClientHandle, GuiEvent, ViserServer

from ligature.bus import Pace, Throttle
from ligature.bus.codec import Message
from ligature.model.commands import Reset

SPEEDS = ("0.1", "0.25", "0.5", "1", "2")
STEPS = ("Step 1", "Step 10", "Step 100")


class Clockwork:
    """Pauses, steps and paces the simulation; ``send`` takes the commands."""

    def __init__(self, send: Callable[[Message], None]) -> None:
        self._send = send
        self._clock = False
        self.paused = False

    def pause(self, paused: bool) -> None:
        """Stop or go on."""
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
        """Simulated over wall time."""
        self._send(Pace(speed))


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
        act: Callable[[str, Any], None],
    ) -> None:  # fmt: skip
        self._act = act
        gui = client.gui
        with panel.folder:
            self._paused: Any = gui.add_checkbox("Paused", paused)
            steps = gui.add_button_group("Step", STEPS, hint="Updates to run while paused")
            self._speed = gui.add_dropdown(
                "Speed", SPEEDS, initial_value=speed if speed in SPEEDS else "1", hint="Simulated over wall time"
            )
            reset = gui.add_button("Reset the scene", color="red")
            recorded = gui.add_checkbox("Record states", recording)
        self._paused.on_update(self._of("pause"))
        steps.on_click(self._of("step"))
        self._speed.on_update(self._of("speed"))
        reset.on_click(self._of("reset"))
        recorded.on_update(self._of("record"))
        self._handles: list[Any] = [self._paused, steps, self._speed, reset, recorded]

    def _of(self, word: str) -> Any:
        async def take(event: GuiEvent[Any]) -> None:
            if event.client_id is not None:
                self._act(word, event.target.value)

        return take

    def show_paused(self, paused: bool) -> None:
        """The simulation rests, or runs."""
        self._paused.value = paused

    def remove(self) -> None:
        """Take the controls off the page."""
        for handle in self._handles:
            handle.remove()
