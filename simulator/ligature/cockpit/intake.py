"""What browsers send, checked where it enters: only what the page offers, of the kind and in the range that it offers.

viser takes more of a browser than this page offers: files, commands, forms, a tunnel to the internet. Parts of a file
and marks of a form would stay in memory. It also writes any property of a control that a message names, with any value;
the loop of the page would meet it later.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Awaitable, Callable
from typing import Any

import numpy as np
from viser._gui_api import GuiApi
from viser._messages import (
    GetRenderResponseMessage,
    GuiUpdateMessage,
    LocalStorageGetItemResponseMessage,
    TransformControlsDragEndMessage,
    TransformControlsDragStartMessage,
    TransformControlsUpdateMessage,
    ViewerCameraMessage,
)
from viser._scene_api import SceneApi
from viser.infra import Message, WebsockMessageHandler, WebsockServer

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
    except (TypeError, ValueError, OverflowError):
        return False
    return p.shape == (3,) and q.shape == (4,) and bool(np.abs(p).max() <= FARTHEST and 0.5 < np.linalg.norm(q) < 2.0)


def _is_text(value: Any) -> bool:
    return isinstance(value, str) and len(value) <= MOST_TEXT


def _answers(message: LocalStorageGetItemResponseMessage) -> bool:
    return all(value is None or _is_text(value) for value in (message.value, message.error, message.request_uuid))


def _looks(message: ViewerCameraMessage) -> bool:
    """Whether a view is valid: finite numbers of the right shapes, and axes that are not zero."""
    vectors = (message.wxyz, message.position, message.look_at, message.up_direction)
    try:
        numbers = [np.array(value, dtype=float) for value in (*vectors, [message.fov, message.near, message.far])]
    except (TypeError, ValueError, OverflowError):
        return False
    shaped = [value.shape for value in numbers] == [(4,), (3,), (3,), (3,), (3,)]
    return shaped and all(np.isfinite(value).all() for value in numbers) and bool(numbers[0].any())


OFFERED: dict[type[Message], Callable[[Any], bool]] = {
    GuiUpdateMessage: lambda message: _is_text(message.uuid),
    TransformControlsUpdateMessage: lambda message: _is_text(message.name),
    TransformControlsDragStartMessage: lambda message: _is_text(message.name),
    TransformControlsDragEndMessage: lambda message: _is_text(message.name),
    ViewerCameraMessage: _looks,
    LocalStorageGetItemResponseMessage: _answers,
    GetRenderResponseMessage: lambda message: isinstance(message.payload, bytes),
}
"""Kinds of messages that this page asks browsers for, and whether one is sound; no other has an effect."""

_handle = WebsockMessageHandler._handle_incoming_message
_update_control = GuiApi._handle_gui_updates
_update_gizmo = SceneApi._handle_transform_controls_updates


async def _checked_message(self: WebsockMessageHandler, client_id: Any, message: Message) -> None:
    if type(message) in OFFERED and OFFERED[type(message)](message):
        await _handle(self, client_id, message)
    elif isinstance(self, WebsockServer):  # viser asks the server and the connection
        rejections.count += 1


async def _checked_control(self: GuiApi, client_id: Any, message: GuiUpdateMessage) -> None:
    control = self._gui_input_handle_from_uuid.get(message.uuid)
    if control is not None and acceptable(control, message.updates):
        await _update_control(self, client_id, message)
    elif control is not None:
        rejections.count += 1


async def _checked_gizmo(self: SceneApi, client_id: Any, message: TransformControlsUpdateMessage) -> None:
    if placeable(message.position, message.wxyz):
        await _update_gizmo(self, client_id, message)
    else:
        rejections.count += 1


def check_input() -> None:
    """From now on servers of this process take from browsers only what the page and its controls offer."""
    # of numbers of a wrong shape, which it would write to the terminal and keep, each text once
    warnings.filterwarnings("ignore", r"\[viser\]", UserWarning, r"viser\.infra\._messages")
    WebsockMessageHandler._handle_incoming_message = _checked_message  # type: ignore[method-assign]
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
