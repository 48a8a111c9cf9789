"""Needles: any arc is fitted, and slender short open arcs of shapes are needles with their tip away from the thread."""

from __future__ import annotations

import math
from pathlib import Path

import ligature
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature.adf import Severity
from ligature.model.frames import rpy_matrix
from ligature.model.needles import LONGEST, SLENDER, WIDEST_TURN, fit_arc
from ligature.model.piercing import Needle
from ligature.model.scene import Scene
from scipy.spatial import ConvexHull

from tests.model.test_load import chain

ANGLES = st.tuples(*[st.floats(-3.0, 3.0)] * 3)


@given(
    ANGLES, st.tuples(*[st.floats(-0.1, 0.1)] * 3), st.floats(0.002, 0.1), st.floats(0.5, float(WIDEST_TURN)), st.integers(3, 20),
    st.booleans(),
)  # fmt: skip
def test_the_points_of_an_arc_give_the_arc(
    turned: tuple[float, ...], centre: tuple[float, ...], radius: float, turn: float, count: int, reverse: bool
) -> None:
    angles = np.linspace(0.0, turn, count)[:: -1 if reverse else 1]
    flat = radius * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(count)])
    points = flat @ rpy_matrix(*turned).T + centre
    arc = fit_arc(points)
    assert arc.radius == pytest.approx(radius, rel=1e-6)
    np.testing.assert_allclose(arc.centre, centre, atol=1e-6 * radius)
    assert arc.length == pytest.approx(radius * turn, rel=1e-6)
    np.testing.assert_allclose(arc.point(0.0), points[-1], atol=1e-6 * radius)
    np.testing.assert_allclose(arc.point(arc.length), points[0], atol=1e-6 * radius)


