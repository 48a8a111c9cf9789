"""Findings that take more than one key: each rule reports what is wrong, where, and what would be right."""

from __future__ import annotations

import itertools
from pathlib import Path

import ligature
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature.adf import Resolver, Severity, read_any
from ligature.adf.reader import read_text
from ligature.adf.schema import BY_PATH, LISTS, SCHEMA, Key, Status
from ligature.adf.schema.bodies import JOINT_TYPES

JOINT = (
    "joints: [J]\nJ:\n  name: j\n  parent: A\n  child: B\n  type: {type}\n"
    "  parent pivot: {{x: 0, y: 0, z: 0}}\n  child pivot: {{x: 0, y: 0, z: 0}}\n"
    "  parent axis: {{x: 0, y: 0, z: 1}}\n  child axis: {{x: 0, y: 0, z: 1}}\n{keys}"
)
CAMERA = "environment: e.yaml\ncameras: [C]\nC:\n  name: c\n  namespace: /a/\n{keys}"
OBJECT = "{list}: [X]\nX:\n  name: x\n{keys}"


def findings(tmp_path: Path, text: str, least: Severity = Severity.DEBUG) -> str:
    (tmp_path / "m.yaml").write_text(text, encoding="utf-8")
    found = read_any(tmp_path / "m.yaml", Resolver([tmp_path])).diagnostics
    return "\n".join(str(d).split("/m.yaml:", 1)[1] for d in found if d.severity >= least)


@pytest.mark.parametrize(
    ("kind", "keys", "words"),
    [
        ("revolute", "  joint limits: {low: -1}\n", "has only 'low' of its limits, so it is unlimited"),
        ("torsion spring", "  stiffness: 1\n", "is a torsion spring without limits, which locks it"),
        (
            "cone twist",
            "  joint limits: {x: 1, y: 1}\n",
            "error: joint 'J' is a cone twist without 'z' in 'joint limits'",
        ),
        ("six dof", "  damping: 0.5\n", "is a six dof joint with one number as 'damping'; write damping: {linear:"),
        (
            "revolute",
            "  stiffness: {linear: {x: 1}}\n",
            "is a revolute joint with a block as 'stiffness'; give one number",
        ),
        (
            "fixed",
            "  joint limits: {low: -1.2, high: 1.2}\n",
            "debug: joint 'J' is fixed, so 'joint limits' has no effect",
        ),
        ("revolute", "  offset: 1\n  child offset: 2\n", "also has 'offset', which takes precedence; remove one"),
    ],
)
def test_joint_keys_that_contradict_the_type_are_reported(tmp_path: Path, kind: str, keys: str, words: str) -> None:
    assert words in findings(tmp_path, JOINT.format(type=kind, keys=keys))


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ("  look at: {x: 0, y: 0, z: 0}\n", "has no viewing direction, so it has no orientation"),
        (
            "  look at: {x: 0, y: 0, z: 1}\n",
            "'look at' must differ from 'location', and 'up' must not be parallel to the line of sight",
        ),
        (
            "  look at: {x: 1, y: 0, z: 0}\n  clipping plane: {near: 2, far: 1}\n",
            "has its near clipping plane at 2 m and its far one at 1 m; give 0 < near < far; 0.1 m and 1000 m are taken",
        ),
        (
            "  look at: {x: 1, y: 0, z: 0}\n  publish image interval: 0\n",
            "has 0 as 'publish image interval'; using 1",
        ),
    ],
)
def test_cameras_that_show_nothing_are_reported(tmp_path: Path, keys: str, words: str) -> None:
    assert words in findings(tmp_path, CAMERA.format(keys=keys))


