"""Which camera the page shows: the operator's choice."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from viser import ClientHandle

NO_PICTURES = "off"


class CameraControls:
    """The operator's; ``act`` takes a word and a value, on the network's thread."""

    def __init__(
        self, client: ClientHandle, folder: Any, names: tuple[str, ...], chosen: str, tube: bool,
        act: Callable[[str, Any], None],
    ) -> None:  # fmt: skip
        with folder:
            self._choice = client.gui.add_dropdown("Camera", (*names, NO_PICTURES), initial_value=chosen)
            self._tube = client.gui.add_checkbox(
                "Endoscope", tube, hint="Its tube in the 3D view, where it stands in the way at first"
            )
        self._act = act
        self._choice.on_update(self._on_choice)
        self._tube.on_update(self._on_tube)

    async def _on_choice(self, event: Any) -> None:
        if event.client_id is not None:
            self._act("sight", event.target.value)

    async def _on_tube(self, event: Any) -> None:
        if event.client_id is not None:
            self._act("tube", bool(event.target.value))

    def remove(self) -> None:
        """Take the choice off the page."""
        self._choice.remove()
        self._tube.remove()
