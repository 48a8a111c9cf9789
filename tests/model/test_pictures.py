"""Pictures as other programs save them: whatever depth and colours a file has, what is seen is the same."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from ligature.adf import Resolver
from ligature.model.pictures import read_picture
from ligature.model.slices import read_field, slice_files
from PIL import Image

SHADES = np.linspace(0.0, 1.0, 64).reshape(8, 8)
"""Grey from black to white."""


def eight() -> Image.Image:
    return Image.fromarray(np.rint(255 * SHADES).astype(np.uint8))


def sixteen(order: str) -> Image.Image:
    return Image.fromarray(np.rint(65535 * SHADES).astype(f"{order}u2"))


FORMS = {
    "8 bits": (eight(), "png"), "palette": (eight().convert("P"), "png"), "few colours": (eight().convert("P"), "gif"),
    "opacity": (eight().convert("LA"), "png"), "colours": (eight().convert("RGB"), "bmp"), "TGA": (eight().convert("RGBA"), "tga"),
    "16 bits": (sixteen("<"), "png"), "16 bits TIFF": (sixteen("<"), "tif"), "32 bits": (Image.fromarray((65535 * SHADES).astype(np.int32)), "tif"),
    "real": (Image.fromarray(SHADES.astype(np.float32)), "tif"), "real to 255": (Image.fromarray((255 * SHADES).astype(np.float32)), "tif"),
    "printing inks": (eight().convert("RGB").convert("CMYK"), "tif"), "JPEG of inks": (eight().convert("RGB").convert("CMYK"), "jpg"),
    "JPEG of grey": (eight(), "jpg"), "PGM": (eight(), "pgm"), "WEBP": (eight().convert("RGB"), "webp"),
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
def test_every_form_shows_the_same_shades(form: str, tmp_path: Path) -> None:
    picture, suffix = FORMS[form]
    lossy = {"quality": 100} if suffix == "jpg" else {"lossless": True} if suffix == "webp" else {}
    picture.save(tmp_path / f"a.{suffix}", **lossy)
    seen = np.asarray(read_picture(tmp_path / f"a.{suffix}").convert("RGBA"), dtype=float)
    np.testing.assert_allclose(seen[..., :3], np.repeat(255 * SHADES[..., None], 3, axis=2), atol=3.0)
    assert (seen[..., 3] == 255).all()


@pytest.mark.parametrize("form", [form for form, (_, suffix) in FORMS.items() if suffix in ("png", "tif")])
def test_slices_of_every_form_make_the_same_volume(form: str, tmp_path: Path) -> None:
    """Scanners write 16 bits of grey."""
    picture, suffix = FORMS[form]
    for number in range(3):
        picture.save(tmp_path / f"s{number}.{suffix}")
    field = read_field(slice_files(tmp_path, "s", suffix, 2, Resolver([tmp_path])))
    np.testing.assert_allclose(field, np.repeat(SHADES[::-1].T[..., None], 3, axis=2), atol=3.0 / 255.0)
