"""Pictures of the scene's cameras for the page, drawn by a process of their own: drawing must not hold up an arm.

Small pictures come as seldom as a person puts up with. One that somebody works by comes often, and is drawn with
fewer pixels where the machine is too slow for all of them: a smooth picture is worth more than a sharp one.
"""

from __future__ import annotations

import io
import multiprocessing
import os
import signal
import time
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ligature.bus import Block, BusError
from ligature.model.optics import EYES, stereo_partners
from ligature.model.scene import Scene
from ligature.model.state import new_state, state_dtype
from ligature.process import end_with_parent, lower_priority

HEIGHT = 240
"""Pixels of a small picture from top to bottom."""

PERIOD, LARGE_PERIOD = 0.2, 0.05
"""Seconds between pictures at least: small ones, and one that somebody works by."""

REST, LARGE_REST = 3.0, 0.1
"""Seconds of sleep for each second of drawing."""

RATE = 15.0
"""Large pictures a second below which they get fewer pixels."""

LEAST_SHARE, STEP, SLOW_STEP = 0.5, 0.85, 1.03
"""Smallest share of the pixels from top to bottom, and by what the share falls and rises from picture to picture."""

QUALITY = 82
"""Of JPEG."""

NICE = 5
"""How much lower the scheduling priority of drawing is than that of physics and the rest of the cockpit."""

Eye = tuple[int, str]
"""A camera's index, and which of its eyes: left, right, or an empty text for the camera itself."""


@dataclass(frozen=True)
class Sight:
    """What may be looked at: one camera, or two side by side."""

    name: str
    eyes: tuple[Eye, ...]

    @property
    def mono(self) -> Sight:
        """What its first eye sees."""
        return Sight(self.name, self.eyes[:1])


@dataclass(frozen=True)
class Wish:
    """A sight, how many pixels it is high at most, and whether somebody works by it."""

    sight: Sight
    height: int = HEIGHT
    large: bool = False


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
        self._wanted: Wish | None = None
        self.problem = ""

    def want(self, wish: Wish | None) -> None:
        """Draw ``wish`` from now on, None for nothing."""
        if wish != self._wanted and not self.problem:
            self._wanted = wish
            self._try(lambda: self._pipe.send(wish))

    def newest(self) -> bytes | None:
        """The newest picture that was not taken yet, as `packed`; `problem` is the reason why there are none."""
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


class Sharpness:
    """The share of the pixels that pictures are drawn with, from how long they took; seconds of wall time."""

    def __init__(self) -> None:
        self.share = 1.0
        self._usual = 0.0

    def note(self, spent: float) -> None:
        """A large picture took so long."""
        self._usual = spent if self._usual == 0.0 else 0.7 * self._usual + 0.3 * spent
        takes = (1.0 + LARGE_REST) * self._usual
        if takes > 1.0 / RATE:
            self._set(max(STEP * self.share, LEAST_SHARE))
        elif takes < 0.7 / RATE:
            self._set(min(SLOW_STEP * self.share, 1.0))

    def _set(self, share: float) -> None:
        # what a picture takes goes about with its pixels
        self._usual *= (share / self.share) ** 2
        self.share = share

    def height(self, wish: Wish) -> int:
        """Pixels from top to bottom, in steps of sixteen: each size has buffers of its own."""
        return max(16 * round(self.share * wish.height / 16), HEIGHT) if wish.large else wish.height


def _draw(scene: Scene, bus: str, pipe: Connection) -> None:
    """Main of the process: draws the newest request."""
    end_with_parent()
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    os.setsid()
    lower_priority(NICE)
    wish: Wish | None = None
    easel: _Easel | None = None
    sharpness = Sharpness()
    while True:
        while pipe.poll(None if wish is None else 0):
            wish = pipe.recv()
            if easel is not None:
                easel.reset()
        if wish is None:
            continue
        try:
            easel = easel or _Easel(scene, bus)
        except Exception as error:  # whatever keeps OpenGL from starting here, the page can do without pictures
            pipe.send(str(error))
            return
        begin = time.monotonic()
        if easel.ended:
            return
        picture = easel.picture(replace(wish, height=sharpness.height(wish)))
        if picture is not None:
            pipe.send(packed(picture, len(wish.sight.eyes)))
        spent = time.monotonic() - begin
        if picture is not None and wish.large:
            sharpness.note(spent)
        period, rest = (LARGE_PERIOD, LARGE_REST) if wish.large else (PERIOD, REST)
        time.sleep(max(period - spent, rest * spent))


def packed(picture: NDArray[np.uint8], eyes: int) -> bytes:
    """A picture (height, width, 3) of ``eyes`` side by side: a byte that counts them, then a JPEG.

    The facts that a browser has may be of another picture than the one that it shows.
    """
    stream = io.BytesIO(bytes([eyes]))
    stream.seek(1)
    Image.fromarray(picture).save(stream, "JPEG", quality=QUALITY)
    return stream.getvalue()


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

    def picture(self, wish: Wish) -> NDArray[np.uint8] | None:
        """All eyes of ``wish`` side by side, (h, w, 3); None when the state has not changed since the last picture."""
        from ligature.render import view_of

        self._block.read(self._state)
        moment = int(self._state["tick"][0])
        if moment == self._drawn:
            return None
        self._drawn = moment
        shown = []
        for index, eye in wish.sight.eyes:
            camera = self._scene.cameras[index]
            width, height = camera.resolution
            high = min(wish.height, max(height, HEIGHT))
            size = (max(round(high * width / height), 1), high)
            view = view_of(camera, self._state["camera_world"][0, index], size, eye)
            shown.append(self._renderer.render(self._state, view, ("rgb",), camera.preprocessing_shaders).rgb)
        return np.ascontiguousarray(np.concatenate(shown, axis=1))
