"""Marked YAML nodes: places, first key wins, limits."""

from __future__ import annotations

from itertools import cycle
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature.adf import AdfError
from ligature.adf.nodes import MAX_DEPTH, Mapping, Scalar, Sequence, parse, plain

FILE = Path("scene.yaml")
LINE_ENDS = st.lists(st.sampled_from(["\n", "\r\n", "\r", "\x85", "\u2028", "\u2029"]), min_size=1, max_size=7)
"""Those that YAML 1.1 knows, one after the other."""


def ended(text: str, ends: list[str]) -> str:
    """``text`` with its lines ended by ``ends`` in turn."""
    end = cycle(ends)
    return "".join(next(end) if letter == "\n" else letter for letter in text)


def place(text: str, offset: int) -> tuple[int, int]:
    """Line and column of ``offset``, by Python's own idea of lines."""
    before = (text[:offset] + "x").splitlines()
    return len(before), len(before[-1])


def test_values_know_their_line_and_column() -> None:
    root = parse("a: 1\nblock:\n  inner: two\n", FILE)
    block = root.get("block")
    assert isinstance(block, Mapping)
    inner = block.get("inner")
    assert isinstance(inner, Scalar)
    assert (inner.mark.line, inner.mark.column, inner.text) == (3, 10, "two")


def test_the_first_of_two_equal_keys_wins() -> None:
    root = parse("mass: 1\nmass: 2\n", FILE)
    assert plain(root) == {"mass": "1"}
    assert [d.mark.line for d in root.duplicates] == [2]


def test_plain_scalars_stay_text() -> None:
    assert plain(parse("{y: y, x: 1e-05, on: off, n: ~}", FILE)) == {"y": "y", "x": "1e-05", "on": "off", "n": None}


def test_aliases_are_expanded() -> None:
    assert plain(parse("a: &v {x: 1}\nb: *v\n", FILE)) == {"a": {"x": "1"}, "b": {"x": "1"}}


def test_only_the_first_document_is_read() -> None:
    assert plain(parse("a: 1\n---\nb: 2\n", FILE)) == {"a": "1"}


def test_flow_maps_may_leave_their_indentation() -> None:
    root = parse("wheel:\n  suspension: &s\n{\n  stiffness: 5,\n  damping: 2}\n  radius: 1\n", FILE)
    wheel = root.get("wheel")
    assert isinstance(wheel, Mapping)
    suspension = wheel.get("suspension")
    assert isinstance(suspension, Mapping)
    assert plain(suspension) == {"stiffness": "5", "damping": "2"}
    value = suspension.get("damping")
    assert value is not None and (value.mark.line, value.mark.column) == (5, 12)


def test_bare_keys_in_a_flow_map_are_null() -> None:
    assert plain(parse("c: {P: 20, I, 0., D: 0.1}", FILE)) == {"c": {"P": "20", "I": None, "0.": None, "D": "0.1"}}


@pytest.mark.parametrize("block", ["[{}]", "{{{}}}"])
def test_an_alias_bomb_is_refused(block: str) -> None:
    """Of lists, and of mappings."""
    lines = ["a0: &a0 x"]
    for i in range(1, 10):
        items = [f"*a{i - 1}" if block[0] == "[" else f"{key}: *a{i - 1}" for key in "abcdefghij"]
        lines.append(f"a{i}: &a{i} {block.format(', '.join(items))}")
    with pytest.raises(AdfError, match="aliases expand to more than"):
        parse("\n".join(lines), FILE)


def test_an_alias_inside_its_own_anchor_is_refused() -> None:
    with pytest.raises(AdfError, match=r"scene.yaml:1:9: error: alias '\*a' is inside the block that it names"):
        parse("a: &a [1, *a]".replace("1, ", " "), FILE)


def test_deep_nesting_is_refused() -> None:
    with pytest.raises(AdfError, match="nests deeper than"):
        parse("a: " + "[" * (MAX_DEPTH + 2) + "]" * (MAX_DEPTH + 2), FILE)


@pytest.mark.parametrize("text", ["", "# nothing\n", "- 1\n- 2\n", "just text"])
def test_a_file_without_a_mapping_reports_it(text: str) -> None:
    with pytest.raises(AdfError, match="the file"):
        parse(text, FILE)


def test_broken_yaml_names_the_place() -> None:
    with pytest.raises(AdfError, match=r"scene.yaml:2:\d+: error: invalid YAML"):
        parse("a: [1, 2\nb: }\n", FILE)


def test_lists_keep_their_order() -> None:
    bodies = parse("bodies: [BODY b, BODY a]", FILE).get("bodies")
    assert isinstance(bodies, Sequence)
    assert [plain(item) for item in bodies.items] == ["BODY b", "BODY a"]


@given(st.lists(st.sampled_from(["a: 1", "# é", "b: {", "c: 2}", ""]), max_size=5), st.integers(0, 3), LINE_ENDS)
def test_a_character_that_yaml_forbids_is_reported_where_it_is(before: list[str], blanks: int, ends: list[str]) -> None:
    text = ended("\n".join([*before, "d: " + " " * blanks + "\a"]), ends)
    line, column = place(text, text.index("\a"))
    message = f"scene.yaml:{line}:{column}: error: invalid YAML: character U\\+0007 is not allowed; remove it"
    with pytest.raises(AdfError, match=message):
        parse(text, FILE)


PROPERTIES = st.sampled_from(["", "&x ", "!!str ", "&x !!str ", "&x\n      ", "!!str &x\n      "])
"""What may stand before a value: an anchor, a tag, on its line or the one before."""


@given(PROPERTIES, st.booleans(), LINE_ENDS)
def test_a_value_begins_behind_its_anchor_and_tag(properties: str, relaxed: bool, ends: list[str]) -> None:
    head = "flow: # of {\n{\na: 1}\n" if relaxed else ""
    text = ended(f"{head}block:\n  inner: {properties}value # that\n", ends)
    block = parse(text, FILE).get("block")
    assert isinstance(block, Mapping)
    inner = block.get("inner")
    assert isinstance(inner, Scalar) and (inner.text, inner.anchor) == ("value", "x" if "&" in properties else "")
    assert text[slice(*inner.span)] == "value"
    assert (inner.mark.line, inner.mark.column) == place(text, inner.span[0])


def test_the_last_level_that_may_nest_does() -> None:
    parse("a: " + "[" * MAX_DEPTH + "]" * MAX_DEPTH, FILE)
