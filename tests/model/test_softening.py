"""Rigid bodies that a user wants soft."""

from __future__ import annotations

from pathlib import Path

import ligature
import pytest
from ligature.adf import Severity
from ligature.cli.options import RunOptions
from ligature.model.material import MATERIALS

RIGID = """
bodies: [BODY Pad, BODY Other]
joints: []
BODY Pad:
  name: Phantom
  mass: 0.0
  shape: BOX
  geometry: {x: 0.06, y: 0.04, z: 0.01}
BODY Other:
  name: Other
  mass: 0.0
  shape: BOX
  geometry: {x: 0.06, y: 0.04, z: 0.01}
"""


@pytest.mark.parametrize("name", ["BODY Pad", "Pad", "Phantom"])
@pytest.mark.parametrize(("material", "expected"), [("", "silicone pad"), ("=liver", "liver")])
def test_a_body_is_soft_by_key_or_name(tmp_path: Path, name: str, material: str, expected: str) -> None:
    (tmp_path / "m.yaml").write_text(RIGID)
    assert not ligature.load(tmp_path / "m.yaml").tissues
    options = RunOptions(str(tmp_path / "m.yaml"), soft=(name + material,))
    scene = RunOptions.from_text(options.to_text()).load()
    (tissue,) = scene.tissues
    assert not [d for d in scene.diagnostics if d.severity >= Severity.ERROR]
    assert tissue.body == 0
    assert tissue.form.materials == (MATERIALS[expected],)


def test_what_the_file_states_of_tissue_holds(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(
        RIGID.replace("  name: Phantom\n", "  name: Phantom\n  ligature tissue: {youngs modulus: 5000}\n")
    )
    (tissue,) = ligature.load(tmp_path / "m.yaml", soft=["Pad"]).tissues
    assert tissue.form.materials[0].youngs == 5000.0


def test_wrong_names_are_reported(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(RIGID)
    found = ligature.load(tmp_path / "m.yaml", soft=["Table"]).diagnostics
    assert any("no body is called 'Table'" in d.message for d in found)
    with pytest.raises(ValueError, match="'jelly' is not a known material"):
        ligature.load(tmp_path / "m.yaml", soft=["Pad=jelly"])
