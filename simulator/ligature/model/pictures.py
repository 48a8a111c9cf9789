"""Picture files of scenes: read within bounds of formats and size, whatever they claim to be."""

from __future__ import annotations

import struct
import warnings
import zlib
from pathlib import Path

import numpy as np
from PIL import Image

from ligature.adf import Diagnostic, Mark, Severity

FORMATS = ("PNG", "JPEG", "BMP", "TGA", "TIFF", "GIF", "PPM", "WEBP")
"""What is read. Pillow knows more; of those some start other programs (PostScript)."""

MOST_PIXELS = 1 << 26
"""Largest picture, 8192 by 8192: four bytes each, they are 256 MiB."""


class PictureError(ValueError):
    """A file that is no picture, a damaged or too large one; the message gives the reason."""


def read_picture(path: Path) -> Image.Image:
    """The picture ``path`` in memory, of 8 bits a colour; raises `PictureError`, and FileNotFoundError."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of metadata that nobody asked for, and of sizes that are checked here
            with Image.open(path, formats=FORMATS) as picture:
                width, height = picture.size
                if width * height > MOST_PIXELS:
                    raise PictureError(f"has {width} × {height} pixels; the maximum is {MOST_PIXELS}")
                picture.load()
                return _eight_bits(picture.copy())
    except FileNotFoundError:
        raise
    except Image.DecompressionBombError:
        raise PictureError(f"has more than the {MOST_PIXELS} pixels that are read") from None
    except Image.UnidentifiedImageError:
        raise PictureError(f"none of {', '.join(FORMATS)}") from None
    except (
        OSError, SyntaxError, ValueError, TypeError, IndexError, KeyError, AttributeError, OverflowError, MemoryError,
        EOFError, AssertionError, struct.error, zlib.error,
    ) as error:  # fmt: skip
        raise PictureError(str(error) or type(error).__name__) from None


def unreadable(path: Path, error: Exception) -> Diagnostic:
    """The finding about a texture ``path`` that could not be read because of ``error``."""
    message = f"texture '{path.name}' is not a picture that can be read: {error}"
    return Diagnostic(Severity.WARNING, message, Mark(path, 1, 1), "", "render")


def _eight_bits(picture: Image.Image) -> Image.Image:
    """``picture``, of which 16 bits of grey, and grey from 0 to 1, have become 8 bits: Pillow would cut them off."""
    if picture.mode.startswith("I"):
        return Image.fromarray((np.asarray(picture, dtype=np.int64) >> 8).clip(0, 255).astype(np.uint8))
    if picture.mode == "F":
        values = np.nan_to_num(np.asarray(picture, dtype=float))
        scale = 255.0 if values.max(initial=0.0) <= 1.0 else 1.0
        return Image.fromarray(np.rint(scale * values).clip(0.0, 255.0).astype(np.uint8))
    return picture
