"""Every place that opens a stranger's file is fuzzed: read from the source, so that a new reader is not forgotten."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.fuzz.openers import OURS, STRANGERS, places
from tests.fuzz.readers import READERS
from tests.fuzz.seeds import seeds

FUZZED = {reader.kind for reader in READERS} | {Path(seed.name).suffix for seed in seeds()}


def test_every_place_that_opens_a_file_is_known() -> None:
    assert places() == STRANGERS.keys() | OURS.keys()


def test_no_place_is_both() -> None:
    assert not STRANGERS.keys() & OURS.keys()


@pytest.mark.parametrize("place", STRANGERS)
def test_what_strangers_write_is_fuzzed(place: str) -> None:
    assert STRANGERS[place]
    assert set(STRANGERS[place]) <= FUZZED


def test_every_corpus_is_that_of_a_place() -> None:
    assert {kind for kinds in STRANGERS.values() for kind in kinds} == FUZZED