@pytest.mark.parametrize(
    ("list_", "keys", "words"),
    [
        ("bodies", "  collision shape: BOX\n  collision geometry: {x: 1, y: 1}\n", "is a BOX without 'z' in 'collision geometry'"),
        ("bodies", "  compound collision shape: []\n", "has an empty 'compound collision shape'"),
        ("bodies", "  namespace: /a\n", "has a namespace without '/' at its end; write '/a/'"),
        ("bodies", "  publish frequency: {low: 9, high: 3}\n", "has a low publish frequency of 9 Hz, above the high one of 3 Hz"),
        ("bodies", "  plugins: [{name: p}]\n", "a plug-in of body 'X' lacks name or filename; it is left out"),
        ("sensors", "  type: proximity\n", "has no rays and is left out; add 'array', 'mesh' or 'parametric'"),
        ("sensors", "  type: contact\n  distance threshold: -1\n", "has a negative 'distance threshold'; use 0 to detect contact"),
        ("bodies", "  mass: -1\n", "'mass' of body 'X' is not usable; expected at least 0, not -1"),
    ],
)  # fmt: skip
def test_objects_that_cannot_work_are_reported(tmp_path: Path, list_: str, keys: str, words: str) -> None:
    assert words in findings(tmp_path, OBJECT.format(list=list_, keys=keys))


@pytest.mark.parametrize(
    ("kind", "owner"),
    [("bodies", True), ("cameras", False), ("lights", False), ("ghost objects", False)],
)
@pytest.mark.parametrize(("file", "python"), [("spring.py", True), ("libdrill.so", False), ("drill.dll", False)])
def test_plug_ins_are_offered_where_they_run(tmp_path: Path, kind: str, owner: bool, file: str, python: bool) -> None:
    found = findings(tmp_path, OBJECT.format(list=kind, keys=f"  plugins: [{{name: p, filename: {file}}}]\n"))
    assert ("--allow-plugins runs those in Python" in found) is (owner and python)
    assert ("has plug-ins, which are not run" in found) is not owner


@pytest.mark.parametrize("kind", ["soft body", "ghost object"])
def test_keys_of_a_body_that_became_something_else_are_known(kind: str) -> None:
    """Labs turn a body into a soft body by moving its key from one list to the other."""
    ours = {key.path.split(".")[0] for key in SCHEMA["body"] if key.status is Status.OURS}
    body = {key.path for key in SCHEMA["body"] if key.status in (Status.USED, Status.UNUSED) and not key.block}
    assert body - ours - {"shaders"} <= set(BY_PATH[kind])


@pytest.mark.parametrize("rays", ["", "  array: []\n"])
def test_a_sensor_without_rays_is_reported_once(tmp_path: Path, rays: str) -> None:
    lines = ["bodies: [B]", "sensors: [S]", "namespace: /n/", "B: {name: b, mass: 0}", "S:", "  name: s", "  parent: B"]
    flat = "  location: {x: 1, y: 0, z: 0}"
    (tmp_path / "m.yaml").write_text("\n".join([*lines, "  type: Proximity", flat, rays]))
    found = [d.message for d in ligature.load(tmp_path / "m.yaml").diagnostics if d.severity >= Severity.WARNING]
    assert sum("is left out" in message for message in found) == 1
    assert [m for m in found if "unknown" in m] == [
        "unknown keys 'location.x', 'location.y', 'location.z' in sensor 'S'"
    ]


def test_a_sound_object_draws_no_finding(tmp_path: Path) -> None:
    keys = "  mass: 1\n  namespace: /a/\n  collision shape: SPHERE\n  collision geometry: {radius: 1}\n"
    assert findings(tmp_path, OBJECT.format(list="bodies", keys=keys)) == ""


def test_a_listed_object_under_a_slightly_different_name_is_suggested(tmp_path: Path) -> None:
    assert "did you mean 'BODY arm'?" in findings(tmp_path, "bodies: [BODY Arm]\nBODY arm:\n  name: a\n  mass: 1\n")


@pytest.mark.parametrize(
    "text",
    [
        OBJECT.format(list="sensors", keys="  type: contact\n  distance threshold: 0\n"),
        JOINT.format(type="torsion spring", keys="  stiffness: 1\n  joint limits: {low: -1, high: 1}\n"),
        JOINT.format(type="revolute", keys=""),
    ],
)
def test_what_is_at_the_edge_of_a_rule_is_no_finding(tmp_path: Path, text: str) -> None:
    found = findings(tmp_path, text, Severity.WARNING)
    assert "negative" not in found and "without limits" not in found


