"""What browsers send, checked where it enters: only values of the kind, and in the range, that a control offers.

viser writes any property of a control that a message names, with any value; the loop of the page would meet it later.
"""

from __future__ import annotations

import math
from collections.abc import Awaitable, Callable
from typing import Any

import numpy as np
from viser._gui_api import GuiApi
from viser._messages import GuiUpdateMessage, TransformControlsUpdateMessage
from viser._scene_api import SceneApi

MOST_BYTES = 1 << 20
"""Most bytes of a message of a browser; those of people have some hundred."""

MOST_TEXT = 200
"""Most characters of a text."""

FARTHEST = 1e3
"""Largest coordinate in metres of what is dragged."""


class Rejections:
    """Counts what was rejected."""

    def __init__(self) -> None:
        self.count = 0


rejections = Rejections()
"""Of this process; viser's handlers have no place of their own."""


def acceptable(control: Any, updates: Any) -> bool:
    """Whether ``updates`` of the properties of a ``control`` (a viser handle) are what a person can do with it."""
    if not isinstance(updates, dict) or set(updates) != {"value"}:
        return False
    value, now = updates["value"], control.value
    options = getattr(control, "options", None) or getattr(getattr(control, "_impl", None), "options", None)
    if options is not None:
        return isinstance(value, str) and value in options
    if isinstance(now, bool):
        return isinstance(value, bool)
    if isinstance(now, int | float):
        props = control._impl.props
        low, high = getattr(props, "min", -math.inf), getattr(props, "max", math.inf)
        return isinstance(value, int | float) and not isinstance(value, bool) and low <= value <= high
    if isinstance(now, str):
        return isinstance(value, str) and len(value) <= MOST_TEXT
    return False


def placeable(position: Any, wxyz: Any) -> bool:
    """Whether something can be dragged to ``position`` (3,) and the quaternion ``wxyz`` (4,)."""
    try:
        p, q = np.array(position, dtype=float), np.array(wxyz, dtype=float)
    except (TypeError, ValueError):
        return False
    return p.shape == (3,) and q.shape == (4,) and bool(np.abs(p).max() <= FARTHEST and 0.5 < np.linalg.norm(q) < 2.0)


_update_control = GuiApi._handle_gui_updates
_update_gizmo = SceneApi._handle_transform_controls_updates


async def _checked_control(self: GuiApi, client_id: Any, message: GuiUpdateMessage) -> None:
    control = self._gui_input_handle_from_uuid.get(message.uuid) if isinstance(message.uuid, str) else None
    if control is not None and acceptable(control, message.updates):
        await _update_control(self, client_id, message)
    elif control is not None:
        rejections.count += 1


async def _checked_gizmo(self: SceneApi, client_id: Any, message: TransformControlsUpdateMessage) -> None:
    if isinstance(message.name, str) and placeable(message.position, message.wxyz):
        await _update_gizmo(self, client_id, message)
    else:
        rejections.count += 1


def check_input() -> None:
    """From now on servers of this process take from browsers only what their controls offer."""
    GuiApi._handle_gui_updates = _checked_control  # type: ignore[method-assign]
    SceneApi._handle_transform_controls_updates = _checked_gizmo  # type: ignore[method-assign]


def careful(handler: Callable[[Any], Awaitable[None]]) -> Callable[[Any], Awaitable[None]]:
    """``handler`` of websocket connections that closes one which sends what no page sends, without a traceback."""

    async def handle(connection: Any) -> None:
        try:
            await handler(connection)
        except Exception as error:  # a decoder of strangers' bytes may raise anything
            rejections.count += 1
            await connection.close(1007, f"not a message of this page: {type(error).__name__}")

    return handle
