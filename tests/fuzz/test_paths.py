"""A few of the random paths that `make fuzz` tries, and that the judge sees what it is there to see."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.fuzz import paths


@pytest.mark.parametrize("number", range(12))
def test_needle_follows_a_random_path_through_tissue(number):
    assert paths.fault_of(paths.drive(number)) == ""


def test_paths_are_of_every_kind():
    drives = [paths.drive(number) for number in range(200)]
    assert sum(d.radius > 0 for d in drives) > 60
    assert sum(d.twist != 0 for d in drives) > 60
    assert sum(d.back > 1 for d in drives) > 40
    for name, low, high in (("angle", 0.3, 1.4), ("depth", 3e-3, 2e-2), ("speed", 4e-3, 0.1), ("mass", 1e-5, 1e-4)):
        values = np.array([getattr(d, name) for d in drives])
        assert values.min() < low < high < values.max(), name


def _through(number=0):
    """A trial whose needle stands straight in the tissue."""
    drive = replace(
        paths.drive(number), radius=0.0, length=0.03, angle=np.pi / 2, curvature=0.0, twist=0.0, back=0.0, depth=8e-3,
        speed=0.04, mass=1e-4, stiffness=3000.0, at=(0.02, 0.015), material=paths.TissueMaterial(1e5),
    )  # fmt: skip
    trial = paths.Trial(drive)
    assert trial.run() == ""
    return trial


def test_length_inside_is_that_which_the_tissue_says():
    trial = _through()
    assert trial.inside() == pytest.approx(trial.needle.needle.depth, abs=1e-3)
    assert trial.inside() > 6e-3


def test_a_lost_passage_and_a_leap_are_found():
    trial = _through()
    trial.needle.needle.withdraw()
    trial._judge(trial.needle.tip, trial.block.positions, 0)
    assert trial.fault.startswith("lost")
    trial = _through()
    trial._judge(trial.needle.tip + [6e-4, 0.0, 0.0], trial.block.positions, 0)
    assert "tip leaps" in trial.fault
    trial = _through()
    trial._judge(trial.needle.tip, trial.block.positions + [0.0, 3e-3, 0.0], 1)
    assert "tissue leaps" in trial.fault
    trial = _through()
    trial.block.elastic.x[0] = np.nan
    trial._judge(trial.needle.tip, trial.block.positions, 1)
    assert trial.fault == "not finite"
