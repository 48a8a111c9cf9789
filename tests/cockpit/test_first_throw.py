"""A newcomer's first throw by the page alone, in a real browser: what it offers is pressed, and a needle is in tissue."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.cockpit.conftest import ROOT, Newcomer, Person, Served

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]


@pytest.fixture(scope="module")
def tissue() -> Iterator[Served]:
    running = Served(scene=ROOT / "scenes" / "needle_insertion" / "launch.yaml")
    yield running
    running.end()


def test_a_newcomer_drives_a_needle_through_tissue_by_the_page_alone(tissue: Served, person: Person) -> None:
    person.opens(tissue.url)
    one = Newcomer(tissue, person)
    for identity in ("lig-start", "lig-swap", "lig-pick", "lig-bring"):
        one.presses(identity)
    one.waits_for("lig-drive")
    assert one.punctures == 0
    one.pulls("lig-drive", 0.0, 0.5)
    one.waits_until(lambda: one.punctures == 1, "the needle is in the tissue")
    one.pulls("lig-drive", 0.5, 1.0)
    one.waits_until(lambda: "through the tissue" in one.words, "the needle is through")
    assert one.punctures == 2
