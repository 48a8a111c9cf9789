"""Scenes that come with Ligature are found by name; files come first."""

from __future__ import annotations

from pathlib import Path

import ligature
import pytest
from ligature import bundle

from tests.conftest import ROOT


def test_a_checkout_has_its_scenes_beside_the_package() -> None:
    assert bundle.SCENES == ROOT / "scenes" and "suturing" in bundle.scene_names()


def test_a_name_of_a_scene_is_its_launch_file() -> None:
    for name in bundle.scene_names():
        assert bundle.launch_file(Path(name)) == ROOT / "scenes" / name / "launch.yaml"


def test_a_scene_is_loaded_by_its_name() -> None:
    assert ligature.load("needle_pick").bodies


def test_a_file_or_an_unknown_name_stays_what_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "suturing").write_text("bodies: []")
    for name in ("suturing", "nothing", "peg_transfer/launch.yaml", "./deep/er/needle_pick"):
        assert bundle.launch_file(Path(name)) == Path(name)
