"""Saving: all files or none, nothing rewritten that is the same, nothing that cannot be read back."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from ligature.authoring.save import SaveError, checked_text, save_all


def test_only_what_differs_is_written(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"1")
    assert save_all({tmp_path / "a": b"1", tmp_path / "deep" / "b": b"2"}) == [tmp_path / "deep" / "b"]
    assert (tmp_path / "deep" / "b").read_bytes() == b"2"


def test_a_failure_leaves_every_file_as_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a").write_bytes(b"old")
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(SaveError, match="cannot be written"):
        save_all({tmp_path / "a": b"new", tmp_path / "file" / "below": b"new"})
    assert (tmp_path / "a").read_bytes() == b"old"

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(SaveError, match="No space left on device"):
        save_all({tmp_path / "a": b"new"})
    assert (tmp_path / "a").read_bytes() == b"old" and sorted(p.name for p in tmp_path.iterdir()) == ["a", "file"]


def test_what_took_its_place_goes_back_when_a_later_file_cannot(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"old")
    (tmp_path / "z").mkdir()
    with pytest.raises(SaveError, match="z' cannot be written"):
        save_all({tmp_path / "a": b"new", tmp_path / "deep" / "er" / "b": b"new", tmp_path / "z": b"new"})
    assert (tmp_path / "a").read_bytes() == b"old"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a", "z"]


def test_a_file_reached_through_a_folder_that_is_missing_yet_is_known(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"old")
    (tmp_path / "z").mkdir()
    around = tmp_path / "new" / ".." / "a"
    assert save_all({around: b"old"}) == []
    with pytest.raises(SaveError):
        save_all({around: b"changed", tmp_path / "z": b"new"})
    assert (tmp_path / "a").read_bytes() == b"old"


def test_text_that_cannot_be_read_back_is_refused(tmp_path: Path) -> None:
    assert checked_text("a: 1\n", tmp_path / "m.yaml") == b"a: 1\n"
    with pytest.raises(SaveError, match="'m.yaml' would not be readable"):
        checked_text("a: [1\nb: }", tmp_path / "m.yaml")
