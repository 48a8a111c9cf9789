"""Saving: all files or none, nothing rewritten that is the same, nothing that cannot be read back."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from ligature.authoring.save import SaveError, checked_text, digests, foreign, save_all


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


@pytest.mark.parametrize("umask", [0o022, 0o077])
def test_who_may_read_and_write_a_file_stays(tmp_path: Path, umask: int) -> None:
    modes = dict.fromkeys(("a", "b"), 0o600) | {"c": 0o664, "d": 0o755}
    for name, mode in modes.items():
        (tmp_path / name).touch()
        (tmp_path / name).chmod(mode)
    before = os.umask(umask)
    try:
        save_all({tmp_path / name: b"new" for name in (*modes, "fresh")})
    finally:
        os.umask(before)
    found = {path.name: path.stat().st_mode & 0o777 for path in tmp_path.iterdir()}
    assert found == {**modes, "fresh": 0o666 & ~umask}


def test_a_protected_file_and_the_others_stay_as_they_were(tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("mine")
    (tmp_path / "mine").chmod(0o444)
    with pytest.raises(SaveError, match="mine' is write-protected"):
        save_all({tmp_path / "a": b"new", tmp_path / "mine": b"new"})
    assert [path.read_text() for path in tmp_path.iterdir()] == ["mine"]
    assert save_all({tmp_path / "mine": b"mine"}) == []


def test_text_that_cannot_be_read_back_is_refused(tmp_path: Path) -> None:
    assert checked_text("a: 1\n", tmp_path / "m.yaml") == b"a: 1\n"
    with pytest.raises(SaveError, match="'m.yaml' would not be readable"):
        checked_text("a: [1\nb: }", tmp_path / "m.yaml")


def test_nothing_is_written_outside_the_roots(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "link").symlink_to(tmp_path)
    for outside in (tmp_path / "a", tmp_path / "in" / ".." / "a", tmp_path / "in" / "link" / "a"):
        with pytest.raises(SaveError, match="a' lies outside"):
            save_all({tmp_path / "in" / "b": b"1", outside: b"1"}, [tmp_path / "in"])
        assert not (tmp_path / "a").exists() and not (tmp_path / "in" / "b").exists()
    assert save_all({tmp_path / "in" / "b": b"1"}, [tmp_path / "in"]) == [tmp_path / "in" / "b"]


def test_old_files_stay_beside_the_new_until_the_last_is_in_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("a", "b"):
        (tmp_path / name).write_bytes(b"old " + name.encode())
    seen: list[set[bytes]] = []
    replace = os.replace

    def watched(source: str | Path, target: str | Path) -> None:
        replace(source, target)
        seen.append({path.read_bytes() for path in tmp_path.iterdir()})

    monkeypatch.setattr(os, "replace", watched)
    save_all({tmp_path / "a": b"new a", tmp_path / "b": b"new b"})
    assert b"old a" in seen[-1] and b"old b" in seen[-1]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b"]


def test_files_that_others_wrote_are_known_by_their_content(tmp_path: Path) -> None:
    for name in ("own", "other", "same"):
        (tmp_path / name).write_bytes(b"old")
    own = digests({tmp_path / "own": b"old", tmp_path / "other": b"as it was written"})
    files = {tmp_path / name: b"new" for name in ("own", "other", "missing")} | {tmp_path / "same": b"old"}
    assert foreign(files, own) == [tmp_path / "other"]
