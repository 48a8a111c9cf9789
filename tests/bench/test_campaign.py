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


def test_a_campaign_runs_what_its_file_lacks(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, ran = tmp_path / "rows.jsonl", []

    def attempt(seed: int) -> campaign.Row:
        ran.append(seed)
        return {"seed": seed, "throws": 2, "success": seed != 3}

    def run(again: bool, *words: str, throws: int = 2) -> list[int]:
        ran.clear()
        given = campaign.arguments("").parse_args(words)
        given.again = again
        assert campaign.go_on(given, file, attempt, lambda rows: iter([f"{len(rows)} rows"]), throws=throws) == 0
        return list(ran)

    assert run(False, "2", "3") == [3, 4]
    assert run(False, "4", "2") == [2, 5], "the others are there"
    assert run(True, "4", "2") == [3], "it failed"
    assert run(False, "1", "2", throws=4) == [2], "another campaign in the same file"
    assert run(False, "9", "--table") == []
    assert capsys.readouterr().out.endswith("4 rows\n")


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
