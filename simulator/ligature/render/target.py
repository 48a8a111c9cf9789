"""Frame buffers of one picture size, and the picture read from them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from ligature.kernels import released

PASSES = {
    "rgb": (4, "f1"),
    "depth": (1, "f4"),
    "ids": (1, "f4"),
    "parts": (1, "f4"),
    "normals": (4, "f4"),
    "flow": (2, "f4"),
}
"""What a picture can hold: channels and type of the texture of each.

Numbers of bodies and pieces are floats, which hold them exactly up to 2^24: OpenGL clears such textures together with
the others, where integers would have to be written, which waits for all that is still being drawn.
"""


Readings = dict[str, NDArray[Any]]
"""By pass what OpenGL keeps of a picture (h, w, channels), top row first."""

SATURATED = 255
"""Level of a colour channel above which the picture holds no more light."""


def saturated_share(rgb: NDArray[np.uint8]) -> float:
    """Share of the pixels of a picture (h, w, 3) with all three channels saturated: white, whatever was lit there."""
    return float((rgb == SATURATED).all(axis=2).mean()) if rgb.size else 0.0


def _nothing(dtype: str, *channels: int) -> Any:
    return field(default_factory=lambda: np.zeros((0, 0, *channels), dtype=dtype))


@dataclass(frozen=True, eq=False)
class Frame:
    """One picture, row 0 at the top; what was not asked for is empty.

    ``rgb`` (h, w, 3) uint8; ``depth`` (h, w) float32 metres along the optical axis, inf where
    nothing is; ``ids`` (h, w) int32, 1 + index of the body or ghost; ``normals`` (h, w, 3) float32 in
    the OpenGL eye frame; ``parts`` (h, w) int32, 1 + index of the piece of one material; ``flow``
    (h, w, 2) float32, by how many pixels right and down what is seen has moved since the frame before.
    """

    rgb: NDArray[np.uint8] = _nothing("u1", 3)
    depth: NDArray[np.float32] = _nothing("f4")
    ids: NDArray[np.int32] = _nothing("i4")
    normals: NDArray[np.float32] = _nothing("f4", 3)
    parts: NDArray[np.int32] = _nothing("i4")
    flow: NDArray[np.float32] = _nothing("f4", 2)


class Target:
    """One texture for each pass; colour with ``samples`` a pixel when above 0, resolved before it is read.

    ``colour`` and ``geometry`` are drawn one after the other, or ``whole`` at once, and what lies ``behind`` it.
    """

    def __init__(self, context: moderngl.Context, size: tuple[int, int], passes: Sequence[str], samples: int) -> None:
        self._context = context
        self.size, self.samples = size, samples
        self.passes = [name for name in PASSES if name in passes]
        self._textures = {name: context.texture(size, n, dtype=t) for name in self.passes for n, t in [PASSES[name]]}
        self._depths = context.depth_texture(size)

    @cached_property
    def whole(self) -> moderngl.Framebuffer:
        """All passes."""
        return self._context.framebuffer(list(self._textures.values()), self._depths)

    @cached_property
    def geometry(self) -> moderngl.Framebuffer | None:
        """The passes besides colour."""
        rest = [self._textures[name] for name in self.passes if name != "rgb"]
        return self._context.framebuffer(rest, self._depths) if rest else None

    @cached_property
    def behind(self) -> moderngl.Framebuffer | None:
        """Colour, with the depths of all passes."""
        return self._context.framebuffer([self._textures["rgb"]], self._depths) if "rgb" in self.passes else None

    @cached_property
    def colour(self) -> moderngl.Framebuffer | None:
        """Colour, with depths of its own."""
        if "rgb" not in self.passes:
            return None
        context = self._context
        if not self.samples:
            return context.framebuffer([self._textures["rgb"]], context.depth_renderbuffer(self.size))
        many = context.renderbuffer(self.size, 4, samples=self.samples)
        return context.framebuffer([many], context.depth_renderbuffer(self.size, samples=self.samples))

    @cached_property
    def _resolved(self) -> moderngl.Framebuffer:
        """Where colours of several samples become one."""
        return self._context.framebuffer([self._textures["rgb"]], self._context.depth_renderbuffer(self.size))

    def clear(self, background: tuple[float, float, float, float], apart: bool) -> None:
        """Empty what will be drawn into: ``colour`` and ``geometry`` when ``apart``, else the ``whole``."""
        if self.geometry is not None:
            self.geometry.clear()
        colour = self.colour if apart else self.behind
        if colour is not None:
            colour.clear(*background)

    def with_more(self, *textures: moderngl.Texture) -> moderngl.Framebuffer:
        """The ``whole`` with more textures."""
        return self._context.framebuffer([*self._textures.values(), *textures], self._depths)

    def fill(self, contents: Mapping[str, NDArray[Any]]) -> None:
        """Begin a picture with the ``contents`` of another one."""
        for name, content in contents.items():
            self._textures[name].write(content)

    def fill_depths(self, depths: NDArray[np.float32], left: int, low: int) -> None:
        """Set ``depths`` (h, w) from 0 to 1 of the ``whole`` from a pixel on, rows upwards."""
        self._depths.write(depths, viewport=(left, low, depths.shape[1], depths.shape[0]), alignment=1)

    def contents(self) -> dict[str, NDArray[Any]]:
        """What is in the textures, for `fill`."""
        return {name: np.frombuffer(self._textures[name].read(), dtype="u1") for name in self.passes}

    def depths(self) -> NDArray[np.float32]:
        """Depths (h, w) from 0 to 1 of the ``whole``, rows upwards."""
        width, height = self.size
        return np.frombuffer(self._depths.read(alignment=1), dtype="f4").reshape(height, width)

    def texture(self, name: str) -> moderngl.Texture:
        """Where the pass of that name is drawn."""
        return self._textures[name]

    def read(self) -> Readings:
        """Copy the picture out, as OpenGL keeps it."""
        if self.samples and self.colour is not None:
            self._context.copy_framebuffer(self._resolved, self.colour)
        return {name: self._array(name) for name in self.passes}

    def _array(self, name: str) -> NDArray[Any]:
        width, height = self.size
        channels, dtype = PASSES[name]
        data = np.frombuffer(self._textures[name].read(), dtype="u1" if dtype == "f1" else dtype)
        return data.reshape(height, width, channels)[::-1]


def developed(readings: Readings, colours: Callable[[NDArray[np.uint8]], NDArray[np.uint8]]) -> Frame:
    """The picture that a target's ``readings`` show; ``colours`` makes (h, w, 3) of colours and alpha (h, w, 4)."""
    arrays = dict(readings)
    for name, array in readings.items():
        if name == "rgb":
            arrays[name] = colours(array)
        elif name == "depth":
            arrays[name] = np.empty(array.shape[:2], dtype=np.float32)
            _fill_distances(array[..., 0], arrays[name])
        elif name in ("ids", "parts"):
            arrays[name] = np.empty(array.shape[:2], dtype=np.int32)
            _fill_numbers(array[..., 0], arrays[name])
        elif name == "normals":
            arrays[name] = array[..., :3]
    return Frame(**{name: np.ascontiguousarray(array) for name, array in arrays.items()})