BODY = "bodies: [X]\nX:\n  name: x\n  mass: 1\n  {line}\n"


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("color rgba: {r: 255, g: 0, b: 0, a: 1}", "body 'X' has 255 as 'color rgba.r'; colours are 0 to 1"),
        ("color components: {diffuse: {r: 0, g: -1, b: 0}, transparency: 1}", "has -1 as 'color components.diffuse.g'"),
        ("parent: BODY other", "has the parent 'BODY other', which only AMBF since October 2024 follows"),
        ("collision groups: 3", "'collision groups' of body 'X' is one value; a list was expected; write [3]"),
    ],
)
def test_values_of_a_body_that_mislead_are_reported(tmp_path: Path, line: str, words: str) -> None:
    assert words in findings(tmp_path, BODY.format(line=line), Severity.WARNING)


@pytest.mark.parametrize(
    "line",
    ["color rgba: {r: 1, g: 0, b: 0.5, a: 1}", "parent: ''", "parent:", "collision groups: []", "collision groups:"],
)
def test_values_of_a_body_that_do_not_are_not(tmp_path: Path, line: str) -> None:
    assert findings(tmp_path, BODY.format(line=line), Severity.WARNING) == ""


@pytest.mark.parametrize(
    ("word", "on"),
    [("0", False), ("1", True), ("5", True), ("[]", True), ("", True)]
    + [(form, word in ("true", "yes", "on", "y")) for word in ("true", "yes", "on", "y", "false", "no", "off", "n")
       for form in (word, word.upper(), word.capitalize(), f"'{word}'")],
)  # fmt: skip
def test_a_motor_is_off_by_every_word_for_it(tmp_path: Path, word: str, on: bool) -> None:
    bodies = "bodies: [A, B]\nA: {name: a, mass: 0}\nB: {name: b, mass: 1}\n"
    (tmp_path / "m.yaml").write_text(bodies + JOINT.format(type="revolute", keys=f"  enable motor: {word}\n"))
    assert ligature.load(tmp_path / "m.yaml").joints[0].motor_enabled is on


def reported(text: str, kind: str = "model") -> str:
    """All findings about a document, one a line."""
    return "\n".join(str(d) for d in read_text(text, Path("m.yaml"), kind).diagnostics)


VALUES = st.sampled_from([-2.0, -1.0, 0.0, 0.25, 1.0, 1.25, 2.0])


@given(VALUES, VALUES)
def test_two_numbers_are_reported_where_they_are_out_of_order(low: float, high: float) -> None:
    limits = f"  joint limits: {{low: {low}, high: {high}}}\n"
    assert ("so it is unlimited" in reported(JOINT.format(type="revolute", keys=limits))) is (low > high)
    planes = f"  look at: {{x: 1, y: 0, z: 0}}\n  clipping plane: {{near: {low}, far: {high}}}\n"
    assert ("its near clipping plane at" in reported(CAMERA.format(keys=planes), "world")) is (not 0.0 < low < high)


@given(VALUES)
def test_one_number_is_reported_where_it_is_out_of_range(value: float) -> None:
    for path in (
        "color rgba: {{r: 0, g: 0, b: {}, a: 0}}",
        "color components: {{specular: {{r: 0, g: {}, b: 0}}, transparency: 1}}",
    ):
        assert ("colours are 0 to 1" in reported(BODY.format(line=path.format(value)))) is (not 0.0 <= value <= 1.0)
    assert ("has a negative deadband" in reported(DEVICE.format(keys=f"  deadband: {value}\n"), "input devices")) is (
        value < 0
    )


DIRECTIONS = st.tuples(*[st.integers(-2, 2)] * 3)


@given(DIRECTIONS, DIRECTIONS, st.integers(-2, 2), DIRECTIONS | st.just((0, 0, 0)))
def test_a_camera_has_an_orientation_unless_it_looks_along_its_up(
    at: tuple[int, ...], ahead: tuple[int, ...], share: int, aside: tuple[int, ...]
) -> None:
    up = np.multiply(share, ahead) + aside
    vectors = {"location": at, "look at": np.add(at, ahead), "up": up}
    keys = "".join(f"  {name}: {{x: {x}, y: {y}, z: {z}}}\n" for name, (x, y, z) in vectors.items())
    aligned = not np.cross(ahead, up).any()
    assert ("has no viewing direction" in reported(CAMERA.format(keys=keys), "world")) is aligned


DEVICE = "input devices: [X]\nX:\n  hardware name: h\n{keys}"
JOINT_KINDS = sorted(set(JOINT_TYPES.values()))


