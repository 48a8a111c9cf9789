"""Pictures survive the way through files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from ligature import Simulation
from ligature.render import Frame
from ligature.render.files import DEPTH_STEP, write_frame, write_json
from PIL import Image

from tests.render.conftest import LENS, camera


@pytest.fixture
def frame(simulate: Callable[..., Simulation]) -> Frame:
    wide = LENS.replace("angle: 0.9", "angle: 2.6")
    return simulate(C=camera("C", lens=wide)).cameras["C"].capture(passes=("rgb", "depth", "ids", "normals"))


def test_npy_keeps_every_bit(frame: Frame, tmp_path: Path) -> None:
    files = write_frame(frame, tmp_path / "new", "C", "npy")
    assert [f.name for f in files] == ["C.png", "C_depth.npy", "C_ids.npy", "C_normals.npy"]
    assert (np.asarray(Image.open(files[0])) == frame.rgb).all()
    for path, values in zip(files[1:], (frame.depth, frame.ids, frame.normals), strict=True):
        assert (np.load(path) == values).all()


def test_png_keeps_depth_to_its_step_and_nothing_as_zero(frame: Frame, tmp_path: Path) -> None:
    write_frame(frame, tmp_path, "C", "png")
    depth = np.asarray(Image.open(tmp_path / "C_depth.png"), dtype=float) * DEPTH_STEP
    solid = np.isfinite(frame.depth)
    assert not solid.all() and (depth[~solid] == 0).all()
    assert np.abs(depth[solid] - frame.depth[solid]).max() <= DEPTH_STEP * 0.51
    assert (np.asarray(Image.open(tmp_path / "C_ids.png")) == frame.ids).all()


def test_exr_keeps_all_channels_in_one_file(frame: Frame, tmp_path: Path) -> None:
    write_frame(frame, tmp_path, "C", "exr")
    with OpenEXR.File(str(tmp_path / "C.exr"), separate_channels=True) as found:
        channels = {name: channel.pixels for name, channel in found.channels().items()}
    assert set(channels) == {"R", "G", "B", "Z", "id", "N.X", "N.Y", "N.Z"}
    assert (channels["Z"] == frame.depth).all() and (channels["id"] == frame.ids).all()
    assert (channels["N.Z"] == frame.normals[..., 2]).all()


@pytest.mark.parametrize("format", ["npy", "png", "exr"])
def test_nothing_half_written_stays_when_a_file_cannot_take_its_name(frame: Frame, tmp_path: Path, format: str) -> None:
    last = tmp_path / {"npy": "C_normals.npy", "png": "C_normals.png", "exr": "C.exr"}[format]
    last.mkdir()
    with pytest.raises(OSError, match=last.name):
        write_frame(frame, tmp_path, "C", format)
    assert last.is_dir() and not [path.name for path in tmp_path.iterdir() if path.name.startswith(".")]


@pytest.mark.parametrize("name", ["x" * 255, "ß" * 127], ids=["letters", "two bytes each"])
def test_a_file_may_have_any_name_that_the_system_takes(name: str, tmp_path: Path) -> None:
    assert write_json([1], tmp_path / name).read_text() == "[\n 1\n]"
    assert [path.name for path in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize("where", ["a file/in it", "missing/in it", "y" * 256], ids=["a file", "nothing", "too long"])
def test_what_cannot_be_written_is_named_as_the_user_named_it(where: str, tmp_path: Path) -> None:
    (tmp_path / "a file").write_text("")
    with pytest.raises(OSError) as caught:
        write_json([1], tmp_path / where)
    assert caught.value.filename == str(tmp_path / where)
