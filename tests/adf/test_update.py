"""A file gets new values by changing only what differs."""

from __future__ import annotations

from dataclasses import replace
from itertools import cycle
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.adf import Document, Element, Resolver, read_any
from ligature.adf.nodes import parse
from ligature.adf.patch import PatchError
from ligature.adf.update import Item, items_of, new_text, same, updated

TEXT = """# hand-written
bodies: [BODY a, BODY b]
joints:
- JOINT j
namespace: /x/   # the robot's
spare: &gains {P: 20, D: 0.5}
BODY a:
  name: a
  mass: 1.00000 # kilograms
  my own key: kept
  location:
    position: {x: 1.00000001, y: 2, z: 3}
    orientation: {r: 0, p: 0, y: 0}
  damping: &d
    linear: 0.04
    angular: 0.1
BODY b:
  name: b
  mass: 2
  damping: *d
JOINT j:
  name: j
  parent: BODY a
  child: BODY b
  type: revolute
  parent pivot: {x: 0, y: 0, z: 0}
  child pivot: {x: 0, y: 0, z: 0}
  parent axis: {x: 0, y: 0, z: 1}
  child axis: {x: 0, y: 0, z: 1}
  controller: *gains
"""


def read(tmp_path: Path, text: str) -> Document:
    (tmp_path / "m.yaml").write_text(text, encoding="utf-8")
    return read_any(tmp_path / "m.yaml", Resolver([tmp_path]))


def changed(document: Document, key: str, values: dict[str, object], removed: tuple[str, ...] = ()) -> str:
    """The document's text after ``values`` of one object changed; None takes a key away."""
    items = []
    for item in items_of(document):
        if item.key == key:
            merged = {**item.values, **values}
            item = replace(item, values={path: v for path, v in merged.items() if v is not None})
        if item.key not in removed:
            items.append(item)
    return updated(document.text, document.kind, document.top.given(), items, removed)


def differing(before: str, after: str) -> list[str]:
    old = before.splitlines()
    return [line for line in after.splitlines() if line not in old]


def test_what_states_the_same_stays_byte_for_byte(tmp_path: Path) -> None:
    document = read(tmp_path, TEXT)
    assert changed(document, "BODY a", {"mass": 1.0, "location": ((1.0, 2.0, 3.0), (0.0, 0.0, 0.0))}) == TEXT


@pytest.mark.parametrize(
    ("values", "lines"),
    [
        ({"mass": 1.5}, ["  mass: 1.5 # kilograms"]),
        ({"location": ((1.0, 2.0, 4.0), (0.0, 0.0, 0.0))}, ["    position: {x: 1.00000001, y: 2, z: 4.0}"]),
        ({"friction.static": 0.3, "friction.rolling": 0.1}, ["  friction:", "    static: 0.3", "    rolling: 0.1"]),
        ({"collision groups": (1, 2)}, ["  collision groups:", "  - 1", "  - 2"]),
        ({"gravity": (0.0, 0.0, -1.0)}, ["  gravity: {x: 0.0, y: 0.0, z: -1.0}"]),
        ({"mass": None}, []),
    ],
)
def test_a_change_touches_its_own_lines_only(tmp_path: Path, values: dict[str, object], lines: list[str]) -> None:
    after = changed(read(tmp_path, TEXT), "BODY a", values)
    assert differing(TEXT, after) == lines
    assert items_of(read(tmp_path, after))[1:] == items_of(read(tmp_path, TEXT))[1:]


def test_a_value_with_an_anchor_changes_for_its_owner_alone(tmp_path: Path) -> None:
    after = changed(read(tmp_path, TEXT), "BODY a", {"damping.linear": 0.5})
    assert differing(TEXT, after) == ["    linear: 0.5", "  damping: {linear: 0.04, angular: 0.1}"]


def test_a_value_behind_an_alias_leaves_the_anchor_alone(tmp_path: Path) -> None:
    after = changed(read(tmp_path, TEXT), "JOINT j", {"controller.P": 30.0, "controller.D": 1.0})
    assert differing(TEXT, after) == ["  controller: {P: 30.0, D: 1.0}"]


def test_an_object_goes_with_its_place_in_the_list_and_its_anchor_is_spelled_out(tmp_path: Path) -> None:
    after = changed(read(tmp_path, TEXT), "", {}, removed=("BODY a",))
    assert differing(TEXT, after) == ["bodies: [BODY b]", "  damping: {linear: 0.04, angular: 0.1}"]
    everything = changed(read(tmp_path, TEXT), "", {}, removed=("BODY a", "BODY b", "JOINT j"))
    assert [line for line in everything.splitlines() if line] == [
        "# hand-written",
        "bodies: []",
        "joints: []",
        "namespace: /x/   # the robot's",
        "spare: &gains {P: 20, D: 0.5}",
    ]


