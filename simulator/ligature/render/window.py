"""Windows: each shows pictures and hands mouse and keys to a `Viewer`.

Sizes and places are in the display's units, from the top left corner of all monitors.
"""

from __future__ import annotations

import os
from typing import Any

import glfw
import moderngl
import numpy as np
from numpy.typing import NDArray

from ligature.render.context import RenderUnavailable, tidy
from ligature.render.viewer import Viewer

WITHOUT = "run without '--window'"
"""What one can do where no window opens."""

SIZE = (960, 600)
"""Width and height at start, where the scene asks for none."""

CASCADE = 32
"""Pixels between the corners of windows that open on one monitor, so that each shows its title."""

_VERTEX = """#version 330 core
out vec2 vAt;
void main() {
    vAt = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
    gl_Position = vec4(2.0 * vAt - 1.0, 0.0, 1.0);
}
"""
_FRAGMENT = """#version 330 core
uniform sampler2D uPicture;
in vec2 vAt;
out vec4 fColour;
void main() { fColour = texture(uPicture, vec2(vAt.x, 1.0 - vAt.y)); }
"""
_KEYS = {glfw.KEY_SPACE: " ", glfw.KEY_PERIOD: "."} | {getattr(glfw, f"KEY_{c}"): c for c in "ACFGHJMNRSTV"}

Box = tuple[int, int, int, int]
"""Left, top, width and height."""


