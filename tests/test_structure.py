"""No package, and no module, imports itself through others, types included."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.bench.structure import Arrows, arrows, circles, imports, layers, reached, sources
from tests.bench.walks import Walk, returns, stretches

MODULES = sources(".")


@pytest.mark.parametrize("of_packages", [True, False], ids=["packages", "modules"])
def test_imports_run_in_no_circle(of_packages: bool) -> None:
    graph = arrows(MODULES, of_packages, with_types=True)
    assert sum(map(len, graph.values())) > 100
    assert circles(graph) == set()


def test_imports_are_found_wherever_they_stand() -> None:
    text = """
from typing import TYPE_CHECKING
import os, a.b
from a import c, f
if TYPE_CHECKING:
    from a.d import D
else:
    from a.d import E
def g():
    from a.e import x
"""
    found = list(imports(text, {"a", "a.b", "a.c", "a.d", "a.e"}))
    assert found == [("a.b", False), ("a.c", False), ("a", False), ("a.d", True), ("a.d", False), ("a.e", False)]


@st.composite
def graphs(draw: st.DrawFn) -> Arrows:
    names = "abcdef"[: draw(st.integers(1, 6))]
    return {name: set(draw(st.sets(st.sampled_from(names)))) - {name} for name in names}


def walks(graph: Arrows, begin: str, seen: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """All ways from ``begin`` that meet nothing twice."""
    yield (*seen, begin)
    for name in graph[begin] - {*seen, begin}:
        yield from walks(graph, name, (*seen, begin))


@given(graphs())
def test_who_is_in_a_circle_comes_back_to_itself(graph: Arrows) -> None:
    back = {way[0] for name in graph for way in walks(graph, name) if name in graph[way[-1]]}
    found = circles(graph)
    assert {name for group in found for name in group} == back
    for group in found:
        assert all(other in reached(graph, name) for name in group for other in group - {name})


@given(graphs())
def test_what_imports_stands_over_what_it_imports_but_in_circles(graph: Arrows) -> None:
    heights, groups = layers(graph), circles(graph)
    for begin, ends in graph.items():
        for end in ends:
            assert any({begin, end} <= group for group in groups) or heights[begin] > heights[end]


def test_a_walk_notes_functions_when_they_are_called_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "one.py").write_text("import two\ndef f():\n    two.g()\n    h()\n    two.g()\ndef h(): two.k()\n")
    (tmp_path / "two.py").write_text("def g(): return [x for x in 'ab']\ndef k(): pass\n")
    monkeypatch.syspath_prepend(tmp_path)
    one = importlib.import_module("one")
    found = Walk(tmp_path).follow(one.f)
    assert found == [("one", "f"), ("two", "g"), ("one", "h"), ("two", "k")]
    assert stretches(found) == ["one", "two", "one", "two"]
    assert returns(stretches(found)) == {"one": 1, "two": 1}