@pytest.mark.parametrize(("count", "words"), [(2, "needs three points"), (5, "not on one line")])
def test_points_that_make_no_arc_are_refused(count: int, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        fit_arc(np.outer(np.arange(count), [1.0, 2.0, 3.0]))


def loaded(
    folder: Path, radius: float, turn: float, keys: str = "mass: 0.001", size: float = 0.0, more: str = ""
) -> Scene:
    """A body of 40 balls along an arc in its xy plane, from angle 0 on; one also lies ``size`` above and below it."""
    items = []
    for k, angle in enumerate(np.linspace(0.0, turn, 40)):
        at = f"x: {radius * math.cos(angle):.9f}, y: {radius * math.sin(angle):.9f}"
        items += [
            f"{{shape: SPHERE, geometry: {{radius: 0.0001}}, offset: {{position: {{{at}, z: {z}}}}}}}"
            for z in ({-size, 0.0, size} if k == 20 else {0.0})
        ]
    joints = "joints: [J]\n" + more if more else ""
    text = f"bodies: [N, T]\n{joints}N: {{name: n, {keys}, inertial offset: {{}}, compound collision shape: [{', '.join(items)}]}}\n"
    (folder / "m.yaml").write_text(text + "T: {name: t, mass: 1}\n")
    return ligature.load(folder / "m.yaml")


def needles(folder: Path, *shape: float, **more: object) -> tuple[Needle, ...]:
    return loaded(folder, *shape, **more).needles  # type: ignore[arg-type]


@pytest.mark.parametrize("share", [0.97, 1.03])
def test_a_needle_is_slender_short_and_open(tmp_path: Path, share: float) -> None:
    assert bool(needles(tmp_path, 0.01, share * WIDEST_TURN)) is (share < 1.0)
    assert bool(needles(tmp_path, share * LONGEST / 2.0, 2.0)) is (share < 1.0)
    assert bool(needles(tmp_path, 0.01, 2.0, size=share * 0.02 / SLENDER - 0.0001)) is (share < 1.0)


@pytest.mark.parametrize(
    ("keys", "found"),
    [
        ("mass: 0.001", True),
        ("mass: 0", False),
        ("mass: 0.001, ligature needle: false", False),
        ("mass: 0.001, ligature needle: true", True),
    ],
)
def test_a_fixed_body_or_one_that_opts_out_is_none(tmp_path: Path, keys: str, found: bool) -> None:
    scene = loaded(tmp_path, 0.01, 2.0, keys)
    assert [needle.body for needle in scene.needles] == [0] * found
    reported = [d for d in scene.diagnostics if d.code == "needle"]
    assert [d.message for d in reported] == ["'N' is a needle, 20.0 mm long, radius 10.0 mm"] * found


def test_a_body_that_a_joint_holds_is_none(tmp_path: Path) -> None:
    frames = "parent pivot: {x: 0, y: 0, z: 0}, child pivot: {x: 0, y: 0, z: 0}, parent axis: {x: 0, y: 0, z: 1}, child axis: {x: 0, y: 0, z: 1}"
    joint = f"J: {{name: j, type: revolute, parent: T, child: N, {frames}}}\n"
    assert needles(tmp_path, 0.01, 2.0, more=joint) == ()


@pytest.mark.parametrize("at_end", [False, True])
@pytest.mark.parametrize("parent", [False, True])
def test_the_tip_is_away_from_the_thread(tmp_path: Path, at_end: bool, parent: bool) -> None:
    turn = 2.0
    ends = np.array([[0.01 * math.cos(angle), 0.01 * math.sin(angle), 0.0] for angle in (0.0, turn)])
    x, y, _ = tail = ends[int(at_end)]
    file = tmp_path / "m.yaml"
    loaded(tmp_path, 0.01, turn)
    needle = [line for line in file.read_text().splitlines() if line.startswith("N:")][0]
    thread = chain().replace("bodies: [", "bodies: [N, ").replace("joints: [", "joints: [JN, ")
    for k in range(5):
        old = f"position: {{x: 0, y: 0, z: {0.01 * k}}}"
        thread = thread.replace(old, f"position: {{x: {x:.6f}, y: {y:.6f}, z: {0.01 * k + 0.005}}}")
    places = [f"{{x: {x:.6f}, y: {y:.6f}, z: 0}}", "{x: 0, y: 0, z: -0.005}"]
    one, two = ("N", "T0") if parent else ("T0", "N")
    first, second = places if parent else reversed(places)
    joint = (
        f"JN: {{name: jn, type: fixed, parent: {one}, child: {two}, parent pivot: {first}, child pivot: {second}, "
        "parent axis: {x: 0, y: 0, z: 1}, child axis: {x: 0, y: 0, z: 1}}\n"
    )
    file.write_text(f"{thread}{needle}\n{joint}")
    scene = ligature.load(file)
    assert len(scene.rods) == 1
    (found,) = scene.needles
    np.testing.assert_allclose(found.arc.point(found.arc.length), tail, atol=1e-5)
    np.testing.assert_allclose(found.arc.point(0.0), ends[int(not at_end)], atol=1e-5)
    assert found.arc.begin < found.arc.end


@pytest.mark.parametrize(
    "shape",
    [
        "shape: CAPSULE, geometry: {radius: 0.0002, height: 0.002, axis: X}",
        "shape: CYLINDER, geometry: {radius: 0.0002, height: 0.002, axis: X}",
        "shape: BOX, geometry: {x: 0.002, y: 0.0004, z: 0.0004}",
    ],
)
def test_a_shape_counts_by_its_middle_line(tmp_path: Path, shape: str) -> None:
    """Ten shapes of 2 mm along 20 mm of an arc: what they reach beyond it, and beside it, is small."""
    items = ", ".join(
        f"{{{shape}, offset: {{position: {{x: {0.01 * math.cos(a):.9f}, y: {0.01 * math.sin(a):.9f}, z: 0}}, "
        f"orientation: {{r: 0, p: 0, y: {a + math.pi / 2:.9f}}}}}}}"
        for a in np.arange(0.1, 2.0, 0.2)
    )
    (tmp_path / "m.yaml").write_text(
        f"bodies: [N]\nN: {{name: n, mass: 0.001, inertial offset: {{}}, compound collision shape: [{items}]}}\n"
    )
    (needle,) = ligature.load(tmp_path / "m.yaml").needles
    assert needle.arc.length == pytest.approx(0.02, rel=0.01)
    assert needle.arc.radius == pytest.approx(0.01, rel=0.01)


# --- what is none, and what is one -------------------------------------------------------------

SIZES = st.floats(0.0005, 0.03)
POSES = st.tuples(ANGLES, st.tuples(*[st.floats(-0.1, 0.1)] * 3))
"""Angles and a shift, by which a shape is turned and moved in its body."""


def _compound(*items: str) -> str:
    return f"compound collision shape: [{', '.join(items)}]"


def _item(shape: str, pose: tuple[tuple[float, ...], tuple[float, ...]] = ((0.0,) * 3, (0.0,) * 3)) -> str:
    (r, p, y), (x0, y0, z0) = pose
    angles, place = f"{{r: {r:.9f}, p: {p:.9f}, y: {y:.9f}}}", f"{{x: {x0:.9f}, y: {y0:.9f}, z: {z0:.9f}}}"
    return f"{{{shape}, offset: {{position: {place}, orientation: {angles}}}}}"


def _mesh(vertices: np.ndarray, faces: np.ndarray) -> str:
    """Text of an OBJ file."""
    lines = [f"v {x:.9f} {y:.9f} {z:.9f}" for x, y, z in vertices.tolist()]
    return "\n".join(lines + [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]) + "\n"


def _tube(radius: float, thickness: float, turn: float, count: int, around: int = 8) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of a round wire along an arc, closed at both ends; a turn of 2 pi is a ring."""
    closed = turn > 2.0 * math.pi - 1e-9
    angles = np.linspace(0.0, turn, count + 1)[: count if closed else None]
    across = 2.0 * np.pi * np.arange(around) / around
    out = radius + 0.5 * thickness * np.cos(across)
    rings = [np.column_stack([np.cos(a) * out, np.sin(a) * out, 0.5 * thickness * np.sin(across)]) for a in angles]
    vertices, m, faces = np.vstack(rings), len(rings), []
    for i in range(m if closed else m - 1):
        for k in range(around):
            a, b = i * around + k, i * around + (k + 1) % around
            c, d = (i + 1) % m * around + k, (i + 1) % m * around + (k + 1) % around
            faces += [(a, b, d), (a, d, c)]
    if not closed:
        last = (m - 1) * around
        faces += [(0, k + 1, k) for k in range(1, around - 1)]
        faces += [(last, last + k, last + k + 1) for k in range(1, around - 1)]
    return vertices, np.array(faces)


def _found(tmp_path_factory: pytest.TempPathFactory, shape: str, mesh: str = "") -> tuple[Needle, ...]:
    folder = tmp_path_factory.mktemp("needle")
    (folder / "n.obj").write_text(mesh)
    (folder / "m.yaml").write_text(f"bodies: [N]\nN: {{name: n, mass: 0.001, {shape}}}\n")
    return ligature.load(folder / "m.yaml").needles


@pytest.mark.parametrize(
    "size",
    [(10, 10, 20), (5, 5, 10), (10, 5, 5), (20, 10, 5), (5, 5, 12), (20, 1, 1), (30, 20, 1), (1, 1, 60), (10, 10, 10)],
)
def test_a_box_is_none(tmp_path_factory: pytest.TempPathFactory, size: tuple[int, ...]) -> None:
    x, y, z = (1e-3 * edge for edge in size)
    box = f"collision shape: BOX, collision geometry: {{x: {x}, y: {y}, z: {z}}}"
    assert not _found(tmp_path_factory, box)


@given(st.sampled_from(["BOX", "CYLINDER", "CAPSULE", "CONE", "SPHERE"]), SIZES, SIZES, SIZES, POSES)
def test_no_primitive_is_a_needle(
    tmp_path_factory: pytest.TempPathFactory,
    kind: str,
    x: float,
    y: float,
    z: float,
    pose: tuple[tuple[float, ...], ...],
) -> None:
    geometry = f"shape: {kind}, geometry: {{x: {x}, y: {y}, z: {z}, radius: {x}, height: {z}}}"
    assert not _found(tmp_path_factory, _compound(_item(geometry, pose)))  # type: ignore[arg-type]


@given(
    st.lists(st.tuples(*[st.floats(-1.0, 1.0)] * 3), min_size=5, max_size=12), st.tuples(SIZES, SIZES, SIZES),
    st.sampled_from(["CONVEX_HULL", "CONCAVE_MESH"]),
)  # fmt: skip
def test_no_convex_mesh_is_a_needle(
    tmp_path_factory: pytest.TempPathFactory, points: list[tuple[float, ...]], size: tuple[float, ...], kind: str
) -> None:
    vertices = np.array(points) * size
    try:
        faces = ConvexHull(vertices, qhull_options="QJ").simplices
    except Exception:  # too flat for a hull: a mesh of one triangle will do
        faces = np.array([[0, 1, 2]])
    assert not _found(tmp_path_factory, f"collision mesh: n.obj, collision mesh type: {kind}", _mesh(vertices, faces))


@given(st.floats(0.003, 0.015), st.floats(2e-4, 2e-3), st.floats(0.7, 3.1), st.integers(6, 30))
def test_the_hull_of_a_needle_is_none(
    tmp_path_factory: pytest.TempPathFactory, radius: float, thickness: float, turn: float, count: int
) -> None:
    """It is convex, and would lie across the arc: only the wire itself is thin."""
    mesh = _mesh(*_tube(radius, min(thickness, radius / 4.0), turn, count))
    assert not _found(tmp_path_factory, "collision mesh: n.obj, collision mesh type: CONVEX_HULL", mesh)


@given(st.floats(0.002, 0.02), st.floats(0.002, 0.02), st.floats(2e-4, 3e-3), st.booleans(), POSES)
def test_no_angle_and_no_bracket_is_a_needle(
    tmp_path_factory: pytest.TempPathFactory,
    width: float,
    leg: float,
    thick: float,
    u: bool,
    pose: tuple[tuple[float, ...], ...],
) -> None:
    """L and U of bars, at right angles."""
    turn = rpy_matrix(*pose[0])

    def bar(x: float, y: float, places: tuple[float, float]) -> str:
        place = turn @ [*places, 0.0] + pose[1]
        return _item(f"shape: BOX, geometry: {{x: {x}, y: {y}, z: {thick}}}", (pose[0], tuple(place)))

    bars = [bar(width + thick, thick, (0.0, 0.0)), bar(thick, leg, (-0.5 * width, 0.5 * leg))]
    bars += [bar(thick, leg, (0.5 * width, 0.5 * leg))] * u
    assert not _found(tmp_path_factory, _compound(*bars))


@given(st.floats(0.003, 0.03), st.floats(2e-4, 2e-3), st.integers(12, 40), st.booleans())
def test_no_ring_and_no_tube_is_a_needle(
    tmp_path_factory: pytest.TempPathFactory, radius: float, thickness: float, count: int, tall: bool
) -> None:
    vertices, faces = _tube(radius, thickness, 2.0 * math.pi, count)
    vertices[:, 2] *= 30.0 if tall else 1.0
    assert not _found(tmp_path_factory, "collision mesh: n.obj", _mesh(vertices, faces))


@given(
    st.lists(st.tuples(st.floats(-0.02, 0.02), st.floats(-0.02, 0.02), st.just(0.0)), min_size=3, max_size=5),
    st.floats(1e-4, 5e-3),
)
def test_balls_that_lie_apart_are_none(
    tmp_path_factory: pytest.TempPathFactory, places: list[tuple[float, ...]], radius: float
) -> None:
    """An arc leads through any three points."""
    ball = f"shape: SPHERE, geometry: {{radius: {radius}}}"
    assert not _found(tmp_path_factory, _compound(*(_item(ball, ((0.0,) * 3, place)) for place in places)))


NEEDLES = st.tuples(
    st.floats(0.001, 0.02),
    st.floats(0.015, 0.05),
    st.floats(np.radians(80.0), np.radians(230.0)),
    st.integers(6, 20),
)
"""Radius in metres, thickness over radius, turn, and number of parts."""


@given(NEEDLES, POSES, st.sampled_from(["CAPSULE", "CYLINDER"]))
def test_a_wire_of_round_parts_is_a_needle(
    tmp_path_factory: pytest.TempPathFactory,
    needle: tuple[float, float, float, int],
    pose: tuple[tuple[float, ...], ...],
    kind: str,
) -> None:
    radius, share, turn, parts = needle
    each, rotation = turn / parts, rpy_matrix(*pose[0])
    items = []
    for angle in each * (np.arange(parts) + 0.5):
        z = rotation @ [-math.sin(angle), math.cos(angle), 0.0]
        place = rotation @ [radius * math.cos(angle), radius * math.sin(angle), 0.0] + pose[1]
        along = (0.0, math.acos(np.clip(z[2], -1.0, 1.0)), math.atan2(z[1], z[0]))
        height = 2.0 * radius * math.sin(0.5 * each) + share * radius
        items.append(
            _item(
                f"shape: {kind}, geometry: {{radius: {0.5 * share * radius}, height: {height}}}", (along, tuple(place))
            )
        )
    (found,) = _found(tmp_path_factory, _compound(*items))
    assert found.arc.radius == pytest.approx(radius, rel=0.06)
    assert found.arc.length == pytest.approx(radius * turn, rel=0.2)


@given(NEEDLES, POSES, st.sampled_from([1.0, 1e-3, 0.01]))
def test_a_wire_as_a_mesh_is_a_needle(
    tmp_path_factory: pytest.TempPathFactory,
    needle: tuple[float, float, float, int],
    pose: tuple[tuple[float, ...], ...],
    scale: float,
) -> None:
    radius, share, turn, parts = needle
    vertices, faces = _tube(radius, share * radius, turn, parts)
    mesh = _mesh((vertices @ rpy_matrix(*pose[0]).T + pose[1]) / scale, faces)
    (found,) = _found(tmp_path_factory, f"collision mesh: n.obj, scale: {scale}", mesh)
    assert found.arc.radius == pytest.approx(radius, rel=0.05)
    assert found.arc.length == pytest.approx(radius * turn, rel=0.05)


@pytest.mark.parametrize(
    ("keys", "reason"),
    [
        ("mass: 0.001, collision shape: BOX, collision geometry: {x: 0.01, y: 0.01, z: 0.02}", "too thick"),
        ("mass: 0.001, collision shape: CYLINDER, collision geometry: {radius: 0.001, height: 0.02}", "three points"),
        ("mass: 0, collision shape: BOX, collision geometry: {x: 0.01, y: 0.01, z: 0.02}", "its mass is 0"),
        ("mass: 0.001", "it has no collision shape"),
    ],
)
def test_a_body_that_is_to_be_one_and_is_none_is_reported(tmp_path: Path, keys: str, reason: str) -> None:
    (tmp_path / "m.yaml").write_text(f"bodies: [N]\nN: {{name: n, ligature needle: true, {keys}}}\n")
    (finding,) = [d for d in ligature.load(tmp_path / "m.yaml").diagnostics if d.code == "needle"]
    assert finding.severity is Severity.WARNING
    assert finding.message.startswith("'N' is to be a needle, but is none: ") and reason in finding.message


@pytest.mark.parametrize(
    "name",
    [
        "suturing",
        "suturing_small",
        "soft_suturing",
        "soft_closing",
        "needle_insertion",
        "needle_pick",
        "blender_suturing",
    ],
)
def test_the_needles_of_bundled_scenes_are_found(name: str) -> None:
    scene = ligature.load(name)
    assert [scene.bodies[needle.body].identity.name for needle in scene.needles] == ["Needle"]
