"""One video of one camera and episode, by PyAV; every second picture is a key frame, for random access."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from ligature.process import scheduled_as_before

PIXELS = "yuv420p"
"""Halves the resolution of colour: width and height must be even."""


@dataclass(frozen=True)
class Codec:
    """``name`` as readers know it, and FFmpeg's ``encoder`` with its ``options``.

    B pictures are off: with them players see the first picture late.
    """

    name: str
    encoder: str
    options: dict[str, str]


CODECS = {
    "h264": Codec("h264", "libx264", {"crf": "20", "preset": "veryfast", "g": "2", "bf": "0"}),
    "av1": Codec("av1", "libsvtav1", {"crf": "30", "preset": "10", "g": "2"}),
}


def encode(path: Path, pictures: Iterable[NDArray[np.uint8]], size: tuple[int, int], fps: int, codec: Codec) -> int:
    """Write ``pictures`` (h, w, 3) of ``size`` (w, h) as the video ``path``; returns how many there were."""
    path.parent.mkdir(parents=True, exist_ok=True)
    count = 0
    with av.open(str(path), "w", options={"movflags": "faststart"}) as container:
        stream: Any = container.add_stream(codec.encoder, rate=fps, options=codec.options)
        stream.width, stream.height, stream.pix_fmt = *size, PIXELS
        stream.time_base = stream.codec_context.time_base = Fraction(1, fps)
        with scheduled_as_before():
            stream.codec_context.open()
        for picture in pictures:
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")
            frame.pts, frame.time_base = count, Fraction(1, fps)
            container.mux(stream.encode(frame))
            count += 1
        container.mux(stream.encode(None))
    return count


def description(size: tuple[int, int], fps: int, codec: Codec) -> dict[str, Any]:
    """What LeRobot notes of a video feature."""
    return {
        "video.height": size[1], "video.width": size[0], "video.codec": codec.name, "video.pix_fmt": PIXELS,
        "video.is_depth_map": False, "video.fps": fps, "video.channels": 3, "has_audio": False,
    }  # fmt: skip
