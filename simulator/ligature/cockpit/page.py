"""The page as it is laid out for everybody: header, arms, simulation, cameras, curves. Contents come from elsewhere."""

from __future__ import annotations

import contextlib
import io
from html import escape

import numpy as np
from numpy.typing import NDArray
from viser import ClientHandle, GuiApi, ViserServer

from ligature.cockpit.address import Address, AddressError, check_free
from ligature.cockpit.gate import Gate, guarded
from ligature.cockpit.intake import check_input
from ligature.cockpit.stage import VIEW_ANGLE
from ligature.cockpit.wire import Wire

BRAND = (28, 126, 214)
LEFT_WIDTH, RIGHT_WIDTH, CAMERA_HEIGHT = 380, 370, 260
"""Pixels of the panels beside the 3D view, and of the camera's pictures above the curves."""


def serve(address: Address, gate: Gate, wire: Wire | None = None) -> ViserServer:
    """A page at ``address`` behind ``gate``; raises `AddressError` when the address is unavailable."""
    if address.port:
        check_free(address)
    check_input()
    with guarded(gate, wire or Wire()), contextlib.redirect_stdout(io.StringIO()):
        server = ViserServer(address.host, address.port, "Ligature", verbose=False)
    if address.port and server.get_port() != address.port:
        server.stop()
        raise AddressError(f"cannot serve the cockpit at {address.host}:{address.port}: another program took the port")
    gui = server.gui
    paint(gui, True)
    gui.main_panel.dock_right()
    gui.main_panel.set_width(RIGHT_WIDTH)
    return server


PICTURE = '<div id="ligature-picture"></div>'
"""Element in which the script shows the camera's picture while it is small."""

SLOW = 60.0
"""Seconds behind real time above which the figure is shown as a bound."""


def paint(gui: GuiApi, dark: bool) -> None:
    """Have the browser or browsers of ``gui`` wear the dark theme or the light one."""
    gui.configure_theme(
        dark_mode=dark, show_logo=False, show_share_button=False, control_width="large", brand_color=BRAND
    )


def behind(seconds: float) -> str:
    """How much wall time a run has lost since it began, in words: what exceeds a minute is of no interest any more."""
    if seconds < SLOW:
        return f"{seconds:.1f} s behind the clock"
    return "over a minute behind the clock"


def badge(word: str, colour: str) -> str:
    """A word on a coloured ground, as HTML."""
    style = f"background:{colour};color:white;border-radius:4px;padding:1px 6px;font-size:11px"
    return f'<span style="{style}">{escape(word)}</span>'


class Header:
    """The status line: what is shown, how fast it runs, and who operates."""

    def __init__(self, server: ViserServer, scene: str) -> None:
        self._scene = scene
        self._html = server.gui.add_html("", order=0)
        self._shown = ""

    def refresh(self, time: float, factor: float, running: str, operated: str, viewers: int) -> None:
        """Show the figures."""
        mark = badge(running, "#237032" if running == "running" else "#9c5100")
        crowd = f"{operated} · {viewers} browser{'s' if viewers != 1 else ''}"
        words = (
            f'<div id="header" style="padding:4px 8px;font-size:13px"><b>{escape(self._scene)}</b> {mark}<br>'
            f'{time:.1f} s · {factor:.2f} × real time<br><span class="ligature-quiet">{escape(crowd)}</span></div>'
        )
        if words != self._shown:
            self._shown = self._html.content = words


def look_from(server: ViserServer, eye: NDArray[np.float64], at: NDArray[np.float64], up: NDArray[np.float64]) -> None:
    """Where browsers look from at first."""
    camera = server.initial_camera
    distance = float(np.linalg.norm(eye - at))
    camera.position, camera.look_at, camera.up = eye, at, up
    camera.fov, camera.near, camera.far = VIEW_ANGLE, max(distance / 100, 1e-3), max(100 * distance, 10.0)


def look_now(client: ClientHandle, eye: NDArray[np.float64], at: NDArray[np.float64], up: NDArray[np.float64]) -> None:
    """Have one browser look so from now on."""
    with client.atomic():
        client.camera.up_direction, client.camera.position, client.camera.look_at = up, eye, at