@released
def _fill_distances(read: NDArray[np.float32], out: NDArray[np.float32]) -> None:
    """Fill ``out`` (h, w) with metres; 0 was read where nothing was drawn."""
    for y in range(read.shape[0]):
        for x in range(read.shape[1]):
            out[y, x] = np.inf if read[y, x] == 0.0 else read[y, x]


@released
def _fill_numbers(read: NDArray[np.float32], out: NDArray[np.int32]) -> None:
    """Fill ``out`` (h, w) with whole numbers."""
    for y in range(read.shape[0]):
        for x in range(read.shape[1]):
            out[y, x] = np.int32(read[y, x])


class Exposure:
    """A picture that is being drawn.

    On a software rasteriser it is drawn by other threads, beside what its caller does until it asks for the `frame`.
    ``read`` waits until it is drawn, copies it, and returns what makes the frame of that copy.
    """

    def __init__(self, read: Callable[[], Callable[[], Frame]]) -> None:
        self._read: Callable[[], Callable[[], Frame]] | None = read
        self._develop: Callable[[], Frame] | None = None
        self._frame: Frame | None = None

    def fetch(self) -> None:
        """Wait until the picture is drawn and copy it; what is left for `frame` needs no OpenGL.

        Who begins the next picture in between has it drawn meanwhile.
        """
        if self._read is not None:
            self._develop, self._read = self._read(), None

    def frame(self) -> Frame:
        """The picture, which is the same each time."""
        self.fetch()
        if self._develop is not None:
            self._frame, self._develop = self._develop(), None
        assert self._frame is not None
        return self._frame

    def then(self, change: Callable[[Frame], Frame]) -> Exposure:
        """The same picture with ``change`` made to its frame."""

        def read() -> Callable[[], Frame]:
            self.fetch()
            return lambda: change(self.frame())

        return Exposure(read)
