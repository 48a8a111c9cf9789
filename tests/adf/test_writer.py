"""Writing documents: schema order, exact numbers, quoting, and values that come back equal."""

from __future__ import annotations

from pathlib import Path

import yaml
from hypothesis import given
from hypothesis import strategies as st
from ligature.adf import Resolver, read_any
from ligature.adf.nodes import Scalar, parse, plain
from ligature.adf.scalars import number
from ligature.adf.writer import scalar_text, write_document


@given(st.floats(allow_nan=False))
def test_numbers_keep_all_their_digits(value: float) -> None:
    assert number(scalar_text(value)) == value


@given(st.floats(allow_nan=False) | st.integers(-9, 9).map(lambda k: float(10**30 * k)))
def test_other_readers_of_yaml_take_a_number_for_one(value: float) -> None:
    read = yaml.safe_load(scalar_text(value))
    assert isinstance(read, float) and read == value


@given(st.text(max_size=30))
def test_texts_come_back_equal(text: str) -> None:
    node = parse(f"key: {scalar_text(text)}\n", Path("x")).get("key")
    assert isinstance(node, Scalar)
    assert node.text == text


def test_keys_come_in_the_order_of_the_schema() -> None:
    body = {
        "mass": 1.5,
        "name": "needle",
        "location": {"orientation": {"y": 0, "r": 1, "p": 2}, "position": {"x": 1, "y": 2, "z": 3}},
    }
    text = write_document("model", {"BODY a": body, "namespace": "/env/", "bodies": ["BODY a"]})
    assert text == (
        "bodies:\n- BODY a\nnamespace: /env/\nBODY a:\n  name: needle\n  mass: 1.5\n  location:\n"
        "    orientation: {y: 0, r: 1, p: 2}\n    position: {x: 1, y: 2, z: 3}\n"
    )


@given(st.permutations(["note", "B", "bodies", "C", "A"]), st.permutations("ABC"))
def test_objects_come_in_the_order_of_their_list_and_all_else_behind(keys: list[str], listed: list[str]) -> None:
    values = {key: listed if key == "bodies" else {"name": key} for key in keys}
    assert list(plain(parse(write_document("model", values), Path("x")))) == ["bodies", *listed, "note"]


def test_every_corpus_file_written_anew_reads_the_same(corpus: Path) -> None:
    compared = set()
    for file in sorted(corpus.rglob("*.yaml")):
        if file.name in ("compound_example.yaml", "colors.yaml"):
            continue
        document = read_any(file, Resolver([corpus]))
        values = plain(parse(document.text, file))
        again = plain(parse(write_document(document.kind, values), file))
        assert _without_null(again) == _without_null(values), file.name
        compared.add(file.name)
    assert {
        "launch.yaml",
        "world.yaml",
        "phantom.yaml",
        "psm1.yaml",
        "blender-pr2.yaml",
        "input_devices.yaml",
    } <= compared


def _without_null(value: object) -> object:
    """Null and the empty text are written alike."""
    if isinstance(value, dict):
        return {k: _without_null(v) for k, v in value.items()}
    if isinstance(value, list):
        return [_without_null(v) for v in value]
    return "" if value is None else value
