"""Findings about a file as a whole: lists of names, what they name, and keys that are of no use."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature.adf import Document, Resolver, read_model
from ligature.adf.checker import MAX_FINDINGS
from ligature.adf.reader import read_text
from ligature.adf.schema import LISTS, SCHEMA, Type

JOINT = (
    "joints: [J]\nJ:\n  name: j\n  parent: A\n  child: B\n  {keys}\n"
    "  parent pivot: {{x: 0, y: 0, z: 0}}\n  child pivot: {{x: 0, y: 0, z: 0}}\n"
    "  parent axis: {{x: 0, y: 0, z: 1}}\n  child axis: {{x: 0, y: 0, z: 1}}\n"
)
BODY = "bodies: [BODY a]\nBODY a:\n  name: a\n  mass: 1\n"
OTHERS = "input devices config: d.yaml\ncolor config: c.yaml\n"
VEHICLE = "vehicles: [V]\nV:\n  name: v\n  chassis: {chassis}\n  wheels: []\n"


def lines(document: Document) -> list[str]:
    """Place, severity and message of each finding, in order."""
    return [f"{d.mark.line} {d.severity.name.lower()} {d.message}" for d in document.diagnostics if d.mark]


def found(text: str, kind: str = "model") -> list[str]:
    return lines(read_text(text, Path("m.yaml"), kind))


@pytest.mark.parametrize(
    ("text", "kind", "expected"),
    [
        ("bodies: [~, [1], '']\n", "model", [
            "1 error an item of 'bodies' is not the name of an object",
            "1 error an item of 'bodies' is not the name of an object",
            "1 warning body '' is listed but not defined",
        ]),
        ("bodies: [B, B]\nB: {name: b, mass: 1}\n", "model", ["1 info 'B' is listed twice in 'bodies', so it exists twice"]),
        ("joints: [J, K]\nK: 3\n", "model", [
            "1 error joint 'J' is listed but not defined",
            "2 error joint 'K' is listed, but its definition is not a block of keys",
        ]),
        ("joints: [J]\nJ: ~\n", "model", [
            "2 warning joint 'J' is listed, but its definition is not a block of keys",
        ]),
        ("bodies: [A]\nB: {name: b}\n", "model", [
            "2 debug 'B' is defined but not listed, so it does not exist",
            "1 warning body 'A' is listed but not defined",
        ]),
        ("bodies: []\nbodys: [A]\nnote: {a: 1}\nspare: &x {a: 1}\n", "model", [
            "2 warning unknown key 'bodys' in model file",
            "3 debug 'note' is defined but not listed, so it does not exist",
            "4 debug 'spare' only holds values for aliases",
        ]),
        # an anchor within an unlisted block, and an alias to one, which holds none itself
        ("bodies: []\na: {b: [&x 1, 2]}\nc: {d: [*x]}\ne: {f: *x}\n", "model", [
            "2 debug 'a' only holds values for aliases",
            "3 debug 'c' is defined but not listed, so it does not exist",
            "4 debug 'e' is defined but not listed, so it does not exist",
        ]),
        ("multibody configs: [a.yaml, ~, {b: 1}]\nworld config: [w]\n" + OTHERS, "launch", [
            "1 error an item of 'multibody configs' is not a path",
            "1 error an item of 'multibody configs' is not a path",
            "2 error 'world config' of launch 'm.yaml' is not usable",
        ]),
        ("multibody configs: a.yaml\nworld config: w.yaml\n" + OTHERS, "launch", [
            "1 error 'multibody configs' of launch 'm.yaml' is not usable",
        ]),
        (JOINT.format(keys=""), "model", ["3 warning joint 'J' has no 'type'; using revolute"]),
    ],
)  # fmt: skip
def test_what_is_wrong_is_found_in_order(text: str, kind: str, expected: list[str]) -> None:
    assert found(text, kind) == expected


def test_the_hint_at_an_unknown_key_names_what_was_meant() -> None:
    document = read_text("bodeis: [A]\nzzz: 1\n", Path("m.yaml"), "model")
    assert [(d.message, d.hint) for d in document.diagnostics] == [
        ("unknown key 'bodeis' in model file", "did you mean 'bodies'?"),
        ("unknown key 'zzz' in model file", "it has no effect"),
    ]


COMMAS = {
    Type.NUMBER: ["1,25"],
    Type.VECTOR: ["{x: 1,25, y: 0, z: 0}"],
    Type.RPY: ["{r: 0, p: 0, y: 1,25}"],
    Type.POSE: ["{position: {x: 0, y: 1,25, z: 0}}", "{orientation: {r: 1,25e-3, p: 0, y: 0}}"],
}


@pytest.mark.parametrize("listed", [name for name in LISTS if name != "input devices"])
def test_a_decimal_comma_is_reported_with_what_to_write(listed: str) -> None:
    keys = [key for key in SCHEMA[LISTS[listed]] if "[]" not in key.path]
    for key in keys:
        for value in COMMAS.get(key.type, []):
            *blocks, last = key.path.split(".")
            if blocks == ["location"]:  # a vector, which is looked into where it is whole
                last = f"x: 0, y: 0, z: 0, {last}"
            text = "".join(f"{block}: {{" for block in blocks) + f"{last}: {value}" + "}" * len(blocks)
            document = read_text(f"{listed}: [X]\nX: {{name: x, {text}}}\n", Path("m.yaml"), "model")
            hints = [d.hint for d in document.diagnostics if d.message.startswith("unknown key")]
            assert any("write a point before '25" in hint for hint in hints), text


def test_keys_of_a_position_and_an_orientation_are_checked() -> None:
    text = BODY + "  location: {position: {x: 0, y: 0, z: 0, Z: 1}, orientation: {r: 0, p: 0, y: 0, r: 1}}\n"
    assert found(text) == [
        "5 warning unknown key 'location.position.Z' in body 'BODY a'", "5 warning key 'r' appears twice",
    ]  # fmt: skip


def test_a_joint_without_type_still_lacks_its_other_keys() -> None:
    text = JOINT.format(keys="").replace("  parent pivot: {x: 0, y: 0, z: 0}\n", "")
    assert found(text) == [
        "3 error joint 'J' lacks the key 'parent pivot'",
        "3 warning joint 'J' has no 'type'; using revolute",
    ]


@pytest.mark.parametrize(
    ("keys", "refused"),
    [("type: revolute", False), ("type: revolute\n  enable motor: 1", True), ("", True)],
)
def test_strict_reading_refuses_what_ambf_refuses(tmp_path: Path, keys: str, refused: bool) -> None:
    (tmp_path / "m.yaml").write_text(BODY + JOINT.format(keys=keys))
    strict = read_model(tmp_path / "m.yaml", Resolver([tmp_path]), strict=True)
    sane = read_model(tmp_path / "m.yaml", Resolver([tmp_path]))
    assert strict.refused is refused and not sane.refused
    assert [len(strict.elements(name)) for name in ("bodies", "joints")] == ([0, 0] if refused else [1, 1])
    assert [len(sane.elements(name)) for name in ("bodies", "joints")] == [1, 1]
    if refused:
        assert "AMBF refuses the whole file for 1 of these errors" in lines(strict)[-1]


def test_both_keys_of_a_motor_are_taken(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(JOINT.format(keys="type: revolute\n  enable motor: 1\n  enable feedback: true"))
    assert not read_model(tmp_path / "m.yaml", Resolver([tmp_path]), strict=True).refused


def test_a_finding_that_is_no_reason_refuses_nothing(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(BODY + "bodys: 3\nghost objects: [~x]\n")
    document = read_model(tmp_path / "m.yaml", Resolver([tmp_path]), strict=True)
    assert document.diagnostics and not document.refused


def test_a_sound_vehicle_is_read_and_reported_as_not_simulated() -> None:
    note = "vehicle 'V' is read and checked, but not simulated"
    assert sum(note in line for line in found(VEHICLE.format(chassis="BODY A"))) == 1
    assert not any(note in line for line in found(VEHICLE.format(chassis="[a]")))


@given(st.lists(st.sampled_from("ABC"), max_size=12), st.sets(st.sampled_from("ABC")))
def test_each_item_of_a_list_gives_its_object_once_or_again(names: list[str], defined: set[str]) -> None:
    text = f"bodies: [{', '.join(names)}]\n" + "".join(
        f"{name}: {{name: {name}, mass: 1}}\n" for name in sorted(defined)
    )
    document = read_text(text, Path("m.yaml"), "model")
    elements = document.elements("bodies")
    assert [element.key for element in elements] == [name for name in names if name in defined]
    assert len({id(element) for element in elements}) == len(defined & set(names))
    twice = [name for k, name in enumerate(names) if name in names[:k]]
    assert sum("is listed twice" in line for line in lines(document)) == len(twice)


@pytest.mark.parametrize("before", [0, 5])
@pytest.mark.parametrize("more", [-1, 0, 40])
def test_a_file_with_too_many_findings_is_read_up_to_there(before: int, more: int) -> None:
    count = MAX_FINDINGS - before + more
    names = [f"B{k}" for k in range(count)]
    text = "".join(f"odd{k}: 1\n" for k in range(before)) + f"bodies: [{', '.join(names)}]\n"
    shown = found(text)
    assert shown[-1].endswith(f"more than {MAX_FINDINGS} findings; the rest of the file is not read") is (more > 1)
    assert len(shown) == before + min(count, MAX_FINDINGS - before + 1) + (more > 1)
