"""Files are opened below the scene's own roots only."""

from __future__ import annotations

from pathlib import Path

import pytest
from ligature.adf import ResolutionError, Resolver
from ligature.adf.resolver import SEARCH_PATH


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    (tmp_path / "lab" / "ADF").mkdir(parents=True)
    (tmp_path / "lab" / "launch.yaml").write_text("x")
    (tmp_path / "secret.txt").write_text("secret")
    return tmp_path / "lab"


def test_the_root_is_the_folder_above_the_file(lab: Path) -> None:
    resolver = Resolver.for_file(lab / "ADF" / "model.yaml")
    assert resolver.resolve("../launch.yaml", lab / "ADF") == lab / "launch.yaml"


def test_a_repository_around_the_file_is_its_root(lab: Path) -> None:
    (lab / "package.xml").write_text("<package/>")
    (lab / "ADF" / "deep" / "deeper").mkdir(parents=True)
    assert Resolver.for_file(lab / "ADF" / "deep" / "deeper" / "m.yaml").roots == (lab,)


def test_a_path_outside_is_refused_with_the_way_out(lab: Path) -> None:
    resolver = Resolver([lab])
    with pytest.raises(ResolutionError, match=r"secret.txt' lies outside the scene's folders .*; allow it with --root"):
        resolver.resolve("../secret.txt", lab)


def test_a_link_that_leaves_is_refused(lab: Path) -> None:
    (lab / "link.txt").symlink_to(lab.parent / "secret.txt")
    with pytest.raises(ResolutionError, match="outside"):
        Resolver([lab]).read_bytes(lab / "link.txt")


def test_a_url_is_refused(lab: Path) -> None:
    with pytest.raises(ResolutionError, match="is a URL; only files are opened"):
        Resolver([lab]).resolve("http://example.org/mesh.obj", lab)


def test_a_large_file_is_refused(lab: Path) -> None:
    (lab / "big.obj").write_bytes(b"0" * 100)
    with pytest.raises(ResolutionError, match="larger than 10 bytes"):
        Resolver([lab]).read_bytes(lab / "big.obj", limit=10)


def test_a_missing_file_and_a_folder_say_which(lab: Path) -> None:
    with pytest.raises(ResolutionError, match="does not exist"):
        Resolver([lab]).read_bytes(lab / "none.yaml")
    with pytest.raises(ResolutionError, match="is a folder"):
        Resolver([lab]).read_bytes(lab / "ADF")


def test_the_search_path_adds_roots(lab: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SEARCH_PATH, str(lab.parent))
    assert Resolver.for_file(lab / "ADF" / "m.yaml").exists(lab.parent / "secret.txt")


def test_bytes_that_are_no_text_say_where(lab: Path) -> None:
    (lab / "bad.yaml").write_bytes(b"name: \xff\xfe")
    with pytest.raises(ResolutionError, match=r"is not UTF-8 text \(byte 6\)"):
        Resolver([lab]).read_text(lab / "bad.yaml")
