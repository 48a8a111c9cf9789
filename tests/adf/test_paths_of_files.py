"""Every key of a scene that names a file, given every wrong path that people write: one finding that says what is right."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from ligature.adf import Severity
from ligature.cache import temporary_folder
from ligature.cli.check import findings

OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 4 2\nf 2 4 3\nf 1 3 4\n"
BODY = "bodies: [B]\nB:\n  name: b\n  mass: 1\n"
LAUNCH = "world config: w.yaml\ncolor config: c.yaml\ninput devices config: i.yaml\nmultibody configs: [m.yaml]\n"


@dataclass(frozen=True)
class Reader:
    """A key that names a file: the scene in which PATH stands for it, the end of such names, and where it is."""

    text: str
    end: str
    file: str = "scene.yaml"
    mesh: str = ""
    material: str = ""


READERS = {
    "mesh": Reader(BODY + '  mesh: "PATH"\n', ".obj"),
    "collision mesh": Reader(BODY + '  mesh: ok.obj\n  collision mesh: "PATH"\n', ".obj"),
    "world config": Reader(LAUNCH.replace("w.yaml", '"PATH"'), ".yaml"),
    "input devices config": Reader(LAUNCH.replace("i.yaml", '"PATH"'), ".yaml"),
    "multibody configs": Reader(LAUNCH.replace("m.yaml", '"PATH"'), ".yaml"),
    "plugins": Reader(BODY + '  plugins: [{name: p, filename: "PATH", path: "./"}]\n', ".py"),
    "sensor mesh": Reader(
        BODY + 'sensors: [S]\nS: {name: s, type: Proximity, parent: B, range: 0.1, mesh: "PATH"}\n', ".obj"
    ),
    "shaders": Reader(BODY + '  mesh: ok.obj\n  shaders: {path: "./", vertex: "PATH", fragment: ok.frag}\n', ".vert"),
}


def _folder(scene: Path, end: str) -> str:
    (scene / f"folder{end}").mkdir()
    return f"folder{end}"


def _outside(scene: Path, end: str) -> str:
    (scene.parent / f"other{end}").write_text("")
    return f"../other{end}"


def _link(scene: Path, end: str, to: str) -> str:
    (scene / f"link{end}").symlink_to(to + end)
    return f"link{end}"


def _locked(scene: Path, end: str) -> str:
    (scene / f"locked{end}").write_text("")
    (scene / f"locked{end}").chmod(0)
    return f"locked{end}"


def _closed_folder(scene: Path, end: str) -> str:
    (scene / "closed").mkdir()
    (scene / "closed").chmod(0)
    return f"closed/a{end}"


def _other_case(scene: Path, end: str) -> str:
    (scene / f"Part{end}").write_text("")
    return f"pARt{end}"


PATHS: dict[str, tuple[Callable[[Path, str], str], str]] = {
    "missing": (lambda _, end: f"none{end}", "does not exist"),
    "missing outside": (lambda _, end: f"/nowhere/none{end}", "does not exist, and lies outside the scene's folders"),
    "outside": (_outside, "allow it with --root"),
    "folder": (_folder, "is a folder"),
    "circle of links": (lambda scene, end: _link(scene, end, "link"), "is a link in a circle"),
    "link to nothing": (lambda scene, end: _link(scene, end, "none"), "does not exist"),
    "below a file": (lambda _, end: f"ok.obj/a{end}", "does not exist"),
    "locked": (_locked, "permission denied"),
    "in a closed folder": (_closed_folder, "permission denied"),
    "long": (lambda _, end: "x" * 300 + end, "too long for a file"),
    "zero byte": (lambda _, end: f"a\\0b{end}", "zero byte"),
    "other case": (_other_case, "upper and lower case differ; the folder has"),
    "backslash": (lambda _, end: f"sub\\\\a{end}", "with '/' between folders"),
    "drive": (lambda _, end: f"C:\\\\sub\\\\a{end}", "is a drive of Windows"),
    "home": (lambda _, end: f"~/a{end}", "write the path of your home folder"),
    "file URL": (lambda _, end: f"file:///sub/a{end}", "give the path itself: '/sub/a"),
    "package": (lambda _, end: f"package://sub/a{end}", "packages are not looked up"),
    "other URL": (lambda _, end: f"https://a.org/a{end}", "give the path of a file"),
}


@pytest.fixture
def scene() -> Iterator[Path]:
    """A folder that also a user may read who is not root, for root reads whatever is locked."""
    with TemporaryDirectory() as folder:
        os.chmod(folder, 0o755)
        inner = Path(folder).resolve() / "scene"
        inner.mkdir()
        (inner / "package.xml").touch()
        (inner / "ok.obj").write_text(OBJ)
        (inner / "ok.frag").write_text("void main() {}\n")
        for name, text in {"w": "namespace: /\n", "c": "white: {}\n", "i": "input devices: []\n", "m": BODY}.items():
            (inner / f"{name}.yaml").write_text(text)
        yield inner
        for file in inner.iterdir():
            if not file.is_symlink():
                file.chmod(0o755)


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("key", READERS)
def test_one_finding_says_what_is_wrong_with_a_path(key: str, path: str, scene: Path) -> None:
    reader, (make, words) = READERS[key], PATHS[path]
    reference = make(scene, reader.end)
    (scene / "scene.yaml").write_text(reader.text.replace("PATH", reference))
    if reader.mesh:
        if path == "zero byte":
            pytest.skip("a material file has no escapes")
        (scene / "painted.obj").write_text(reader.mesh)
        (scene / "painted.mtl").write_text(f"newmtl a\nmap_Kd {reference}\n".replace("\\\\", "\\"))
    root = os.geteuid() == 0
    if root:
        temporary_folder.cache_clear()  # root's own, if an earlier test of this process needed one
        os.seteuid(65534)
    try:
        found = [d for d in findings(scene / "scene.yaml", [], strict=False) if d.severity >= Severity.WARNING]
    finally:
        if root:
            os.seteuid(0)
            temporary_folder.cache_clear()
    about = [d for d in found if d.mark is not None and d.mark.file.name == reader.file]
    assert len(about) == 1, found
    assert words in str(about[0])
