"""OBJ files beyond the plain ones: odd line ends, repeated corners, statements without effect, size."""

from __future__ import annotations

import time
from itertools import cycle
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ligature.adf import Resolver, Severity
from ligature.mesh import Mesh, MeshError, load_mesh

POINTS = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


@pytest.fixture
def read(tmp_path: Path):
    def make(content: str | bytes) -> Mesh:
        (tmp_path / "m.obj").write_bytes(content if isinstance(content, bytes) else content.encode())
        return load_mesh(tmp_path / "m.obj", Resolver([tmp_path]))

    return make


def test_polygons_become_fans(read) -> None:
    (part,) = read(POINTS + "f 1 2 3 4\n").parts
    assert part.vertices[part.faces].tolist() == part.vertices[[[0, 1, 2], [0, 2, 3]]].tolist()
    assert part.normals is None and part.uvs is None


def test_vertices_are_the_distinct_corners(read) -> None:
    (part,) = read(POINTS + "vt 0 0\nvt 1 0\nf 1/1 2/1 3/1\nf 1/1 3/1 4/1\nf 1/2 3/1 4/1\n").parts
    assert len(part.vertices) == 5
    assert part.uvs is not None and part.uvs.tolist() == [[0, 0]] * 4 + [[1, 0]]


def test_normals_that_some_corner_lacks_are_left_out(read) -> None:
    (part,) = read(POINTS + "vn 0 0 1\nf 1//1 2//1 3//1\nf 1 3 4\n").parts
    assert part.normals is None and len(part.faces) == 2


BLANKS = st.sampled_from([" ", "  ", "\t", " \\\n"])
ENDS = st.sampled_from(["\n", "\r\n", "\r", " \n"])


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(BLANKS, min_size=1, max_size=7), st.lists(ENDS, min_size=1, max_size=7), st.sampled_from(["", "\ufeff"])
)
def test_line_ends_and_blanks_of_every_kind(read, blanks: list[str], ends: list[str], mark: str) -> None:
    blank, end = cycle(blanks), cycle(ends)
    text = "".join({" ": next(blank), "\n": "\n"}.get(letter, letter) for letter in POINTS + "f 1 2 3 4\n")
    mesh = read(mark + "".join(next(end) if letter == "\n" else letter for letter in text))
    assert len(mesh.parts[0].faces) == 2 and not mesh.diagnostics


def test_lines_of_a_continued_file_keep_their_numbers(read) -> None:
    with pytest.raises(MeshError, match=r"m.obj:7:1: error: a face names vertex 9"):
        read(POINTS + "f 1 2 \\\n3 4\nf 1 2 \\\n 9\n")


def test_faces_before_their_vertices_are_errors(read) -> None:
    with pytest.raises(MeshError, match=r"m.obj:1:1: error: a face names vertex 1, but 0 are defined so far"):
        read("f 1 2 3\n" + POINTS)


@pytest.mark.parametrize("word", ["1" * 40, "1/2/3/4", "/1", "1/x", "--1", "1.0"])
def test_corners_that_are_none(read, word: str) -> None:
    with pytest.raises(MeshError, match=r"m.obj:5:1: error: '.*' is not a face corner; write v, v/vt"):
        read(POINTS + f"f 1 2 {word}\n")


def test_a_vertex_that_is_not_finite_is_found_where_it_is(read) -> None:
    with pytest.raises(MeshError, match=r"m.obj:2:1: error: a vertex is not finite; export the mesh again"):
        read("v 0 0 0\nv 0 nan 0\nv 1 1 1\nf 1 2 3\n")


def test_normals_that_are_not_finite_are_left_out_with_a_warning(read) -> None:
    mesh = read(POINTS + "vn nan 0 0\nf 1//1 2//1 3//1\n")
    assert mesh.parts[0].normals is None
    assert "the normals hold nan or inf and are left out" in str(mesh.diagnostics[0])


def test_statements_that_are_not_read_are_warnings_once_each(read) -> None:
    mesh = read(POINTS + "# a comment\no a\ng b\ns off\nl 1 2\ncurv 0 1\ncurv 0 1\nnonsense\nf 1 2 3\n")
    assert [(d.severity, d.message, d.mark.line) for d in mesh.diagnostics if d.mark] == [
        (Severity.WARNING, "'curv' is not a statement that is read", 10),
        (Severity.WARNING, "'nonsense' is not a statement that is read", 12),
    ]


def test_a_file_of_garbage_gives_few_findings(read) -> None:
    rng = np.random.default_rng(0)
    words = "\n".join("".join(chr(97 + c) for c in rng.integers(0, 26, 8)) for _ in range(5000))
    assert len(read(POINTS + words).diagnostics) == 50


def test_a_mesh_without_faces_is_its_vertices(read) -> None:
    (part,) = read(POINTS).parts
    assert len(part.vertices) == 4 and len(part.faces) == 0


def test_a_file_without_vertices_is_an_error(read) -> None:
    with pytest.raises(MeshError, match="m.obj:1:1: error: the file holds no vertex"):
        read("o nothing\n")


def test_a_hundred_thousand_triangles_take_less_than_seconds(read) -> None:
    n = 224
    x, y = np.meshgrid(np.arange(n), np.arange(n))
    lines = [f"v {a} {b} 0" for a, b in zip(x.ravel(), y.ravel(), strict=True)]
    first = (np.arange(n - 1)[:, None] * n + np.arange(n - 1) + 1).ravel()
    lines += [f"f {a} {a + 1} {a + n + 1} {a + n}" for a in first]
    begin = time.process_time()
    (part,) = read("\n".join(lines)).parts
    assert len(part.faces) == 2 * (n - 1) ** 2
    assert time.process_time() - begin < 3.0  # 0.2 s when nothing else runs


@pytest.mark.parametrize("words", ["", "1", "1 2"])
def test_a_face_with_too_few_corners_is_left_out(read, words: str) -> None:
    mesh = read(POINTS + f"f {words}\nf 1 2 3\n")
    assert len(mesh.parts[0].faces) == 1
    assert [(d.severity, d.message) for d in mesh.diagnostics] == [
        (Severity.WARNING, "a face has fewer than 3 vertices and is left out")
    ]


@pytest.mark.parametrize("count", [256, 257, 2000])
def test_a_cap_of_many_corners_is_a_fan(read, count: int) -> None:
    """CAD exports close a fine cylinder by one face."""
    angles = 2 * np.pi * np.arange(count) / count
    lines = [f"v {x:.9f} {y:.9f} 0" for x, y in zip(np.cos(angles), np.sin(angles), strict=True)]
    mesh = read("\n".join([*lines, "f " + " ".join(map(str, range(1, count + 1)))]))
    corners = mesh.parts[0].vertices[mesh.parts[0].faces]
    area = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2].sum()
    assert area == pytest.approx(0.5 * count * np.sin(2 * np.pi / count))
    assert [d.message for d in mesh.diagnostics] == [
        f"a face has {count} vertices; the reference reads at most 256" for _ in range(count > 256)
    ]
