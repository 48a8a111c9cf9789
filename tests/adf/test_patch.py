"""Patching one value leaves every other byte alone."""

from __future__ import annotations

from pathlib import Path

import pytest
from ligature.adf.nodes import Mapping, Sequence, parse, plain
from ligature.adf.patch import (
    PatchError,
    add_item,
    add_key,
    aliases_into,
    apply,
    remove_item,
    remove_key,
    rename_key,
    set_value,
)

TEXT = """# a comment
BODY a: &a
  name: a   # its name
  mass: 1.0
  location: {position: {x: 1, y: 2, z: 3}}
  inertia: &i
    ix: 1
    iy: 2
BODY b:
  name: 'b'
  inertia: *i
  friction:
    static: 0.5

# the end
"""


def block(text: str, name: str) -> Mapping:
    node = parse(text, Path("m.yaml")).get(name)
    assert isinstance(node, Mapping)
    return node


def changed(before: str, after: str) -> list[tuple[str, str]]:
    pairs = zip(before.split("\n"), after.split("\n"), strict=True)
    return [(a, b) for a, b in pairs if a != b]


@pytest.mark.parametrize(
    ("path", "value", "line"),
    [
        ("mass", 2.5, "  mass: 2.5"),
        ("name", "new name", "  name: new name   # its name"),
        ("location.position.y", -1, "  location: {position: {x: 1, y: -1, z: 3}}"),
        ("inertia.iy", 1e-7, "    iy: 1.0e-07"),
    ],
)
def test_one_scalar_changes_one_line(path: str, value: object, line: str) -> None:
    after = apply(TEXT, [set_value(TEXT, block(TEXT, "BODY a"), path, value)])
    assert [b for _, b in changed(TEXT, after)] == [line]


def test_a_quoted_scalar_is_replaced_with_its_quotes() -> None:
    assert "  name: c\n" in apply(TEXT, [set_value(TEXT, block(TEXT, "BODY b"), "name", "c")])


@pytest.mark.parametrize("before", ["", "  ", "~", "null", "1.0", "'x'", "{}", "[1, 2]"])
@pytest.mark.parametrize("space", ["", " ", "   "])
@pytest.mark.parametrize("behind", ["", "  # why", "\n"])
def test_a_scalar_takes_the_place_of_whatever_was_there(before: str, space: str, behind: str) -> None:
    """A key without a value, or with nothing but a comment, included: there must be a blank between it and a value."""
    if before and not space:
        space = " "
    text = f"B:\n  mass:{space}{before}{behind}\n  name: b\n"
    node = parse(text, Path("m.yaml")).get("B")
    assert isinstance(node, Mapping)
    changed = apply(text, [set_value(text, node, "mass", 2.5)])
    assert plain(parse(changed, Path("m.yaml"))) == {"B": {"mass": "2.5", "name": "b"}}, changed
    assert changed.count("# why") == text.count("# why") and changed.count("\n") == text.count("\n")


def test_a_value_behind_an_alias_is_changed_for_its_own_user_only() -> None:
    after = apply(TEXT, [set_value(TEXT, block(TEXT, "BODY b"), "inertia.ix", 3)])
    assert [b for _, b in changed(TEXT, after)] == ["  inertia: {ix: 3, iy: 2}"]


def test_keys_are_added_and_removed_in_place() -> None:
    added = apply(TEXT, [add_key(TEXT, block(TEXT, "BODY b"), "passive", True)])
    assert added.replace("  passive: true\n", "") == TEXT
    assert added.index("  passive: true\n") < added.index("# the end")
    assert apply(added, [remove_key(added, block(added, "BODY b"), "passive")]) == TEXT
    without = apply(TEXT, [remove_key(TEXT, block(TEXT, "BODY a"), "inertia")])
    assert "ix: 1" not in without and "BODY b:" in without


def test_blocks_on_the_way_to_a_new_key_are_added() -> None:
    after = apply(TEXT, [set_value(TEXT, block(TEXT, "BODY a"), "damping.linear", 0.5)])
    assert after.replace("  damping:\n    linear: 0.5\n", "") == TEXT
    rolling = apply(TEXT, [set_value(TEXT, block(TEXT, "BODY b"), "friction.rolling", 0.1)])
    assert rolling.replace("    rolling: 0.1\n", "") == TEXT


