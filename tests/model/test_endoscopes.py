"""Endoscopes of the dVRK as cameras."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature.model.endoscopes import ENDOSCOPES, seen_through

SCENE = Path(__file__).resolve().parents[2] / "scenes" / "suturing_small" / "launch.yaml"


@pytest.mark.parametrize("name", ENDOSCOPES)
def test_the_corners_of_the_picture_span_the_diagonal_field_of_view(name: str) -> None:
    scope = ENDOSCOPES[name]
    half = np.array(scope.resolution) / 2 / scope.focal_length
    assert 2 * np.arctan(np.linalg.norm(half)) == pytest.approx(np.radians(60.0))
    assert 2 * np.arctan(half[1]) == pytest.approx(scope.field_of_view)
    assert scope.source


def test_a_camera_keeps_its_place_and_gets_the_lens() -> None:
    camera = ligature.load(SCENE).cameras[0]
    fitted = seen_through(camera, "Si_HD")
    assert fitted.resolution == (1920, 1080)
    assert (fitted.attachment, fitted.near, fitted.far) == (camera.attachment, camera.near, camera.far)
    assert fitted.field_of_view == pytest.approx(0.551, abs=1e-3)


def test_a_stereo_camera_gets_the_eyes_of_the_scope_and_a_single_one_none() -> None:
    camera = ligature.load(SCENE).cameras[0]
    pair, single = (replace(camera, stereo=eyes) for eyes in ((0.06, 0.5), None))
    assert seen_through(pair, "Si_HD").stereo == (0.0054, 0.1)
    assert seen_through(single, "Si_HD").stereo is None


@pytest.mark.parametrize(
    ("name", "size", "rate"),
    [("Classic_SD", (640, 480), 30.0), ("Classic_HD", (1280, 720), 60.0), ("Si_HD", (1920, 1080), 30.0)],
)
def test_pictures_have_the_size_and_rate_of_the_video_standard(name: str, size: tuple[int, int], rate: float) -> None:
    """NTSC has 60 fields and 1080i 60 fields a second, two of which are a picture; 720p has 60 pictures."""
    assert (ENDOSCOPES[name].resolution, ENDOSCOPES[name].rate) == (size, rate)


def test_an_unknown_endoscope_is_named_with_those_there_are() -> None:
    with pytest.raises(KeyError, match="unknown endoscope 'Xi'; choose one of Classic_SD, Classic_HD, Si_HD"):
        seen_through(ligature.load(SCENE).cameras[0], "Xi")
