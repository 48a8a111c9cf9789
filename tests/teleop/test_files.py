"""The teleoperation files that come with the scenes, and the one in the documentation, are right."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from ligature.cli.main import app
from ligature.teleop.config import from_text, read
from typer.testing import CliRunner

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("file", sorted(ROOT.glob("scenes/*/teleop.yaml")), ids=lambda path: path.parent.name)
def test_a_scene_s_file_is_read(file: Path) -> None:
    assert read(file).pairs


def test_the_file_of_the_documentation_is_read() -> None:
    page = ROOT / "docs" / "teleoperation.md"
    block = re.search(r"```yaml\n(camera.*?)```", page.read_text("utf-8"), re.DOTALL)
    assert block is not None
    config = from_text(block[1], page)
    assert config.pairs == {"pen": ("PSM1", "PSM2"), "left": ("PSM2", "PSM1"), "pad": ("PSM1", "PSM2")}
    assert config.waiting == {"pad"}


def test_the_command_reports_what_a_file_states_and_what_is_wrong(tmp_path: Path) -> None:
    good = CliRunner().invoke(app, ["teleop", str(ROOT / "scenes/suturing_small/teleop.yaml"), "--check"])
    assert good.exit_code == 0
    assert "MTMR (mtm) drives PSM1, PSM2" in good.output
    (tmp_path / "bad.yaml").write_text("devices: {a: {kind: glove}}\npairs: {a: PSM1}\n")
    bad = CliRunner().invoke(app, ["teleop", str(tmp_path / "bad.yaml"), "--check"])
    assert bad.exit_code == 1
    assert "bad.yaml:1:21: error: device a has the unknown kind 'glove'" in bad.output
