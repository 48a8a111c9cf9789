"""Numbers that no example can take are refused at once, with the options that they belong to."""

from __future__ import annotations

import re
import runpy
import sys
from pathlib import Path

import pytest

from tests.conftest import ROOT

NUMBER = re.compile(r'add_argument\(\s*"(--\w+)",\s*type=(?:int|float)(?!, choices)')
SCRIPTS = [path for path in sorted((ROOT / "examples").glob("*.py")) if NUMBER.search(path.read_text())]
POSITIONAL = {
    "record_dataset.py": ["a.h5"], "record_experts.py": ["a.h5"], "scale_out.py": ["reach", "a.onnx"],
    "train_bc.py": ["a", "a.onnx"], "train_sac.py": ["reach", "a.onnx"],
}  # fmt: skip


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_a_negative_number_is_refused_before_anything_begins(
    script: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(script.parent)
    for option in NUMBER.findall(script.read_text()):
        monkeypatch.setattr(sys, "argv", [str(script), *POSITIONAL.get(script.name, []), f"{option}=-1"])
        with pytest.raises(SystemExit) as left:
            try:
                runpy.run_path(str(script), run_name="__main__")
            except ModuleNotFoundError as error:
                pytest.skip(str(error))
        if "pip install" in str(left.value.code):
            pytest.skip(str(left.value.code))
        output = "".join(capsys.readouterr())
        assert left.value.code == 2 and option.lstrip("-") in output.splitlines()[-1], f"{option}: {output[-600:]}"
    assert list(tmp_path.iterdir()) == []
