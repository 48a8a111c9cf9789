"""Which camera the page shows, and what the 3D view leaves out: the operator's choice."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from viser import ClientHandle

NO_PICTURES = "off"

MOST_CUT = 500
"""Millimetres from the eye within which the 3D view may be left empty."""


class CameraControls:
    """The operator's; ``act`` takes a word and a value, on the network's thread."""

    def __init__(
        self, client: ClientHandle, folder: Any, names: tuple[str, ...], chosen: str, tube: bool,
        act: Callable[[str, Any], None],
    ) -> None:  # fmt: skip
        with folder:
            self._choice = client.gui.add_dropdown("Camera", (*names, NO_PICTURES), initial_value=chosen)
            self._tube = client.gui.add_checkbox("Endoscope", tube, hint="Show its tube in the 3D view")
            self._cut = client.gui.add_slider(
                "Cut away mm", 0, MOST_CUT, 5, 0, hint="Hide objects in the 3D view that are nearer than this"
            )
        self._act = act
        self._choice.on_update(self._on_choice)
        self._tube.on_update(self._on_tube)
        self._cut.on_update(self._on_cut)

    async def _on_choice(self, event: Any) -> None:
        if event.client_id is not None:
            self._act("sight", event.target.value)

    async def _on_tube(self, event: Any) -> None:
        if event.client_id is not None:
            self._act("tube", bool(event.target.value))

    async def _on_cut(self, event: Any) -> None:
        if event.client_id is not None:
            self._act("cut", 1e-3 * float(event.target.value))

    def remove(self) -> None:
        """Take the choice off the page."""
        for handle in (self._choice, self._tube, self._cut):
            handle.remove()
