"""Texture files that are missing, broken or of unusual kinds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.render.stage import Stage, ball

GREY = "Ka 0 0 0\nKd 1 1 1\nKs 0 0 0\n"


def reported(stage: Stage) -> str:
    renderer, simulation = stage.renderer()
    simulation.step(1)
    return "\n".join(str(problem.diagnostics[0]) for problem in renderer.problems)


def test_a_texture_that_does_not_exist_is_reported_with_file_and_line(tmp_path: Path) -> None:
    assert "b0.mtl:5:1: warning: texture 'nothing.png' does not exist" in reported(
        Stage(tmp_path, [ball(GREY + "map_Kd nothing.png\n")])
    )


def test_a_texture_that_is_no_picture_is_reported_once(tmp_path: Path) -> None:
    (tmp_path / "bad.png").write_bytes(b"\x89PNG\r\n\x1a\n and then nothing")
    words = reported(Stage(tmp_path, [ball(GREY + "map_Kd bad.png\nmap_Bump bad.png\n")]))
    assert words.count("bad.png:1:1: warning: texture 'bad.png' is not a picture that can be read") == 1


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_sixteen_bits_of_grey_look_as_eight_do(tmp_path: Path, dtype: type) -> None:
    level = np.full((8, 8), 0x60 if dtype is np.uint8 else 0x6000, dtype)
    Image.fromarray(level).save(tmp_path / "t.png")
    stage = Stage(tmp_path, [ball(GREY + "map_Kd t.png\n")], table=None)
    plain = Stage(tmp_path, [ball(GREY.replace("Kd 1 1 1", "Kd 0.376 0.376 0.376"))], table=None)
    assert np.abs(stage.draw().rgb.astype(int) - plain.draw().rgb).max() <= 2
