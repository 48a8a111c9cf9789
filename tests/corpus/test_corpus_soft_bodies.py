"""Soft bodies in the files of others: they load and run."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature import Simulation
from ligature.adf import Severity


@pytest.mark.parametrize("name", ["cloth", "cloth2"])
def test_a_mat_that_hangs_by_a_corner_swings_for_a_second(corpus: Path, name: str) -> None:
    path = corpus / "multibodies" / "descriptions" / "multi-bodies" / "sb" / f"{name}.yaml"
    scene = ligature.load(path)
    assert not [d for d in scene.diagnostics if d.severity >= Severity.ERROR]
    (tissue,) = scene.tissues
    assert len(tissue.form.pins.nodes) == 1 and tissue.form.cell_masses.sum() == pytest.approx(1.0)
    simulation = Simulation(scene)
    start = simulation.state["tissue_node"][0].copy()
    corner = tissue.form.pins.positions(start)
    simulation.step(1000)
    after = simulation.state["tissue_node"][0]
    assert np.isfinite(after).all()
    np.testing.assert_allclose(tissue.form.pins.positions(after), corner, atol=5e-3)
    fallen = start[:, 2].mean() - after[:, 2].mean()
    assert 0.2 < fallen < 4.9  # less than in free fall
    assert np.abs(after - corner).max() < 4.0  # a mat of 0.8 m x 1.35 m, and of 2 kPa
