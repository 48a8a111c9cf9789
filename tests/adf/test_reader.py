"""Reading model, world and launch files: values, defaults, and findings with their words."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature.adf import Document, Resolver, Severity, read_any, read_launch, read_model


@pytest.fixture
def model(tmp_path: Path):
    def read(text: str, strict: bool = False) -> Document:
        (tmp_path / "m.yaml").write_text(text, encoding="utf-8")
        return read_model(tmp_path / "m.yaml", Resolver([tmp_path]), strict)

    return read


def messages(document: Document, least: Severity = Severity.WARNING) -> list[str]:
    return [str(d).split("/m.yaml:", 1)[1] for d in document.diagnostics if d.severity >= least]


BODY = "bodies: [BODY a]\nBODY a:\n  name: a\n  mass: 2\n"
JOINT = (
    "joints: [J]\nJ:\n  name: j\n  parent: A\n  child: B\n"
    "  parent pivot: {x: 0, y: 0, z: 0}\n  child pivot: {x: 0, y: 0, z: 0}\n"
    "  parent axis: {x: 0, y: 0, z: 1}\n  child axis: {x: 0, y: 0, z: 1}\n"
)


def test_values_and_defaults_come_from_the_schema(model) -> None:
    body = model(BODY + "  friction: {rolling: 0.2}\n").elements("bodies")[0]
    assert body.number("mass") == 2.0
    assert body.number("friction.static") == 0.5
    assert body.number("friction.rolling") == 0.2
    assert body.pose("location") == ((0, 0, 0), (0, 0, 0))
    assert body.has("mass") and not body.has("scale")


def test_a_bad_value_leaves_the_object_out_and_states_where(model) -> None:
    document = model(BODY + "  scale: big\n")
    assert document.elements("bodies") == ()
    assert messages(document) == [
        "5:10: error: 'scale' of body 'BODY a' is not usable; expected a number such as 0.5 or 1e-3, not 'big'"
    ]


@pytest.mark.parametrize("text", [".nan", ".inf", "1e300"])
def test_a_number_that_no_scene_can_use_is_an_error(model, text: str) -> None:
    assert f"expected a finite number below 1e+12, not '{text}'" in messages(model(BODY + f"  scale: {text}\n"))[0]


def test_a_missing_part_of_a_vector_is_named(model) -> None:
    document = model(BODY + "  gravity: {x: 0, z: 1}\n")
    assert "expected all of x, y, z; 'y' is missing" in messages(document)[0]


def test_a_scalar_where_a_block_is_expected_is_an_error(model) -> None:
    assert "expected a block of keys, not '0.5'" in messages(model(BODY + "  friction: 0.5\n"))[0]


def test_an_unknown_key_gets_a_suggestion(model) -> None:
    assert messages(model(BODY + "  fricton: {static: 1}\n")) == [
        "5:3: warning: unknown key 'fricton' in body 'BODY a'; did you mean 'friction'?"
    ]


def test_keys_that_ambf_ignores_are_reported_at_debug_only(model) -> None:
    document = model(BODY + "  color: red\n")
    assert messages(document) == []
    assert "key 'color' of body 'BODY a' has no effect" in messages(document, Severity.DEBUG)[0]


def test_a_key_that_stands_twice_is_reported(model) -> None:
    assert "key 'mass' appears twice; the first one is used" in messages(model(BODY + "  mass: 3\n"))[0]


def test_a_bad_value_of_the_file_itself_is_reported_and_its_default_taken(model) -> None:
    document = model(BODY + "gravity: {x: 0, y: 0}\nignore inter-collision: maybe\n")
    assert len(document.elements("bodies")) == 1
    assert not document.top.has("gravity") and document.top.flag("ignore inter-collision") is False
    assert [text.split(": ", 2)[1] for text in messages(document)] == ["error", "error"]


def test_objects_exist_only_when_listed(model) -> None:
    assert len(model(BODY + "BODY b:\n  name: b\n").elements("bodies")) == 1


def test_a_listed_object_without_definition_is_reported(model) -> None:
    assert "body 'BODY b' is listed but not defined" in messages(model("bodies: [BODY b]\n"))[0]


def test_a_repeated_entry_makes_two_objects(model) -> None:
    assert len(model(BODY.replace("[BODY a]", "[BODY a, BODY a]")).elements("bodies")) == 2


def test_a_joint_without_type_is_revolute_with_a_warning(model) -> None:
    document = model(JOINT)
    assert "joint 'J' has no 'type'; using revolute" in messages(document)[0]
    assert document.elements("joints")[0].value("type") is None


def test_strict_mode_refuses_what_ambf_refuses(model) -> None:
    assert not model(JOINT, strict=True).ok
    alone = model(JOINT + "  type: revolute\n  enable motor: 1\n", strict=True)
    assert "'enable motor' without 'enable feedback'" in messages(alone)[0]
    assert model(JOINT + "  type: revolute\n  enable motor: 1\n").ok


@pytest.mark.parametrize("text", ["hinge", "continuous", "revolute"])
def test_joint_type_synonyms(model, text: str) -> None:
    assert model(JOINT + f"  type: {text}\n").elements("joints")[0].value("type") == "revolute"


def test_a_joint_type_in_capitals_is_not_understood(model) -> None:
    assert "expected 'revolute', not 'Revolute'" in messages(model(JOINT + "  type: Revolute\n"))[0]


def test_an_empty_collision_mesh_type_is_harmless(model) -> None:
    document = model(BODY + "  collision mesh type: ''\n")
    assert messages(document) == [] and len(document.elements("bodies")) == 1


def test_y_stays_a_letter(model) -> None:
    text = BODY + "  collision shape: Capsule\n  collision geometry: {radius: 1, height: 4, axis: y}\n"
    body = model(text).elements("bodies")[0]
    assert body.text("collision shape") == "CAPSULE"
    assert body.text("collision geometry.axis") == "Y"


def test_another_adf_version_is_an_error(model) -> None:
    assert "'adf version' is not 1.0; write 1.0" in messages(model("adf version: 2.0\n" + BODY))[0]


def test_volumes_are_read(model) -> None:
    document = model("volumes: [V]\nV:\n  name: v\n  images: {path: ./, prefix: a, format: png, count: 3}\n")
    assert messages(document) == []
    assert [volume.number("images.count") for volume in document.elements("volumes")] == [3]


def test_launch_references_that_do_not_exist_are_kept_by_index(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(BODY)
    (tmp_path / "launch.yaml").write_text(
        "world config: w.yaml\ncolor config: c.yaml\ninput devices config: d.yaml\nmultibody configs: [a.yaml, m.yaml]\n"
    )
    launch = read_launch(tmp_path / "launch.yaml", Resolver([tmp_path]))
    assert launch.models[0].path is None and "'a.yaml' does not exist" in str(launch.models[0].diagnostic)
    assert launch.models[1].path == tmp_path / "m.yaml"


def test_every_corpus_file_is_read_or_refused_with_its_place(corpus: Path) -> None:
    resolver = Resolver([corpus])
    refused = []
    for file in sorted(corpus.rglob("*.yaml")):
        try:
            read_any(file, resolver)
        except Exception as error:
            assert f"{file.name}:" in str(error)
            refused.append(file.name)
    assert refused == ["compound_example.yaml"]


def test_of_all_keys_of_real_files_only_slips_are_unknown(corpus: Path) -> None:
    resolver = Resolver([corpus])
    unknown = [
        f"{file.name}: {d.message}"
        for file in sorted(corpus.rglob("*.yaml"))
        if file.name != "compound_example.yaml"
        for d in read_any(file, resolver).diagnostics
        if d.code in ("unknown", "value", "missing")
    ]
    assert unknown == [
        "pr2 gripper resistive.yaml: unknown key 'SENSOR Proximity0' in sensor 'RP0'",
        "cylinder.yaml: unknown keys 'location.x', 'location.y', 'location.z' in sensor 'SENSOR Proximity'",
    ]


@given(st.lists(st.booleans(), min_size=1, max_size=8), st.sampled_from(["", "~", "{a: 1}", "[1]"]), st.booleans())
def test_an_item_of_a_list_that_is_no_name_costs_only_itself(sound: list[bool], odd: str, launch: bool) -> None:
    with TemporaryDirectory() as place:
        file = Path(place, "m.yaml")
        key = "multibody configs" if launch else "bodies"
        lines = [f"  - {f'b{i}' if good else odd}" for i, good in enumerate(sound)]
        bodies = "".join(f"b{i}: {{name: b{i}, mass: 1}}\n" for i in range(len(sound)))
        file.write_text(f"{key}:\n" + "\n".join(lines) + "\n" + ("" if launch else bodies))
        document = read_any(file, Resolver([file.parent]))
        wrong = [d for d in document.diagnostics if d.message.startswith(f"an item of '{key}' is not")]
        assert [d.mark.line for d in wrong if d.mark] == [i + 2 for i, good in enumerate(sound) if not good]
        assert all(d.severity is Severity.ERROR for d in wrong)
        if launch:
            assert [model.text for model in document.models] == [
                f"b{i}" if good else "" for i, good in enumerate(sound)
            ]
        else:
            assert [body.key for body in document.elements("bodies")] == [
                f"b{i}" for i, good in enumerate(sound) if good
            ]


@pytest.mark.parametrize("line", ["collision margin:", "scale: ~", "passive: null", "friction: {static: }"])
def test_a_key_without_a_value_is_reported_as_such(model, line: str) -> None:
    assert "but no value stands here; remove the key to have its default" in messages(model(BODY + f"  {line}\n"))[0]
