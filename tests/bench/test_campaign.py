"""Campaigns over seeds go on where they were broken off, and seeds draw what they say."""

from __future__ import annotations

from pathlib import Path

import ligature
import pytest
from ligature.tasks.wounds import Wound

from tests.bench import campaign, knot_seeds, tissue_seeds


def test_the_newest_row_of_a_seed_counts(tmp_path: Path) -> None:
    file = tmp_path / "new" / "rows.jsonl"
    assert campaign.read(file, "seed") == {}
    for row in ({"seed": 1, "n": 2, "a": 0}, {"seed": 2, "n": 2, "a": 1}, {"seed": 1, "n": 2, "a": 2}):
        campaign.keep(file, row)
    assert {key: row["a"] for key, row in campaign.read(file, "n", "seed").items()} == {(2, 1): 2, (2, 2): 1}


@pytest.mark.parametrize("seed", [1, 2, 5])
def test_a_knots_seed_draws_wound_and_tissue(seed: int, tmp_path: Path) -> None:
    scene = knot_seeds.scene_of(seed, tmp_path)
    width, youngs = tissue_seeds.drawn(seed)
    tissue = scene.bodies[scene.tissues[0].body].tissue
    assert tissue is not None
    assert tissue.materials[0].youngs == pytest.approx(youngs, rel=0.101)
    simulation = ligature.Simulation(scene)
    assert Wound.of(scene).gap(simulation.state[0], 0.0) == pytest.approx(width, abs=2e-5)
    simulation.close()
