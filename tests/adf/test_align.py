"""Items of lists are paired in order, so that each is changed where it stands."""

from __future__ import annotations

from itertools import combinations, product
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from ligature.adf import Resolver, read_any
from ligature.adf.align import GAP, aligned
from ligature.adf.nodes import parse, plain
from ligature.adf.update import Item, items_of, same, updated

ITEMS = st.lists(st.fixed_dictionaries({"a": st.integers(0, 3), "b": st.integers(0, 3)}), max_size=6)


@given(ITEMS, ITEMS)
def test_every_item_is_paired_once_in_order(old: list, new: list) -> None:
    pairs = aligned(old, new, same)
    assert [i for i, _ in pairs if i is not None] == list(range(len(old)))
    assert [j for _, j in pairs if j is not None] == list(range(len(new)))
    if old == new:
        assert all(i == j for i, j in pairs)


@given(ITEMS, st.data())
def test_an_item_that_goes_costs_no_other(old: list, data: st.DataObject) -> None:
    if not old:
        return
    index = data.draw(st.integers(0, len(old) - 1))
    new = old[:index] + old[index + 1 :]
    assert sum(i is None or j is None or old[i] != new[j] for i, j in aligned(old, new, same)) == 1


def cost(old: list, new: list, pairs: list) -> int:
    """What an alignment changes: `GAP` for what is new or goes, else 20 and 80 times the share of keys that differ."""
    total = 0
    for i, j in pairs:
        if i is None or j is None:
            total += GAP
        elif old[i] != new[j]:
            keys = old[i].keys() | new[j].keys()
            differing = [key for key in keys if old[i].get(key) != new[j].get(key)]
            total += 20 + 80 * len(differing) // len(keys)
    return total


def least_cost(old: list, new: list) -> int:
    """The cost of the best of all alignments, by trying each."""
    ways = []
    for k in range(min(len(old), len(new)) + 1):
        for left in combinations(range(len(old)), k):
            for right in combinations(range(len(new)), k):
                gaps = len(old) + len(new) - 2 * k
                ways.append(GAP * gaps + cost(old, new, list(zip(left, right, strict=True))))
    return min(ways)


OPEN_ITEMS = st.lists(st.dictionaries(st.sampled_from("abc"), st.integers(0, 1), min_size=1), min_size=0, max_size=4)


STEPS = [{"a": int(k > 0), "b": int(k > 1), "c": int(k > 2)} for k in range(4)]


@given(OPEN_ITEMS, OPEN_ITEMS)
@example(STEPS[:3], STEPS[1:])  # three items with one key of three cost 138, one that goes and a new one 140
def test_no_other_alignment_changes_less(old: list, new: list) -> None:
    assert cost(old, new, aligned(old, new, same)) == least_cost(old, new)


@st.composite
def edited(draw: st.DrawFn) -> tuple[list, list]:
    """A list and the same with other items in its middle."""
    begin, end = (draw(OPEN_ITEMS.filter(lambda items: 1 <= len(items) <= 2)) for _ in range(2))
    middles = (draw(OPEN_ITEMS.filter(lambda items: len(items) <= 2)) for _ in range(2))
    old, new = ([*begin, *middle, *end] for middle in middles)
    return old, new


@given(edited())
def test_no_other_alignment_of_an_edited_list_changes_less(lists: tuple[list, list]) -> None:
    assert cost(*lists, aligned(*lists, same)) == least_cost(*lists)


def test_no_other_alignment_of_any_short_lists_changes_less() -> None:
    items = [{"a": 0, "b": 0}, {"a": 0, "b": 1}, {"a": 1, "b": 1}]
    lists = [list(some) for length in range(5) for some in product(items, repeat=length)]
    for old in (some for some in lists if len(some) < 4):
        for new in lists:
            assert cost(old, new, aligned(old, new, same)) == least_cost(old, new), (old, new)


HEAD = "bodies: []\njoints: []\nvehicles: [V]\nV:\n  name: v\n  chassis: BODY c\n"
STYLES = {
    "blocks": "  wheels:\n  # the first\n  - body: A   # left\n    width: 0.10\n    radius: 0.50\n    mine: {kept: yes}\n"
    "  - body: B\n    radius: 0.5\n  - body: C\n    radius: 0.5\n",
    "dashes": "  wheels:\n    -\n      body: A   # left\n      width: 0.10\n      radius: 0.50\n      mine: {kept: yes}\n"
    "    -\n      body: B\n      radius: 0.5\n    -\n      body: C\n      radius: 0.5\n",
    "flow": "  wheels: [{body: A, width: 0.10, radius: 0.50, mine: {kept: yes}}, {body: B, radius: 0.5}, {body: C, radius: 0.5}]\n",
}  # fmt: skip


@pytest.mark.parametrize("style", STYLES)
@given(
    st.lists(
        st.fixed_dictionaries({"body": st.sampled_from("ABCDE"), "radius": st.sampled_from([0.5, 0.25])}),
        min_size=1, max_size=5,
    )
)  # fmt: skip
def test_a_list_states_what_is_wanted_and_keeps_what_the_editor_does_not_hold(
    style: str, tmp_path_factory: pytest.TempPathFactory, wanted: list
) -> None:
    folder = tmp_path_factory.mktemp("list")
    (folder / "m.yaml").write_text(HEAD + STYLES[style])
    document = read_any(folder / "m.yaml", Resolver([folder]))
    item = items_of(document)[0]
    new = Item(item.kind, item.key, {**item.values, "wheels": tuple(wanted)}, unheld=frozenset({"wheels[].width"}))
    text = updated(document.text, "model", document.top.given(), [new])
    wheels = plain(parse(text, Path("m.yaml")))["V"]["wheels"]
    assert [(w["body"], float(w["radius"])) for w in wheels] == [(w["body"], w["radius"]) for w in wanted]
    if wanted[0] == {"body": "A", "radius": 0.5}:
        assert wheels[0]["mine"] == {"kept": "yes"} and wheels[0]["width"] == "0.10" and wheels[0]["radius"] == "0.50"


def test_an_aliased_item_is_spelled_out_only_where_it_changes(tmp_path: Path) -> None:
    wheels = "  wheels:\n  - &w {body: A, radius: 0.50, mine: 1}\n  - *w\n  - *w\n"
    (tmp_path / "m.yaml").write_text(HEAD + wheels)
    document = read_any(tmp_path / "m.yaml", Resolver([tmp_path]))
    item = items_of(document)[0]
    new = [dict(w) for w in item.values["wheels"]]
    new[1]["radius"] = 0.25
    changed = Item(item.kind, item.key, {**item.values, "wheels": tuple(new)})
    text = updated(document.text, "model", document.top.given(), [changed])
    assert (
        text
        == HEAD + "  wheels:\n  - &w {body: A, radius: 0.50, mine: 1}\n  - {body: A, radius: 0.25, mine: 1}\n  - *w\n"
    )