@pytest.mark.parametrize("key", ["stiffness", "damping", "equilibrium point"])
@pytest.mark.parametrize("kind", JOINT_KINDS)
@pytest.mark.parametrize("block", [False, True])
def test_only_six_dof_joints_have_blocks_of_springs_and_only_springs_numbers(kind: str, key: str, block: bool) -> None:
    value = "{linear: {x: 1, y: 1, z: 1}, angular: {x: 1, y: 1, z: 1}}" if block else "1"
    found = reported(JOINT.format(type=kind, keys=f"  {key}: {value}\n"))
    assert (f"is a {kind} joint with one number as '{key}'" in found) is ("six dof" in kind and not block)
    assert (f"is a {kind} joint with a block as '{key}'" in found) is ("six dof" not in kind and block)
    without = not block and "six dof" not in kind and kind not in ("linear spring", "torsion spring")
    assert (f"is a {kind} joint, so '{key}' has no effect" in found) is without


@pytest.mark.parametrize("kind", JOINT_KINDS)
@pytest.mark.parametrize("given_", [(), ("low",), ("high",), ("low", "high")])
def test_limits_count_where_both_are_given(kind: str, given_: tuple[str, ...]) -> None:
    keys = f"  joint limits: {{{', '.join(f'{end}: 1' for end in given_)}}}\n"
    found, spring = reported(JOINT.format(type=kind, keys=keys)), kind in ("linear spring", "torsion spring")
    assert ("without limits, which locks it" in found) is (spring and len(given_) < 2)
    assert ("of its limits, so it is unlimited" in found) is (
        len(given_) == 1 and (spring or kind in ("revolute", "prismatic"))
    )


@pytest.mark.parametrize(("one", "other"), itertools.product([False, True], repeat=2))
def test_one_of_two_keys_is_enough(one: bool, other: bool) -> None:
    keys = "  simulated multibody: m.yaml\n" * one + "  root link: B\n" * other
    assert ("has nothing to drive" in reported(DEVICE.format(keys=keys), "input devices")) is not (one or other)
    wheel = ", ".join(["body: B"] * one + ["mesh: m.obj"] * other)
    vehicle = f"  chassis: B\n  wheels: [{{{wheel}}}]\n"
    assert ("has neither body nor mesh" in reported(OBJECT.format(list="vehicles", keys=vehicle))) is not (one or other)


UNUSED = [
    (kind, key)
    for kind in ("body", "joint", "sensor", "camera", "light", "soft body")
    for key in SCHEMA[kind]
    if key.status in (Status.UNUSED, Status.IGNORED) and not key.block
]


@pytest.mark.parametrize(("kind", "key"), UNUSED, ids=[f"{kind}-{key.path}" for kind, key in UNUSED])
def test_a_key_without_effect_is_reported_at_debug(kind: str, key: Key) -> None:
    (list_,) = (name for name, listed in LISTS.items() if listed == kind)
    other = ", other than in AMBF" if key.status is Status.UNUSED else ""
    found = reported(
        OBJECT.format(list=list_, keys=f"  {key.path}: 1\n"), "world" if list_ in BY_PATH["world"] else "model"
    )
    here = " here" if other else ""
    assert f"debug: key '{key.path}' of {kind} 'X' has no effect{here}{other}; " in found


@pytest.mark.parametrize("item", ["3", "[1]", "~"])
def test_an_item_that_is_no_block_is_reported(item: str) -> None:
    found = reported(OBJECT.format(list="sensors", keys=f"  type: proximity\n  array: [{item}]\n"))
    assert "m.yaml:5:11: error: 'array' of sensor 'X' is not usable; expected a block of keys" in found


def test_only_a_word_of_a_choice_costs_its_object_and_not_the_file() -> None:
    body, joint = OBJECT.format(list="bodies", keys="  mass: abc\n"), JOINT.format(type="wobbly", keys="")
    codes = [d.code for text in (body, joint) for d in read_text(text, Path("m.yaml"), "model").diagnostics]
    assert [code for code in codes if code in ("value", "left out")] == ["value", "left out"]


def test_a_file_that_lacks_a_key_is_reported() -> None:
    assert "launch 'm.yaml' lacks the key 'world config'" in reported("multibody configs: []\n", "launch")