def test_a_new_object_is_listed_and_defined_at_the_end(tmp_path: Path) -> None:
    document = read(tmp_path, TEXT)
    ghost = Item("ghost object", "GHOST g", {"name": "g", "parent": "BODY a", "visible": False})
    after = updated(TEXT, "model", document.top.given(), [*items_of(document), ghost])
    assert differing(TEXT, after) == ["ghost objects:", "- GHOST g", "GHOST g:", "  name: g", "  visible: false"]
    assert after.index("ghost objects:") < after.index("namespace:")
    assert read(tmp_path, after).elements("ghost objects")[0].text("parent") == "BODY a"


KEYS: dict[str, object] = {
    "name": "a",
    "mesh": "a.OBJ",
    "mass": 2.0,
    "collision shape": "SPHERE",
    "collision geometry.radius": 0.01,
    "compound collision shape": ({"shape": "BOX", "geometry.x": 0.5},),
    "friction.static": 0.5,
    "friction.rolling": 0.01,
    "collision mesh": "b.OBJ",
    "collision groups": (0, 3),
    "location": ((1.0, 2.0, 3.0), (0.0, 0.5, 0.0)),
}
bodies = st.lists(st.sampled_from(sorted(KEYS)), min_size=1, unique=True)


LINE_ENDS = st.sampled_from(["\n", "\r\n", "\r", "\x85", "\u2028", "\u2029"])
"""Those that YAML knows, one after the other."""


@settings(max_examples=60)
@given(
    st.lists(bodies, min_size=1, max_size=3), st.lists(bodies, min_size=1, max_size=4), st.booleans(),
    st.lists(LINE_ENDS, min_size=1, max_size=7),
)  # fmt: skip
def test_any_keys_give_place_to_any_others(
    before: list[list[str]], after: list[list[str]], flow: bool, ends: list[str]
) -> None:
    """Objects and keys come and go at once, also the last of a block, and the file states what is wanted."""
    files = [
        [Item("body", f"BODY {number}", {name: KEYS[name] for name in names}) for number, names in enumerate(bodies)]
        for bodies in (before, [*after[1:], *after[:1]])
    ]
    files[1] = [replace(item, key=f"BODY {3 - number}") for number, item in enumerate(files[1])]
    text = new_text("model", {}, files[0])
    if flow:
        text = text.replace("\n    radius: 0.01", " {radius: 0.01}")
    end = cycle(ends)
    text = "".join(next(end) if letter == "\n" else letter for letter in text)
    kept = {item.key for item in files[1]}
    removed = [item.key for item in files[0] if item.key not in kept]
    after_all = updated(text, "model", {}, files[1], removed)
    root = parse(after_all, Path("m.yaml"))
    wanted = {item.key: item.values for item in files[1]}
    assert {key: Element("body", key, root.get(key)).given() for key in wanted} == wanted
    assert sorted(entry.text for entry in root.get("bodies").items) == sorted(wanted)
    assert not set(removed) & set(root.entries)
    assert updated(after_all, "model", {}, files[1]) == after_all


def test_an_object_is_renamed_in_the_list_and_where_it_stands(tmp_path: Path) -> None:
    document = read(tmp_path, TEXT)
    items = [replace(i, key="BODY c", was="BODY b") if i.key == "BODY b" else i for i in items_of(document)]
    after = updated(TEXT, "model", document.top.given(), items)
    assert differing(TEXT, after) == ["bodies: [BODY a, BODY c]", "BODY c:"]


def test_an_unreadable_object_is_left_alone(tmp_path: Path) -> None:
    text = TEXT.replace("mass: 2", "mass: heavy")
    assert changed(read(tmp_path, text), "BODY a", {"mass": 9.0}) == text.replace("mass: 1.00000", "mass: 9.0")


def test_a_new_file_is_canonical_and_states_the_same(tmp_path: Path) -> None:
    document = read(tmp_path, TEXT)
    text = new_text(document.kind, document.top.given(), items_of(document))
    again = read(tmp_path, text)
    assert items_of(again) == items_of(document)
    assert new_text(again.kind, again.top.given(), items_of(again)) == text
    with pytest.raises(PatchError, match="'joints' is the identifier of two objects"):
        new_text("model", {}, [Item("joint", "joints", {})])


def test_every_corpus_file_stays_as_it_is_and_can_be_written_anew(corpus: Path, tmp_path: Path) -> None:
    resolver, compared = Resolver([corpus]), 0
    for file in sorted(corpus.rglob("*.yaml")):
        if file.name == "compound_example.yaml":
            continue
        document = read_any(file, resolver)
        if document.kind == "colors":
            continue
        top, items = document.top.given(), items_of(document)
        assert updated(document.text, document.kind, top, items) == document.text, file
        again = read(tmp_path, new_text(document.kind, top, items))
        assert {i.key: same(dict(i.values), dict(j.values)) for i, j in zip(items_of(again), items, strict=True)} == {
            i.key: True for i in items
        }, file
        compared += 1
    assert compared > 40
