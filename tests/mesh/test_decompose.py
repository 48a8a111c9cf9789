"""Convex decomposition: pieces that fill the solid, the same in every run, kept, and given up in time."""

from __future__ import annotations

import logging
import os
import resource
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from ligature.adf import Resolver
from ligature.mesh import Mesh, MeshPart, collision_parts, combined, hull_properties, load_mesh
from ligature.mesh import decompose as module
from ligature.mesh.decompose import DecompositionError, convex_pieces, decompose, obj_text
from ligature.mesh.surface import convex_surface
from ligature.process import end_with_parent

from tests.mesh.shapes import CUBE, ell
from tests.waiting import until


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("LIGATURE_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def mesh() -> Mesh:
    return Mesh(Path("/ell.obj"), (MeshPart("", *ell()),))


def test_an_ell_is_two_boxes(mesh: Mesh) -> None:
    found = decompose(mesh)
    assert len(found.hulls) == 2
    assert found.volume_error is not None and found.volume_error < 1e-3
    assert found.distance < 1e-5  # of 2 cm
    assert combined([hull_properties(hull) for hull in found.hulls]).volume == pytest.approx(3e-6, rel=1e-3)


def test_the_same_mesh_gives_the_same_pieces_without_the_cache(
    mesh: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = decompose(mesh)
    monkeypatch.setenv("LIGATURE_CACHE", str(tmp_path / "another"))
    second = decompose(mesh)
    assert [h.tobytes() for h in first.hulls] == [h.tobytes() for h in second.hulls]
    assert (first.volume_error, first.distance) == (second.volume_error, second.distance)


def test_pieces_are_kept_and_a_damaged_file_is_made_again(
    mesh: Mesh, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs: list[float] = []
    run = module._run_coacd
    monkeypatch.setattr(module, "_run_coacd", lambda *a: (runs.append(a[2]), run(*a))[1])
    first = decompose(mesh)
    decompose(mesh)
    assert len(runs) == 1
    (kept,) = (cache / "decomposition").iterdir()
    kept.write_bytes(kept.read_bytes()[:100])
    assert [h.tobytes() for h in decompose(mesh).hulls] == [h.tobytes() for h in first.hulls]
    assert len(runs) == 2


def test_the_text_is_a_collision_mesh_of_as_many_hulls(mesh: Mesh, tmp_path: Path) -> None:
    hulls = decompose(mesh).hulls
    text, library = obj_text(hulls, "ell.mtl")
    (tmp_path / "ell.obj").write_text(text)
    (tmp_path / "ell.mtl").write_text(library)
    again = load_mesh(tmp_path / "ell.obj", Resolver([tmp_path]))
    assert not again.diagnostics and [part.name for part in again.parts] == ["part_000", "part_001"]
    for piece, hull in zip(collision_parts(again, "hull"), hulls, strict=True):
        assert np.array_equal(np.unique(piece.vertices, axis=0), np.unique(hull, axis=0))


def test_a_moving_mesh_that_is_convex_stays_one_hull() -> None:
    faces = np.array([[0, 1, 3], [0, 3, 2], [4, 7, 5], [4, 6, 7], [0, 5, 1], [0, 4, 5], [2, 3, 7], [2, 7, 6],
                      [0, 2, 6], [0, 6, 4], [1, 7, 3], [1, 5, 7]], dtype=np.int32)  # fmt: skip
    assert [len(piece) for piece in convex_pieces(CUBE, faces)] == [8]


@pytest.mark.parametrize("missing", [0, 1], ids=["closed", "open"])
def test_a_moving_mesh_that_is_concave_leaves_its_notch_free(missing: int) -> None:
    vertices, faces = ell()
    notch = np.array([0.016, 0.016, 0.005])
    pieces = convex_pieces(vertices, faces[missing:])
    assert len(pieces) > 1
    assert not any((notch > piece.min(axis=0)).all() and (notch < piece.max(axis=0)).all() for piece in pieces)


def test_a_flat_moving_mesh_is_its_outline() -> None:
    vertices, faces = ell()
    assert len(convex_pieces(vertices[:6], faces[:4])[0]) == 5


def star(points: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A closed surface with spikes: CoACD takes long for it."""
    rng = np.random.default_rng(seed)
    places = rng.normal(size=(points, 3))
    places /= np.linalg.norm(places, axis=1, keepdims=True)
    _, faces = convex_surface(places)
    return places * rng.uniform(0.3, 1.0, (points, 1)), faces


def test_when_coacd_hangs_the_hull_stands_in_and_a_warning_reports_it(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(module, "CPU_LIMIT", 1)
    with caplog.at_level(logging.WARNING):
        (_piece,) = convex_pieces(*star(900), "/star.obj")
    assert "/star.obj collides as its convex hull: CoACD took longer than 1 s of processor time" in caplog.text
    assert "run 'ligature decompose' on it" in caplog.text


corner = st.floats(-1.0, 1.0, width=32)


@st.composite
def surfaces(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray]:
    """Surfaces of any kind: open, flat, in one line, of one place, tiny, huge, doubled, inside out, or a cube's rest."""
    if draw(st.booleans()):
        vertices, faces = convex_surface(CUBE)
        faces = faces[: draw(st.integers(1, 5))]
    else:
        vertices = np.array(draw(st.lists(st.tuples(corner, corner, corner), min_size=3, max_size=7)))
        three = st.lists(st.integers(0, len(vertices) - 1), min_size=3, max_size=3, unique=True)
        faces = np.array(draw(st.lists(three, min_size=1, max_size=3)))
    if draw(st.booleans()):
        faces = np.vstack([faces, faces[:, ::-1]])
    axes = np.array(draw(st.sampled_from([(1, 1, 1)] * 3 + [(1, 1, 0), (1, 0, 0), (0, 0, 0), (1, 1, 1e-7)])))
    size = draw(st.sampled_from([1e-9, 1e-3, 1.0, 1e9]))
    return vertices * axes * size, faces.astype(np.int32)


@settings(
    max_examples=5,
    phases=(Phase.explicit, Phase.generate),
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(surfaces())
def test_any_surface_is_decomposed_or_refused_within_its_budget(surface: tuple[np.ndarray, np.ndarray]) -> None:
    """CoACD's own settings had not ended after 28 s of processor time for a cube that lacks a third of its triangles."""
    vertices, faces = surface
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    with suppress(DecompositionError):
        found = decompose(Mesh(Path("/surface.obj"), (MeshPart("", vertices, faces),)), 0.1)
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        margin = 0.1 * (high - low).max()
        for hull in found.hulls:
            assert (hull >= low - margin).all() and (hull <= high + margin).all()
    assert resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before < 60.0


def test_many_separate_pieces_of_surface_are_refused_with_their_number() -> None:
    corners, box = convex_surface(CUBE)
    boxes = np.vstack([corners + [0.0, 0.0, 3.0 * k] for k in range(300)])
    faces = np.vstack([box + len(corners) * k for k in range(300)])
    with pytest.raises(DecompositionError, match="has 300 separate pieces of surface, more than 256"):
        decompose(Mesh(Path("/boxes.obj"), (MeshPart("", boxes, faces.astype(np.int32)),)))


@pytest.mark.parametrize(("threshold", "text"), [(0.0, "threshold is 0; it must be from 0.01 to 1"), (2.0, "is 2;")])
def test_thresholds_out_of_range_are_rejected(mesh: Mesh, threshold: float, text: str) -> None:
    with pytest.raises(DecompositionError, match=text):
        decompose(mesh, threshold)


def test_a_mesh_without_triangles_is_refused() -> None:
    with pytest.raises(DecompositionError, match="the mesh holds no triangle"):
        decompose(Mesh(Path("/m.obj"), ()))


LONG_WORK = """
import io, json
import numpy as np
from scipy.spatial import ConvexHull
from ligature.mesh.decompose import _run_coacd
rng = np.random.default_rng(0)
points = rng.normal(size=(900, 3))
points /= np.linalg.norm(points, axis=1, keepdims=True)
faces = ConvexHull(points).simplices
stored = io.BytesIO()
np.savez(stored, vertices=points * rng.uniform(0.3, 1.0, (900, 1)), faces=faces.astype(np.int32))
_run_coacd(stored.getvalue(), json.dumps({"threshold": 0.01, "mcts_iterations": 2000, "resolution": 10000}), "mesh")
"""


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_coacd_ends_with_the_process_that_waits_for_it_and_leaves_no_file(number: int, tmp_path: Path) -> None:
    environment = os.environ | {"TMPDIR": str(tmp_path)}
    waiting = subprocess.Popen([sys.executable, "-c", LONG_WORK], preexec_fn=end_with_parent, env=environment)
    try:
        worker = until(lambda: _worker_of(waiting.pid), "the worker runs", 60.0)
    finally:
        waiting.send_signal(number)
        waiting.wait()
    until(lambda: not _lives(worker), "the worker ends", 60.0)
    assert not list(tmp_path.iterdir())


def _worker_of(parent: int) -> int | None:
    """The process of CoACD that ``parent`` has started, once it is Python's and no longer a copy of the parent."""
    for child in Path(f"/proc/{parent}/task/{parent}/children").read_text().split():
        with suppress(OSError):
            if b"coacd_process" in Path(f"/proc/{child}/cmdline").read_bytes():
                return int(child)
    return None


def _lives(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except (FileNotFoundError, ProcessLookupError):
        return False


@pytest.mark.parametrize("lasting", [True, False])
def test_a_failure_is_kept_with_its_reason_when_another_try_would_end_the_same(
    lasting: bool, cache: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    runs = []

    def fail(*arguments: object) -> bytes:
        runs.append(arguments)
        raise DecompositionError("CoACD chokes", lasting)

    monkeypatch.setattr(module, "_run_coacd", fail)
    for _ in range(2):
        caplog.clear()
        assert len(convex_pieces(*ell(), "/ell.obj")) == 1
        assert "/ell.obj collides as its convex hull: CoACD chokes" in caplog.text
    assert len(runs) == (1 if lasting else 2)
    assert ("in an earlier run" in caplog.text) == lasting
    assert len(list(cache.rglob("*.txt"))) == lasting
    convex_pieces(ell()[0] * 2.0, ell()[1], "/larger.obj")
    assert len(runs) == (2 if lasting else 3)


@pytest.mark.parametrize(
    ("code", "lasting"),
    [
        ("import os, signal; os.kill(os.getpid(), signal.SIGKILL)", False),
        ("raise MemoryError", False),
        ("import no_such_module", False),
        ("import os; os.abort()", True),
        ("raise RuntimeError('not a manifold')", True),
    ],
)
def test_only_what_the_mesh_causes_lasts(code: str, lasting: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    wait = module._wait
    monkeypatch.setattr(module, "_wait", lambda command, *rest: wait([command[0], "-c", code], *rest))
    with pytest.raises(DecompositionError, match="CoACD ended with status") as found:
        module._run_coacd(b"", "{}", "/ell.obj")
    assert found.value.lasting == lasting


def test_a_decomposition_that_takes_long_is_reported_while_it_lasts(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(module, "PROGRESS_SECONDS", 0.01)
    with caplog.at_level(logging.WARNING):
        convex_pieces(*ell(), "/ell.obj")
    assert "still decomposing /ell.obj after" in caplog.text


@pytest.mark.parametrize("seed", range(3))
def test_a_fine_mesh_is_simplified_to_the_same_shape_and_bits(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, most = int(rng.integers(40, 80)), int(rng.integers(500, 3000))
    u, v = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    around, tube = 2 * np.pi * u / n, 2 * np.pi * v / n
    out = 0.03 + 0.01 * np.cos(tube)
    ring = np.stack([out * np.cos(around), out * np.sin(around), 0.01 * np.sin(tube)], axis=-1).reshape(-1, 3)
    at = u * n + v, (u + 1) % n * n + v, (u + 1) % n * n + (v + 1) % n, u * n + (v + 1) % n
    faces = np.concatenate([np.stack([at[i].ravel() for i in k], axis=1) for k in ((0, 1, 2), (0, 2, 3))])
    faces = faces.astype(np.int32)
    points, corners = module.simplified(ring, faces, most)
    assert most // 4 < len(corners) <= most
    assert corners.dtype == np.int32 and corners.max() < len(points)
    again = module.simplified(ring, faces, most)
    assert points.tobytes() == again[0].tobytes() and corners.tobytes() == again[1].tobytes()
    # every vertex is close to the ring's surface, and its hole stays open
    off = np.abs(np.hypot(np.hypot(points[:, 0], points[:, 1]) - 0.03, points[:, 2]) - 0.01)
    assert off.max() < 0.004
    assert module.simplified(ring, faces, len(faces))[1] is faces
