"""A picture as files: PNG for eyes, NPY for programs, EXR for both.

Depth in metres, or in steps of `DEPTH_STEP` in the 16 bits of a PNG, where 0 is nothing.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ligature.model.optics import Calibration
from ligature.paths import naming
from ligature.process import signals_held
from ligature.render.target import Frame

FORMATS = ("npy", "png", "exr")
DEPTH_STEP = 1e-4
"""Metres of one step of depth in a PNG file, which reaches 6.5 m."""


@contextmanager
def staged(path: Path) -> Iterator[Path]:
    """A file beside ``path`` to write to, which takes its name when all is written; nothing half-written has it.

    Its name is short, whatever that of ``path`` is, and of this process alone. A signal waits until it is written or
    removed. An OSError within names ``path``.
    """
    part = path.with_name(f".{hashlib.sha1(os.fsencode(path.name)).hexdigest()[:16]}.{os.getpid()}.part")
    with naming(path), signals_held():
        try:
            yield part
            os.replace(part, path)
        except BaseException:
            with suppress(OSError):  # where nothing can be written, nothing can be removed
                part.unlink(missing_ok=True)
            raise


def write_json(values: Any, path: Path) -> Path:
    """Write ``values`` as JSON."""
    with staged(path) as part:
        part.write_text(json.dumps(values, indent=1), encoding="utf-8")
    return path


def write_png(image: Image.Image, path: Path) -> Path:
    """Write ``image`` as PNG."""
    with staged(path) as part:
        image.save(part, "PNG")
    return path


def write_frame(frame: Frame, folder: Path, name: str, format: str) -> list[Path]:
    """Write colour as ``name.png``, and depth, ids and normals in ``format``; returns the files.

    NPY: ``name_depth.npy`` and so on. PNG: depth and ids of 16 bits, normals -1..1 as 0..255. EXR: all in ``name.exr``
    with the channels R G B (linear light), Z, id, and N.X N.Y N.Z.
    """
    folder.mkdir(parents=True, exist_ok=True)
    files = [write_png(Image.fromarray(frame.rgb), folder / f"{name}.png")]
    arrays: dict[str, NDArray[Any]] = {"depth": frame.depth, "ids": frame.ids, "normals": frame.normals}
    if format == "exr":
        files.append(folder / f"{name}.exr")
        _write_exr(frame, files[1])
        return files
    for kind, values in arrays.items():
        path = folder / f"{name}_{kind}.{format}"
        if format == "npy":
            with staged(path) as part, part.open("wb") as file:
                np.save(file, values)
        else:
            write_png(Image.fromarray(_levels(kind, values)), path)
        files.append(path)
    return files


def write_calibration(calibration: Calibration, pose: NDArray[np.float64], path: Path) -> Path:
    """Write intrinsics and the pose (7,) of the camera frame in world axes, as JSON."""
    values = {name: getattr(calibration, name).tolist() for name in ("K", "D", "R", "P")}
    size = {"width": calibration.width, "height": calibration.height}
    return write_json({**size, **values, "pose": pose.tolist()}, path)


def _levels(kind: str, values: NDArray[Any]) -> NDArray[np.uint8] | NDArray[np.uint16]:
    if kind == "normals":
        return np.rint((values + 1.0) * 127.5).astype(np.uint8)
    steps = values / DEPTH_STEP if kind == "depth" else values
    return np.where(np.isfinite(steps) & (steps < 2**16), np.rint(np.nan_to_num(steps, posinf=0)), 0).astype(np.uint16)


def _write_exr(frame: Frame, path: Path) -> None:
    import OpenEXR

    level = frame.rgb / 255.0
    linear = np.where(level <= 0.04045, level / 12.92, ((level + 0.055) / 1.055) ** 2.4).astype(np.float32)
    channels = {"Z": frame.depth, "id": frame.ids.astype(np.uint32)}
    channels |= {letter: np.ascontiguousarray(linear[..., i]) for i, letter in enumerate("RGB")}
    channels |= {f"N.{letter}": np.ascontiguousarray(frame.normals[..., i]) for i, letter in enumerate("XYZ")}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with staged(path) as part:
        OpenEXR.File(header, channels).write(str(part))