def placed(monitor: Box, size: tuple[int, int], number: int) -> Box:
    """Where the window ``number`` of a monitor opens: in its middle, lower than the last one, no larger than it."""
    left, top, wide, high = monitor
    width, height = min(size[0], wide), min(size[1], high)
    step = CASCADE * number
    return (
        left + min((wide - width) // 2 + step, wide - width),
        top + min((high - height) // 2 + step, high - height),
        width,
        height,
    )


class Window:
    """One window with its OpenGL context; raises `RenderUnavailable` without a display.

    It opens at ``size`` on the monitor of index ``monitor``, the first one where there are fewer; ``number`` windows
    are there already.
    """

    def __init__(self, title: str, size: tuple[int, int] = SIZE, monitor: int = 0, number: int = 0) -> None:
        if not os.environ.get("DISPLAY"):
            raise RenderUnavailable(f"no window: there is no display; set DISPLAY, or {WITHOUT}")
        glfw.init_hint(glfw.PLATFORM, glfw.PLATFORM_X11)  # as DISPLAY says; Wayland offers it too
        if not glfw.init():
            raise RenderUnavailable(
                f"no window: the display '{os.environ['DISPLAY']}' cannot be opened; set DISPLAY, or {WITHOUT}"
            )
        for hint, value in (
            (glfw.CONTEXT_VERSION_MAJOR, 3),
            (glfw.CONTEXT_VERSION_MINOR, 3),
            (glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE),
        ):
            glfw.window_hint(hint, value)
        self._monitor = monitor
        left, top, width, height = placed(self._monitor_area(), size, number)
        glfw.window_hint(glfw.VISIBLE, glfw.FALSE)  # it appears where it belongs
        self._window = glfw.create_window(width, height, title, None, None)
        if not self._window:
            raise RenderUnavailable(f"no window: the display has no OpenGL 3.3; install libgl1-mesa-dri, or {WITHOUT}")
        glfw.set_window_pos(self._window, left, top)
        glfw.show_window(self._window)
        glfw.make_context_current(self._window)
        glfw.swap_interval(0)  # several windows would wait for the monitor one after the other; the run bounds the rate
        self.context = tidy(moderngl.create_context(require=330, context=_Functions()))  # type: ignore[arg-type]
        self._program = self.context.program(_VERTEX, _FRAGMENT)
        self._quad = self.context.vertex_array(self._program, [])
        self._texture: moderngl.Texture | None = None
        self._last = (0.0, 0.0)
        self._windowed: Box | None = None

    @property
    def title(self) -> str:
        """What stands above it."""
        return str(glfw.get_window_title(self._window))

    @property
    def box(self) -> Box:
        """Where it is, and how large."""
        return (*glfw.get_window_pos(self._window), *glfw.get_window_size(self._window))

    @property
    def full_screen(self) -> bool:
        """Whether it fills its monitor."""
        return self._windowed is not None

    def toggle_full_screen(self) -> None:
        """Fill the monitor that the window was made for, or go back to where it was."""
        if self._windowed is not None:
            glfw.set_window_monitor(self._window, None, *self._windowed, glfw.DONT_CARE)
            self._windowed = None
            return
        monitor = self._its_monitor()
        if monitor is not None:
            self._windowed = self.box
            mode = glfw.get_video_mode(monitor)
            glfw.set_window_monitor(self._window, monitor, 0, 0, *mode.size, mode.refresh_rate)
            glfw.focus_window(self._window)  # above the others, also where no window manager does it

    def _its_monitor(self) -> Any:
        """The monitor that it opens on; None without any."""
        monitors = glfw.get_monitors()
        return monitors[self._monitor if self._monitor < len(monitors) else 0] if monitors else None

    def _monitor_area(self) -> Box:
        """The part of its monitor that windows may cover; any place without a monitor."""
        monitor = self._its_monitor()
        return (0, 0, *SIZE) if monitor is None else tuple(glfw.get_monitor_workarea(monitor))

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the picture in pixels, at least 2 x 1."""
        width, height = glfw.get_framebuffer_size(self._window)
        return max(width, 2), max(height, 1)

    @property
    def closed(self) -> bool:
        """Whether the user closed it."""
        return bool(glfw.window_should_close(self._window))

    def listen(self, viewer: Viewer) -> None:
        """Hand mouse and keys to ``viewer``."""
        self._viewer = viewer
        glfw.set_key_callback(self._window, self._on_key)
        glfw.set_mouse_button_callback(self._window, self._on_button)
        glfw.set_cursor_pos_callback(self._window, self._on_move)
        glfw.set_scroll_callback(self._window, self._on_wheel)

    def activate(self) -> None:
        """Make its OpenGL context the one that is drawn with."""
        glfw.make_context_current(self._window)

    def show(self, rgb: NDArray[np.uint8]) -> None:
        """Show a picture (h, w, 3); its OpenGL context is then the one that is drawn with."""
        self.activate()
        height, width = rgb.shape[:2]
        if self._texture is None or self._texture.size != (width, height):
            self._texture = self.context.texture((width, height), 3, alignment=1)
        self._texture.write(np.ascontiguousarray(rgb).tobytes(), alignment=1)
        self.context.screen.use()
        self.context.screen.viewport = (0, 0, *self.size)
        self.context.enable_only(moderngl.NOTHING)
        self._texture.use(0)
        self._quad.render(moderngl.TRIANGLES, vertices=3)
        self.context.gc()
        glfw.swap_buffers(self._window)

    def hide(self) -> None:
        """Take it off the screen; its OpenGL context stays."""
        glfw.hide_window(self._window)

    def _on_key(self, _window: Any, key: int, _code: int, action: int, modifiers: int) -> None:
        if key == glfw.KEY_F11 and action == glfw.PRESS:
            self.toggle_full_screen()
        elif action != glfw.RELEASE and key in _KEYS:
            self._viewer.key(_KEYS[key], bool(modifiers & glfw.MOD_CONTROL))

    def _on_button(self, _window: Any, button: int, action: int, modifiers: int) -> None:
        if button == glfw.MOUSE_BUTTON_LEFT:
            if action == glfw.PRESS and modifiers & glfw.MOD_CONTROL:
                self._viewer.grab(*self._pixel())
            elif action == glfw.RELEASE:
                self._viewer.let_go()

    def _on_move(self, _window: Any, x: float, y: float) -> None:
        right, down = x - self._last[0], y - self._last[1]
        self._last = (x, y)
        if self._drives_arm() and self._pressed(glfw.MOUSE_BUTTON_LEFT):
            self._viewer.move_arm(right, down)
        elif self._drives_arm() and self._pressed(glfw.MOUSE_BUTTON_RIGHT):
            self._viewer.turn_arm(right, down)
        elif self._pressed(glfw.MOUSE_BUTTON_LEFT):
            if self._viewer.holds:
                self._viewer.drag(*self._pixel())
            else:
                self._viewer.orbit(right, down)
        elif self._pressed(glfw.MOUSE_BUTTON_RIGHT):
            self._viewer.pan(right, down)
        elif self._pressed(glfw.MOUSE_BUTTON_MIDDLE):
            self._viewer.look(right, down)

    def _on_wheel(self, _window: Any, _x: float, y: float) -> None:
        if self._drives_arm():
            self._viewer.advance_arm(y)
        else:
            self._viewer.zoom(y)

    def _drives_arm(self) -> bool:
        """Whether the mouse drives an arm: one is chosen, and Shift is pressed."""
        shift = (glfw.KEY_LEFT_SHIFT, glfw.KEY_RIGHT_SHIFT)
        return bool(self._viewer.arm) and any(glfw.get_key(self._window, key) == glfw.PRESS for key in shift)

    def _pressed(self, button: int) -> bool:
        return bool(glfw.get_mouse_button(self._window, button) == glfw.PRESS)

    def _pixel(self) -> tuple[float, float]:
        """Where the mouse is in the picture; window units differ from pixels on some screens."""
        x, y = glfw.get_cursor_pos(self._window)
        width, height = glfw.get_window_size(self._window)
        return x * self.size[0] / max(width, 1), y * self.size[1] / max(height, 1)


class _Functions:
    """OpenGL's functions for moderngl, from GLFW; moderngl's own loader needs libGL.so, which only developers have."""

    def __enter__(self) -> None: ...

    def __exit__(self, *_error: object) -> None: ...

    def load_opengl_function(self, name: str) -> int:
        return int(glfw.get_proc_address(name) or 0)

    def release(self) -> None: ...