def test_a_flow_block_grows_and_shrinks_inside_its_braces() -> None:
    a = block(TEXT, "BODY a")
    location = a.get("location")
    assert isinstance(location, Mapping)
    grown = apply(TEXT, [add_key(TEXT, location, "scale", 2)])
    assert "z: 3}, scale: 2}\n" in grown
    position = location.get("position")
    assert isinstance(position, Mapping)
    for name, left in (("x", "{y: 2, z: 3}"), ("y", "{x: 1, z: 3}"), ("z", "{x: 1, y: 2}")):
        assert f"position: {left}}}" in apply(TEXT, [remove_key(TEXT, position, name)])


def test_an_empty_key_becomes_a_block() -> None:
    text = "BODY a:\n  name: a\n  friction:\n  mass: 1\n"
    after = apply(text, [set_value(text, block(text, "BODY a"), "friction.static", 0.5)])
    assert after == "BODY a:\n  name: a\n  friction:\n    static: 0.5\n  mass: 1\n"


@pytest.mark.parametrize(
    ("text", "longer", "shorter"),
    [
        ("bodies:\n- BODY a # one\n- BODY b\nmass: 1\n", "bodies:\n- BODY a # one\n- BODY b\n- BODY c\nmass: 1\n",
         "bodies:\n- BODY b\nmass: 1\n"),
        ("bodies: [BODY a, BODY b]\n", "bodies: [BODY a, BODY b, BODY c]\n", "bodies: [BODY b]\n"),
        ("bodies:\r\n  - BODY a\r\n", "bodies:\r\n  - BODY a\r\n  - BODY c\r\n", "bodies:\r\n"),
        ("bodies: [BODY a,]\n", "bodies: [BODY a, BODY c]\n", "bodies: [,]\n"),
    ],
)  # fmt: skip
def test_lists_grow_and_shrink(text: str, longer: str, shorter: str) -> None:
    items = parse(text, Path("m.yaml")).get("bodies")
    assert isinstance(items, Sequence)
    assert apply(text, [add_item(text, items, "BODY c")]) == longer
    assert apply(text, [remove_item(text, items, 0)]) in (shorter, "bodies: []\n")


def test_an_anchor_may_go_when_its_aliases_are_spelled_out() -> None:
    root = parse(TEXT, Path("m.yaml"))
    gone = remove_key(TEXT, root, "BODY a")
    after = apply(TEXT, [gone, *aliases_into(root, gone.span)])
    assert plain(parse(after, Path("m.yaml"))) == {
        "BODY b": {"name": "b", "inertia": {"ix": "1", "iy": "2"}, "friction": {"static": "0.5"}}
    }
    assert after.startswith("# a comment\nBODY b:")


def test_a_key_is_renamed_in_place() -> None:
    root = parse(TEXT, Path("m.yaml"))
    assert apply(TEXT, [rename_key(root, "BODY b", "BODY c")]) == TEXT.replace("BODY b:", "BODY c:")
    with pytest.raises(PatchError, match="'BODY a' already exists, at m.yaml:2:1"):
        rename_key(root, "BODY b", "BODY a")


def test_changes_that_meet_are_refused() -> None:
    a = block(TEXT, "BODY a")
    with pytest.raises(PatchError, match="two changes meet"):
        apply(TEXT, [set_value(TEXT, a, "mass", 1), set_value(TEXT, a, "mass", 2)])


def test_what_cannot_be_is_reported() -> None:
    with pytest.raises(PatchError, match="'mass' at m.yaml:4:9 is not a block"):
        set_value(TEXT, block(TEXT, "BODY a"), "mass.x", 1)
    with pytest.raises(PatchError, match="already exists"):
        add_key(TEXT, block(TEXT, "BODY a"), "mass", 1)


def test_one_mass_of_every_corpus_file_changes_one_line(corpus: Path) -> None:
    patched = 0
    for file in sorted(corpus.rglob("*.yaml")):
        if file.name == "compound_example.yaml":
            continue
        text = file.read_text(encoding="utf-8")
        root = parse(text, file)
        for _, node in root.entries.values():
            if isinstance(node, Mapping) and "mass" in node.entries:
                after = apply(text, [set_value(text, node, "mass", 12.5)])
                difference = changed(text, after)
                assert len(difference) == 1 and "mass: 12.5" in difference[0][1]
                patched += 1
    assert patched > 300
