"""Files are opened below the scene's own roots only."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from pathlib import Path
from tempfile import TemporaryDirectory

import ligature
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature.adf import ResolutionError, Resolver
from ligature.adf.resolver import MAX_LAUNCH_BYTES, MAX_LAUNCH_FILES, SEARCH_PATH, scene_root
from ligature.render.visuals import VisualLoader

from tests.fuzz.seeds import MTL, OBJ


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
    with pytest.raises(ResolutionError, match="is a URL; give the path of a file"):
        Resolver([lab]).resolve("http://example.org/mesh.obj", lab)


def test_a_large_file_is_refused(lab: Path) -> None:
    (lab / "big.obj").write_bytes(b"0" * 100)
    with pytest.raises(ResolutionError, match="larger than 10 bytes"):
        Resolver([lab]).read_bytes(lab / "big.obj", limit=10)


@given(st.integers(0, 50), st.integers(0, 50))
def test_a_file_is_read_up_to_the_largest_size(size: int, limit: int) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder).resolve() / "mesh.obj"
        path.write_bytes(b"v" * size)
        resolver = Resolver([path.parent])
        if size <= limit:
            assert resolver.read_bytes(path, limit) == b"v" * size
        else:
            with pytest.raises(ResolutionError, match=f"is larger than {limit} bytes"):
                resolver.read_bytes(path, limit)


def test_a_file_of_more_than_256_mib_is_not_read(lab: Path) -> None:
    """The file is sparse, so that it takes no space."""
    path = lab / "huge.obj"
    path.touch()
    os.truncate(path, 256 * 2**20 + 1)
    with pytest.raises(ResolutionError, match="is larger than 268435456 bytes"):
        Resolver([lab]).read_bytes(path)


@pytest.mark.parametrize("more", [0, 1])
def test_a_launch_file_of_up_to_a_mebibyte_widens_the_root(tmp_path: Path, more: int) -> None:
    """The scene is two folders above the model; a larger file is no launch file, and is not read for that."""
    (tmp_path / "outer" / "scene" / "models").mkdir(parents=True)
    model = tmp_path / "outer" / "scene" / "models" / "m.yaml"
    model.write_text("bodies: []\n")
    text = "multibody configs: [scene/models/m.yaml]\n#"
    (tmp_path / "outer" / "launch.yaml").write_text(text + "x" * (2**20 + more - len(text)))
    assert MAX_LAUNCH_BYTES == 2**20
    assert scene_root(model) == (tmp_path / "outer" / "scene" if more else tmp_path)


@pytest.mark.parametrize("others", [199, 200])
def test_the_first_200_files_of_a_folder_may_be_launch_files(tmp_path: Path, others: int) -> None:
    (tmp_path / "outer" / "scene" / "models").mkdir(parents=True)
    model = tmp_path / "outer" / "scene" / "models" / "m.yaml"
    model.write_text("bodies: []\n")
    for k in range(others):
        (tmp_path / "outer" / f"a{k:03}.yaml").write_text("bodies: []\n")
    (tmp_path / "outer" / "launch.yaml").write_text("multibody configs: [scene/models/m.yaml]\n")
    assert MAX_LAUNCH_FILES == 200
    assert scene_root(model) == (tmp_path / "outer" / "scene" if others == 200 else tmp_path)


def test_a_missing_file_and_a_folder_state_which(lab: Path) -> None:
    with pytest.raises(ResolutionError, match="does not exist"):
        Resolver([lab]).read_bytes(lab / "none.yaml")
    with pytest.raises(ResolutionError, match="is a folder"):
        Resolver([lab]).read_bytes(lab / "ADF")


def test_the_search_path_adds_roots(lab: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(SEARCH_PATH, str(lab.parent))
    assert Resolver.for_file(lab / "ADF" / "m.yaml").exists(lab.parent / "secret.txt")


def test_bytes_that_are_no_text_state_where(lab: Path) -> None:
    (lab / "bad.yaml").write_bytes(b"name: \xff\xfe")
    with pytest.raises(ResolutionError, match=r"is not UTF-8 text \(byte 6\)"):
        Resolver([lab]).read_text(lab / "bad.yaml")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-32"])
@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("flow", [False, True])
def test_a_launch_file_is_recognised_in_every_encoding(lab: Path, encoding: str, newline: str, flow: bool) -> None:
    """Else files that it names lie outside the scene."""
    model = lab.parent / "plain" / "scene" / "models" / "m.yaml"
    model.parent.mkdir(parents=True)
    model.write_text("bodies: []\n")
    lines = ["multibody configs: [models/m.yaml]", "world config: w.yaml", ""]
    text = "{" + ", ".join(lines[:2]) + "}" if flow else newline.join(lines)
    (model.parent.parent / "launch.yaml").write_bytes(text.encode(encoding))
    assert scene_root(model) == lab.parent / "plain"


STORES = {
    "git-annex": ".git/annex/objects/aa/bb/SHA256E-s12--{hash}{suffix}/SHA256E-s12--{hash}{suffix}",
    "DVC": ".dvc/cache/files/md5/aa/{hash}", "hub": "blobs/{hash}",
}  # fmt: skip
"""Where programs keep a file; scenes have links to it."""


@pytest.mark.parametrize("store", STORES)
@pytest.mark.parametrize("linked", ["all", "meshes"])
def test_a_scene_of_links_into_a_store_is_read_by_the_names_of_the_links(
    tmp_path: Path, store: str, linked: str
) -> None:
    files = {
        "ADF/launch.yaml": "world config: w.yaml\nmultibody configs: [models/m.yaml]\n", "ADF/w.yaml": "lights: []\n",
        "ADF/models/m.yaml": "bodies: [B]\nB: {name: b, mass: 1, mesh: ../../meshes/part.obj, collision mesh type: CONVEX_HULL}\n",
        "meshes/part.obj": OBJ, "meshes/part.mtl": MTL, "meshes/red.png": "a picture",
    }  # fmt: skip
    for name, text in files.items():
        link = tmp_path / "scene" / name
        link.parent.mkdir(parents=True, exist_ok=True)
        digest = hashlib.md5(name.encode()).hexdigest()
        kept = tmp_path / "scene" / STORES[store].format(hash=digest, suffix=link.suffix)
        kept.parent.mkdir(parents=True, exist_ok=True)
        if linked == "all" or link.suffix in (".obj", ".mtl", ".png"):
            kept.write_text(text)
            link.symlink_to(os.path.relpath(kept, link.parent))
        else:
            link.write_text(text)
    scene = ligature.load(tmp_path / "scene" / "ADF" / "launch.yaml", roots=[tmp_path / "scene"])
    (body,) = scene.bodies
    assert [len(collider.shape.vertices) for collider in body.colliders] == [8, 6]  # type: ignore[union-attr]
    (red, _) = VisualLoader(scene.roots).of_scene(scene)
    assert red.surface.texture is not None and red.surface.texture.read_text() == "a picture"


@given(st.sampled_from(["", "textures", "../textures", "../../assets/a b"]), st.sampled_from(["", "../materials"]))
def test_textures_and_materials_may_lie_anywhere_below_the_scenes_roots(pictures: str, materials: str) -> None:
    with TemporaryDirectory() as place:
        meshes = Path(place, "scene", "ADF", "high_res")
        for folder in (meshes, meshes / pictures, meshes / materials):
            folder.mkdir(parents=True, exist_ok=True)
        (meshes / "part.obj").write_text(OBJ.replace("part.mtl", f"{materials or '.'}/part.mtl"))
        (meshes / materials / "part.mtl").write_text(MTL.replace("red.png", f"{pictures or '.'}/wood.png"))
        (meshes / pictures / "wood.png").write_text("a picture")
        model = meshes.parent / "m.yaml"
        model.write_text(
            "bodies: [B]\nhigh resolution path: high_res\nB: {name: b, mass: 1, mesh: part.obj, collision mesh: ''}\n"
        )
        scene = ligature.load(model, roots=[Path(place)])
        loader = VisualLoader(scene.roots)
        (red, _) = loader.of_scene(scene)
        assert loader.problems == []
        assert red.surface.texture is not None and red.surface.texture.read_text() == "a picture"


def test_a_link_of_another_name_leads_to_the_scene_around_the_file(lab: Path) -> None:
    """As someone makes who starts one scene often."""
    (lab / "package.xml").write_text("<package/>")
    (lab.parent / "mine.yaml").symlink_to(lab / "launch.yaml")
    assert Resolver.for_file(lab.parent / "mine.yaml").roots == (lab,)
    assert Resolver([lab]).allow(lab.parent / "mine.yaml") == lab / "launch.yaml"


@pytest.mark.parametrize("encoding", ["utf-16", "utf-32"])
def test_text_that_is_cut_short_states_its_encoding_and_where(lab: Path, encoding: str) -> None:
    (lab / "bad.yaml").write_bytes("a: 1\nb: 2".encode(encoding)[:-1])
    with pytest.raises(ResolutionError, match=rf"is not {encoding.upper()} text") as caught:
        Resolver([lab]).read_text(lab / "bad.yaml")
    assert caught.value.diagnostic.mark is not None and caught.value.diagnostic.mark.line == 2


NAMES = st.sampled_from(["ADF", "meshes", "descriptions", "multi-bodies", "robots", "b c", "d"])


@st.composite
def archives(draw: st.DrawFn) -> tuple[list[str], list[str], list[str]]:
    """Folders of a launch file within an archive, of a model below the launch file, and of the model that it names."""
    launch = draw(st.lists(NAMES, max_size=2))
    branch = draw(NAMES)
    return launch, [branch, *draw(st.lists(NAMES, max_size=3))], [branch, *draw(st.lists(NAMES, max_size=3))]


def write(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


@given(archives(), st.booleans())
def test_a_model_of_an_archive_has_the_root_of_its_launch_file(
    folders: tuple[list[str], list[str], list[str]], quoted: bool
) -> None:
    at, own, named = folders
    with TemporaryDirectory() as place:
        top = Path(place).resolve() / "downloads" / "archive"
        home = top.joinpath(*at)
        text = os.path.join(".", *named, "named.yaml")
        launch = write(home / "scene.yaml", f"multibody configs:\n  - {json.dumps(text) if quoted else text}\n")
        model = write(home.joinpath(*own, "own.yaml"), "bodies: []\n")
        assert Resolver.for_file(model).roots == Resolver.for_file(launch).roots == (home.parent,)
        assert Resolver.for_file(model).exists(write(home.parent / "meshes" / "m.obj", ""))
        outside = write(home.parent.parent / "secret.obj", "")
        with pytest.raises(ResolutionError, match="lies outside"):
            Resolver.for_file(model).allow(outside)


@given(archives(), NAMES)
def test_a_launch_file_that_names_another_branch_widens_nothing(
    folders: tuple[list[str], list[str], list[str]], other: str
) -> None:
    at, own, _ = folders
    with TemporaryDirectory() as place:
        home = Path(place).resolve().joinpath("archive", *at)
        model = write(home.joinpath(f"{own[0]} alone", *own[1:], "own.yaml"), "bodies: []\n")
        write(home / "scene.yaml", f"multibody configs: ['{other}/named.yaml', '../elsewhere.yaml', '/etc/passwd']\n")
        write(home / "broken.yaml", "multibody configs: [\n")
        assert Resolver.for_file(model).roots == (model.parent.parent,)


def test_the_root_is_never_a_whole_disk_nor_above_the_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    home = tmp_path / "homes" / "ann"
    model = write(home / "model.yaml", "bodies: []\n")
    monkeypatch.setenv("HOME", str(home))
    assert scene_root(model) == home
    write(tmp_path / "launch.yaml", "multibody configs: [homes/ann/scene/ADF/x.yaml]\n")
    assert scene_root(write(home / "scene" / "ADF" / "y.yaml", "")) == home / "scene"
    assert scene_root(Path("/launch.yaml")) == Path("/")


def test_hints_of_many_files_outside_name_one_root(lab: Path) -> None:
    resolver = Resolver.for_file(lab / "ADF" / "deep" / "m.yaml")
    hints = set()
    for number in range(20):
        folder = lab / "meshes" / f"m{number}" / "high_res"
        folder.mkdir(parents=True)
        (folder / "m.obj").touch()
        with pytest.raises(ResolutionError) as caught:
            resolver.resolve(f"../../meshes/m{number}/high_res/m.obj", lab / "ADF" / "deep")
        hints.add(caught.value.diagnostic.hint)
    assert hints == {f"allow it with --root {lab} or {SEARCH_PATH}"}


@pytest.mark.usefixtures("hulls")
@pytest.mark.timeout(900)
def test_every_file_of_the_corpus_loads_from_an_archive_as_it_does_from_a_repository(
    corpus: Path, tmp_path: Path
) -> None:
    """Neither `.git` nor `package.xml` is in it; only paths of their authors' machines stay outside."""
    from ligature.cli.check import findings
    from ligature.model.files import read_scene

    copy = tmp_path / "downloads" / "archive"
    shutil.copytree(corpus, copy, symlinks=True, ignore=shutil.ignore_patterns(".git", "package.xml"))
    for file in sorted(copy.rglob("*.yaml")):
        if file.name == "launch.yaml":  # what its models refer to is seen with each of them
            found = read_scene(file, Resolver.for_file(file, []), None, (), None, ()).findings
        else:
            found = findings(file, [], False)
        for diagnostic in found:
            if "lies outside" in diagnostic.message:
                named = Path(diagnostic.message.split("'")[1])
                assert copy not in named.parents, str(diagnostic)


@pytest.mark.parametrize(("name", "encoding"), [("\ud800.obj", "utf-8"), ("\u624b.obj", "ascii")])
def test_a_name_that_the_system_cannot_encode_is_reported(
    name: str, encoding: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A lone surrogate, which YAML can write, and a letter where the locale is ASCII."""
    monkeypatch.setattr(os, "fsencode", lambda path: os.fspath(path).encode(encoding, "surrogateescape"))
    with pytest.raises(ResolutionError, match="has letters that names of files cannot have"):
        Resolver([tmp_path]).resolve(name, tmp_path)
