"""A camera of any numbers either shows a picture or is left out with an error: none stays black or stops a drawing."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.adf import Severity
from ligature.adf.schema import SCHEMA, Key, Status, Type
from ligature.model.scene import Scene
from ligature.render.camera import projection_matrix

NUMBERS = st.sampled_from((0.0, -0.0, -1.0, 1e-9, 1e-3, 0.5, 3.15, 90.0, 1e5, 1e11)) | st.floats(-10.0, 10.0)
COUNTS = st.sampled_from((0, 1, 2, 640, 10**5, 10**9))
MATRICES = st.lists(st.lists(NUMBERS, min_size=4, max_size=4), min_size=4, max_size=4)
KEYS = [
    key for key in SCHEMA["camera"]
    if key.status is Status.USED and key.type in (Type.NUMBER, Type.UNSIGNED, Type.VECTOR, Type.MATRIX)
]  # fmt: skip


def values(key: Key) -> st.SearchStrategy[str]:
    if key.type is Type.VECTOR:
        return st.tuples(NUMBERS, NUMBERS, NUMBERS).map(lambda v: f"{{x: {v[0]}, y: {v[1]}, z: {v[2]}}}")
    return {Type.NUMBER: NUMBERS, Type.UNSIGNED: COUNTS, Type.MATRIX: MATRICES}[key.type].map(str)


@st.composite
def cameras(draw: st.DrawFn) -> str:
    """The keys of a camera: some of those of the schema, blocks with all of theirs."""
    entries = []
    for block in draw(st.sets(st.sampled_from(sorted({key.block or key.path for key in KEYS})), max_size=4)):
        inner = [key for key in KEYS if key.block == block]
        if inner:
            text = ", ".join(f"{key.name}: {draw(values(key))}" for key in inner)
            entries.append(f"{block}: {{{text}{', mode: passive' if block == 'stereo' else ''}}}")
        else:
            entries.append(f"{block}: {draw(values(next(key for key in KEYS if key.path == block)))}")
    return "{name: eye, " + ", ".join(entries) + "}"


def load(folder: Path, camera: str) -> Scene:
    body = "BODY B: {name: B, mass: 0.0, collision shape: SPHERE, collision geometry: {radius: 0.1}}"
    file = folder / "model.yaml"
    file.write_text(f"bodies: [BODY B]\ncameras: [eye]\nnamespace: /n/\n{body}\neye: {camera}\n")
    return ligature.load(file)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("cameras")


@given(cameras())
@settings(max_examples=60, deadline=None)
def test_a_camera_projects_or_is_left_out_with_an_error(folder: Path, text: str) -> None:
    scene = load(folder, text)
    if not scene.cameras:
        assert any(finding.severity is Severity.ERROR and "'eye'" in finding.message for finding in scene.diagnostics)
        return
    (camera,) = scene.cameras
    assert 0.0 < camera.near < camera.far
    assert min(camera.resolution) >= 1
    for eye in ("left", "right") if camera.stereo else ("",):
        projection = projection_matrix(camera, 64, 48, eye)
        assert np.isfinite(projection).all() and np.linalg.det(projection) != 0.0


@pytest.mark.parametrize(
    "planes", ["{near: 0.0, far: 10}", "{near: -1, far: 10}", "{near: 5, far: 5}", "{near: 9, far: 1}"]
)
def test_clipping_planes_that_enclose_nothing_are_those_of_chai3d(tmp_path: Path, planes: str) -> None:
    scene = load(tmp_path, f"{{name: eye, clipping plane: {planes}}}")
    assert (scene.cameras[0].near, scene.cameras[0].far) == (0.1, 1000.0)
    (finding,) = [d for d in scene.diagnostics if "clipping" in d.message]
    assert finding.hint == "give 0 < near < far; 0.1 m and 1000 m are taken"
