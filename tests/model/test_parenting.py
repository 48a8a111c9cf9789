"""Parents of mounted objects: any object of any file, found when it arrives, and never the object itself."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from ligature.model.parenting import ARRIVAL, Arrivals

KINDS = st.sampled_from(["camera", "light", "body", "ghost"])


@given(st.lists(KINDS, min_size=2, max_size=5), st.data())
def test_a_parent_is_found_by_its_name_in_whichever_order_files_and_objects_come(
    kinds: list[str], data: st.DataObject
) -> None:
    names = [f"/env/{chr(97 + k)}{k}" for k in range(len(kinds))]
    parents = [
        data.draw(st.sampled_from([k for k in range(len(kinds)) if k != own] + [None])) for own in range(len(kinds))
    ]
    in_full = [data.draw(st.booleans()) for _ in kinds]
    order = data.draw(st.permutations(range(len(kinds))))
    cut = data.draw(st.integers(0, len(kinds)))
    arrivals = Arrivals()
    for k, parent in enumerate(parents):
        text = "" if parent is None else names[parent] if in_full[k] else names[parent][-2:]
        arrivals.wait(kinds[k], k, names[k], text, None)
    for file in (order[:cut], order[cut:]):
        arrivals.enter([(kinds[k], k, names[k], names[k]) for k in file])
    arrivals.report_orphans()
    assert arrivals.parents == {(kinds[k], k): (kinds[p], p) for k, p in enumerate(parents) if p is not None}
    assert not arrivals.waiting
    incomplete = {(d.message) for d in arrivals.diagnostics}
    assert all("is incomplete; using" in message for message in incomplete)
    if all(in_full):
        assert not incomplete


def entered(*objects: tuple[str, str], waiting: str) -> Arrivals:
    """Objects, kind and name each, of which the last comes in a file of its own and waits for ``waiting``."""
    arrivals = Arrivals()
    *before, last = [(kind, k, name, name) for k, (kind, name) in enumerate(objects)]
    arrivals.enter(before)
    arrivals.wait(*last[:3], waiting, None)
    arrivals.enter([last])
    arrivals.report_orphans()
    return arrivals


def test_a_name_that_two_objects_have_before_it_is_needed_is_ambiguous() -> None:
    for two in ("camera", "light"):
        arrivals = entered(("camera", "/a/x"), (two, "/b/x"), ("ghost", "/g"), waiting="x")
        assert arrivals.parents == {}
        assert [d.message for d in arrivals.diagnostics] == ["'/g' has the parent 'x', which is missing or ambiguous"]


def test_an_exact_name_beats_one_that_holds_it() -> None:
    arrivals = entered(("body", "/a/xy"), ("body", "x"), ("ghost", "/g"), waiting="x")
    assert arrivals.parents == {("ghost", 2): ("body", 1)}


def test_kinds_arrive_in_their_order_and_names_within_them() -> None:
    arrivals = Arrivals()
    objects = [
        (kind, k, name, name)
        for k, (kind, name) in enumerate((kind, name) for kind in reversed(ARRIVAL) for name in "ba")
    ]
    arrivals.enter(objects)
    assert list(arrivals.known) == list(ARRIVAL)
    assert all([name for name, _ in known] == ["a", "b"] for known in arrivals.known.values())


def test_a_name_in_part_is_reported_with_the_object_that_was_taken() -> None:
    arrivals = Arrivals()
    arrivals.wait("ghost", 0, "/g", "x", None)
    arrivals.enter([("ghost", 0, "/g", "g"), ("body", 0, "/a/x", "x")])
    assert [d.message for d in arrivals.diagnostics] == ["parent 'x' is incomplete; using '/a/x'"]
