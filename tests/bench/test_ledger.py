"""What `make bench` calls a loss."""

from __future__ import annotations

import json
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from tests.bench.ledger import LOSS, losses, note

RATIO = st.floats(0.01, 100.0)


@given(before=RATIO, factor=st.floats(0.5, 2.0))
def test_a_ratio_is_lost_when_it_grows_by_more_than_a_tenth(before: float, factor: float) -> None:
    release, now = ({"scenes": {"lab": {"ratio": value}}} for value in (before, before * factor))
    assert bool(losses(release, now)) == (before * factor > (1.0 + LOSS) * before)


def test_what_only_one_of_two_runs_measured_is_no_loss() -> None:
    assert losses({"a": {"ratio": 1.0}}, {"b": {"ratio": 9.0}}) == []
    assert losses({"a": {"tick_us": 1.0}}, {"a": {"tick_us": 9.0}}) == []


def test_every_benchmark_replaces_its_own_figures_alone(tmp_path: Path) -> None:
    path = tmp_path / "bench.json"
    for section, value in (("one", 1), ("two", 2), ("one", 3)):
        note(section, {"ratio": value}, path)
    assert json.loads(path.read_text()) == {"one": {"ratio": 3}, "two": {"ratio": 2}}
