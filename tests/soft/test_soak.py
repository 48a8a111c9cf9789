"""The pad of `soft_suturing` under minutes of random arms, needle and thread, and that its judge sees what is wrong."""

from __future__ import annotations

import pytest

from tests.bench.tissue_soak import WARM, Findings, soak


def test_slow_ticks_and_a_pad_that_does_not_recover_are_found():
    sound = Findings(ticks=[0.05] + [1e-3] * 500, aside=5e-5)
    assert sound.faults == []
    assert Findings(ticks=[1e-3] * WARM + [0.011], aside=0.0).faults == [
        f"1 ticks above 10 ms, the longest 11.0 ms at {WARM}"
    ]
    assert "0.200 mm beside its place" in Findings(aside=2e-4).faults[0]
    assert Findings().faults, "a run that never ended is no success"


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_a_pad_recovers_from_five_minutes_of_random_arms_needle_and_thread(seed):
    found = soak(300.0, seed)
    assert found.faults == [], found.line()
    assert found.pierced > 1000 and found.most_force > 1.0, "little happened"
