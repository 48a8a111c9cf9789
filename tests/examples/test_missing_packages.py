"""An example that lacks a package ends with a line that says what to install, not with a traceback."""

from __future__ import annotations

import runpy
import sys

import pytest

from tests.conftest import ROOT

LACKING = {
    "train_bc.py": ("torch", "'ligature-sim[learn,lerobot,train]'"), "train_sac.py": ("torch", "'ligature-sim[learn,train]'"),
    "scale_out.py": ("ray", "'ligature-sim[learn,train]' ray=="), "learning_curves.py": ("matplotlib", "matplotlib"),
}  # fmt: skip


@pytest.mark.parametrize("name", sorted(LACKING))
def test_an_example_says_what_to_install(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    module, install = LACKING[name]
    monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.syspath_prepend(ROOT / "examples")
    with pytest.raises(SystemExit) as left:
        runpy.run_path(str(ROOT / "examples" / name), run_name="__main__")
    message = str(left.value.code)
    assert module in message and f"run: pip install {install}" in message
