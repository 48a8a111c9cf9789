"""Every command that reads a file, given every kind of other file: it names what it got and what to do."""

from __future__ import annotations

import gzip
import io
import struct
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from ligature.cli.main import app
from typer.testing import CliRunner

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
FACES = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]
OBJ = "\n".join([*(f"v {x} {y} {z}" for x, y, z in CORNERS), *(f"f {a + 1} {b + 1} {c + 1}" for a, b, c in FACES)])


def stl() -> bytes:
    facets = (struct.pack("<12fH", *[0.0] * 3, *CORNERS[list(face)].ravel(), 0) for face in FACES)
    return bytes(80) + struct.pack("<I", len(FACES)) + b"".join(facets)


def archive() -> bytes:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as written:
        written.writestr("a", "b")
    return data.getvalue()


REST = bytes(range(1, 120))
CONTENTS = {
    "a PLY mesh": b"ply\nformat ascii 1.0\nelement vertex 0\nend_header\n",
    "an OFF mesh": b"OFF\n4 4 0\n",
    "a glTF model": b"glTF\x02\0\0\0" + REST,
    "an FBX model": b"Kaydara FBX Binary  \0" + REST,
    "an OBJ mesh": f"# made by hand\n\n{OBJ}\n".encode(),
    "an STL mesh": stl(),
    "a Blender file": b"BLENDER-v300" + REST,
    "a COLLADA model": b"<?xml version='1.0'?>\n<COLLADA/>",
    "a URDF robot": b"<?xml version='1.0'?><!-- r --><robot name='a'><link name='b'/></robot>",
    "an SDF model": b"<sdf version='1.6'><model name='m'/></sdf>",
    "an MJCF model": b"<mujoco><worldbody/></mujoco>",
    "an XML file": b"<?xml version='1.0'?><launch/>",
    "a record of a run": b'{"format": "ligature record 1"}\n' + REST,
    "a ROS bag": b"#ROSBAG V2.0\n" + REST,
    "an HDF5 file": b"\x89HDF\r\n\x1a\n" + REST,
    "a zip archive": archive(),
    "a compressed file": gzip.compress(b"bodies: []"),
    "a picture": b"\x89PNG\r\n\x1a\n" + REST,
    "a PDF document": b"%PDF-1.4\n",
    "a program": b"\x7fELF" + REST,
}
SCENES = ("check", "inertia", "fmt", "bench", "render", "diff", "poses")
NAMES = ("file.yaml", "file", "file.ply")
MESHES = {"file.obj": "an OBJ mesh", "file.stl": "an STL mesh", "file.3ds": ""}
RECORDINGS = {
    "replay": (["replay"], ("a ROS bag", "a record of a run")),
    "score": (["score", "suture"], ("a ROS bag", "a record of a run")),
    "dataset info": (["dataset", "info"], ("an HDF5 file",)),
    "dataset join": (["dataset", "join"], ("an HDF5 file",)),
    "dataset export": (["dataset", "export"], ("an HDF5 file",)),
}
"""Commands that read what was recorded, and the kinds that they read."""


def printed(folder: Path, command: str | list[str], name: str, content: bytes) -> str:
    """What a command prints about a file, as one line; it must fail without an exception of Python's."""
    file = folder / name
    file.write_bytes(content)
    words = [command] if isinstance(command, str) else command
    out = {"diff": [str(file)], "render": ["--camera", "c"], "poses": ["--out", str(folder / "out.npz")]}
    more = [str(folder / "exported")] if words[-1] == "export" else out.get(words[0], [])
    result = CliRunner().invoke(app, [*words, str(file), *more])
    assert result.exit_code != 0
    assert isinstance(result.exception, SystemExit), repr(result.exception)
    return " ".join(result.output.split())


@pytest.mark.parametrize("turn", range(len(SCENES)), ids=SCENES)
def test_a_scene_command_names_what_it_got(turn: int, tmp_path: Path) -> None:
    """The commands share how they read a scene: each content has one of the names, and every name over the commands."""
    for number, (what, content) in enumerate(CONTENTS.items()):
        name = NAMES[(number + turn) % len(NAMES)]
        assert f"is {what}, not a scene file; " in printed(tmp_path, SCENES[turn], name, content), (what, name)


@pytest.mark.parametrize("command", ["inertia", "decompose"])
def test_a_mesh_command_names_what_it_got(command: str, tmp_path: Path) -> None:
    for what, content in CONTENTS.items():
        for name, own in MESHES.items():
            if what != own and not (own == "an STL mesh" and what == "an OBJ mesh"):
                assert f"'{name}' is {what}, not a" in printed(tmp_path, command, name, content), (what, name)


def test_decompose_names_what_it_got_by_another_name_and_what_it_reads(tmp_path: Path) -> None:
    for what, content in CONTENTS.items():
        for name in NAMES:
            text = printed(tmp_path, "decompose", name, content)
            renamed = any(f"but not named as one; rename it to 'file{ending}'" in text for ending in (".obj", ".stl"))
            assert f"'{name}' is {what}, " in text and (renamed or "use .obj, .stl, .3ds: " in text), (what, name)


@pytest.mark.parametrize(("command", "own"), RECORDINGS.values(), ids=RECORDINGS)
def test_a_command_for_recordings_names_what_it_got(command: list[str], own: tuple[str, ...], tmp_path: Path) -> None:
    for number, (what, content) in enumerate(CONTENTS.items()):
        name = NAMES[number % len(NAMES)]
        text = printed(tmp_path, command, name, content)
        if what not in own:
            assert f"{name}' is {what}, not a " in text and "; " in text.partition(" is ")[2], (what, name, text)


@pytest.mark.parametrize("command", ["run", "cockpit"])
def test_a_run_names_what_it_got(command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In processes of their own, so that all kinds but one are left to what they share with `check`."""
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:1")
    (tmp_path / "file.yaml").write_bytes(CONTENTS["a PLY mesh"])
    done = subprocess.run(
        [sys.executable, "-m", "ligature", command, "file.yaml"],
        cwd=tmp_path, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert done.returncode == 2 and "'file.yaml' is a PLY mesh, not a scene file; " in done.stdout


@pytest.mark.parametrize("text", ["bodies: []", "world config: x", "{a: 1}", "environment: {}"])
def test_inertia_of_a_file_without_bodies_gives_the_reason(text: str, tmp_path: Path) -> None:
    assert "give a mesh or a model" in printed(tmp_path, "inertia", "file.yaml", text.encode())
