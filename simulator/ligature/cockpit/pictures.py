"""Pictures of the scene's cameras for the page, drawn by a process of their own: drawing must not hold up an arm.

It draws the newest state as seldom as a person puts up with, and takes no more than a part of one core.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.bus import Block, BusError
from ligature.model.optics import EYES, stereo_partners
from ligature.model.scene import Scene
from ligature.model.state import new_state, state_dtype
from ligature.process import end_with_parent, lower_priority

HEIGHT = 240
"""Pixels of a picture from top to bottom."""

PERIOD = 0.2
"""Seconds between pictures at least."""

REST = 3.0
"""Seconds of rest for each second of drawing."""

NICE = 10
"""How much lower the scheduling priority of drawing is than that of physics and the rest of the cockpit."""

Eye = tuple[int, str]
"""A camera's index, and which of its eyes: left, right, or an empty text for the camera itself."""


@dataclass(frozen=True)
class Sight:
    """What may be looked at: one camera, or two side by side."""

    name: str
    eyes: tuple[Eye, ...]


def sights(scene: Scene) -> tuple[Sight, ...]:
    """Stereo pairs first, then single cameras."""
    cameras, found = scene.cameras, []
    for left, right in stereo_partners(scene).items():
        names = cameras[left].identity.name, cameras[right].identity.name
        found.append(Sight(" | ".join(names), ((left, ""), (right, ""))))
    for camera in cameras:
        if camera.stereo is not None:
            found.append(Sight(f"{camera.identity.name} (stereo)", tuple((camera.index, eye) for eye in EYES)))
    return (*found, *(Sight(camera.identity.name, ((camera.index, ""),)) for camera in cameras))


class Pictures:
    """Asks for pictures and takes them; begin before any thread is started, since the process is a fork."""

    def __init__(self, scene: Scene, bus: str) -> None:
        context = multiprocessing.get_context("fork")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_draw, args=(scene, bus, theirs), daemon=True)
        self._process.start()
        theirs.close()
        self._wanted: Sight | None = None
        self.problem = ""

    def want(self, sight: Sight | None) -> None:
        """Draw ``sight`` from now on, None for nothing."""
        if sight != self._wanted and not self.problem:
            self._wanted = sight
            self._try(lambda: self._pipe.send(sight))

    def newest(self) -> NDArray[np.uint8] | None:
        """The newest picture (height, width, 3) that was not taken yet; `problem` is the reason why there are none."""
        picture = None
        while not self.problem and self._try(self._pipe.poll):
            got = self._try(self._pipe.recv)
            if isinstance(got, str):
                self.problem = got
            else:
                picture = got
        return picture

    def _try(self, call: Any) -> Any:
        try:
            return call()
        except (EOFError, OSError):
            self.problem = self.problem or "the rendering process has ended"
            return None

    def close(self) -> None:
        """End the process."""
        self._process.terminate()
        self._process.join(1.0)


def _draw(scene: Scene, bus: str, pipe: Connection) -> None:
    """The process: draws what was asked for last."""
    end_with_parent()
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    os.setsid()
    lower_priority(NICE)
    sight: Sight | None = None
    easel: _Easel | None = None
    while True:
        while pipe.poll(None if sight is None else 0):
            sight = pipe.recv()
            if easel is not None:
                easel.reset()
        if sight is None:
            continue
        try:
            easel = easel or _Easel(scene, bus)
        except Exception as error:  # whatever keeps OpenGL from starting here, the page can do without pictures
            pipe.send(str(error))
            return
        begin = time.monotonic()
        if easel.ended:
            return
        picture = easel.picture(sight)
        if picture is not None:
            pipe.send(picture)
        spent = time.monotonic() - begin
        time.sleep(max(PERIOD - spent, REST * spent))


class _Easel:
    def __init__(self, scene: Scene, bus: str) -> None:
        from ligature.render import Renderer

        self._scene = scene
        self._renderer = Renderer(scene)
        self._state = new_state(scene)
        self._drawn = -1
        try:
            self._block = Block.attach(bus, state_dtype(scene))
        except BusError as error:
            raise RuntimeError(str(error)) from error

    @property
    def ended(self) -> bool:
        """Whether the simulation is over."""
        return not self._block.active

    def reset(self) -> None:
        """Draw the same moment again when asked."""
        self._drawn = -1

    def picture(self, sight: Sight) -> NDArray[np.uint8] | None:
        """All eyes of ``sight`` side by side, (h, w, 3); None when nothing has happened since the last one."""
        from ligature.render import view_of

        self._block.read(self._state)
        moment = int(self._state["tick"][0])
        if moment == self._drawn:
            return None
        self._drawn = moment
        shown = []
        for index, eye in sight.eyes:
            camera = self._scene.cameras[index]
            width, height = camera.resolution
            size = (max(round(HEIGHT * width / height), 1), HEIGHT)
            view = view_of(camera, self._state["camera_world"][0, index], size, eye)
            shown.append(self._renderer.render(self._state, view, ("rgb",), camera.preprocessing_shaders).rgb)
        return np.ascontiguousarray(np.concatenate(shown, axis=1))
