"""Patching one value leaves every other byte alone."""

from __future__ import annotations

from pathlib import Path

import pytest
from ligature.adf.nodes import Mapping, parse
from ligature.adf.patch import PatchError, add_key, remove_key, set_scalar

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
    after = set_scalar(TEXT, block(TEXT, "BODY a"), path, value)
    assert [b for _, b in changed(TEXT, after)] == [line]


def test_a_quoted_scalar_is_replaced_with_its_quotes() -> None:
    assert "  name: c\n" in set_scalar(TEXT, block(TEXT, "BODY b"), "name", "c")


def test_a_value_behind_an_alias_is_refused_with_its_place() -> None:
    with pytest.raises(PatchError, match=r"'inertia' is an alias of the value at m.yaml:6:12"):
        set_scalar(TEXT, block(TEXT, "BODY b"), "inertia.ix", 3)


def test_keys_are_added_and_removed_in_place() -> None:
    added = add_key(TEXT, block(TEXT, "BODY b"), "passive", True)
    assert added.replace("  passive: true\n", "") == TEXT
    assert added.index("  passive: true\n") < added.index("# the end")
    removed = remove_key(added, block(added, "BODY b"), "passive")
    assert removed == TEXT
    without = remove_key(TEXT, block(TEXT, "BODY a"), "inertia")
    assert "ix: 1" not in without and "BODY b:" in without


def test_a_flow_block_grows_inside_its_braces() -> None:
    location = block(TEXT, "BODY a").get("location")
    assert isinstance(location, Mapping)
    assert "z: 3}, scale: 2}\n" in add_key(TEXT, location, "scale", 2)


def test_what_is_not_there_is_told() -> None:
    with pytest.raises(PatchError, match="there is no 'scale' in the block at m.yaml:2:9"):
        set_scalar(TEXT, block(TEXT, "BODY a"), "scale", 1)
    with pytest.raises(PatchError, match="is there already"):
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
                after = set_scalar(text, node, "mass", 12.5)
                assert [b.strip().partition(" #")[0] for _, b in changed(text, after)] == [
                    "mass: 12.5"
                ] or "mass: 12.5" in after
                assert len(changed(text, after)) == 1
                patched += 1
    assert patched > 300
