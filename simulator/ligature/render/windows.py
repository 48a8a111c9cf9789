"""All windows of a run: one that shows the cameras in turn, or one for each camera."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import glfw
import numpy as np
from numpy.typing import NDArray

from ligature.bus.codec import Message
from ligature.model.scene import Scene
from ligature.paths import printable
from ligature.render.context import RenderUnavailable
from ligature.render.controls import Controls
from ligature.render.viewer import Figures, Viewer, visible_cameras
from ligature.render.window import SIZE, Window


class Windows:
    """The windows of ``scene``; ``send`` takes the commands of their keys and mice. Raises `RenderUnavailable`.

    With ``each_camera`` every visible camera has a window of its own, and the mouse moves the camera itself, as in
    AMBF; a scene without cameras has a window with the free view. The OpenGL context of the first window draws for all.
    """

    def __init__(self, scene: Scene, send: Callable[[Message], None], each_camera: bool = False) -> None:
        cameras: list[int | None] = list(visible_cameras(scene)) or [None]
        try:
            if each_camera and cameras != [None]:
                self.windows = _of_cameras(scene)
            else:
                self.windows = [Window(f"Ligature: {printable(scene.name)}")]
            self._drawing = self.windows[0]
            self._drawing.activate()
            self.controls = Controls(scene, send, self._drawing.context)
        except RenderUnavailable:
            glfw.terminate()
            raise
        self.controls.moves_cameras = each_camera
        self.viewers = [Viewer(self.controls, camera) for camera, _ in zip(cameras, self.windows, strict=False)]
        for window, viewer in zip(self.windows, self.viewers, strict=True):
            window.listen(viewer)

    @property
    def open(self) -> bool:
        """Whether the user has left a window open."""
        return not all(window.closed for window in self.windows)

    def show(self, state: NDArray[np.void], figures: Figures) -> None:
        """Show ``state`` (1,) in all windows, and take what mice and keys did."""
        for window, viewer in zip(self.windows, self.viewers, strict=True):
            if window.closed:
                window.hide()
                viewer.let_go()
                continue
            self._drawing.activate()
            window.show(viewer.picture(state, window.size, figures))
            viewer.pull()
        self._drawing.activate()
        glfw.poll_events()

    def close(self) -> None:
        """Give all windows back."""
        glfw.terminate()


def _of_cameras(scene: Scene) -> list[Window]:
    """A window for each camera, as its file describes it."""
    on_monitor: Counter[int] = Counter()
    windows = []
    for index in visible_cameras(scene):
        camera = scene.cameras[index]
        devices = f" [{', '.join(camera.controlling_devices)}]" if camera.controlling_devices else ""
        title = f"Ligature: {printable(scene.name)}: {camera.identity.name}{devices}"
        windows.append(Window(title, camera.window_size or SIZE, camera.monitor, on_monitor[camera.monitor]))
        on_monitor[camera.monitor] += 1
    return windows
