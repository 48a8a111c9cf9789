"""A change is judged on the same examples, whatever else the process has loaded."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from tests.conftest import ROOT

DRAW = """
import importlib, json, sys
import tests.conftest
for name in sys.argv[1:]:
    importlib.import_module(name)
from hypothesis import given, settings, strategies as st
drawn = []
@settings(max_examples=300, derandomize=True, database=None)
@given(st.integers(), st.floats(), st.text())
def draw(whole, real, text):
    drawn.append(repr((whole, real, text)))
draw()
print(json.dumps(drawn))
"""


@pytest.mark.parametrize("profile", ["same", "new"])
def test_what_else_is_loaded_does_not_change_the_examples_of_make_test(
    profile: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LIGATURE_EXAMPLES", profile)

    def drawn(*modules: str) -> list[str]:
        run = subprocess.run(
            [sys.executable, "-c", DRAW, *modules], cwd=ROOT, capture_output=True, text=True, check=True, timeout=120
        )
        return json.loads(run.stdout)  # type: ignore[no-any-return]

    alone, beside = drawn(), drawn("ligature.model.frames", "ligature.adf.schema")
    assert len(alone) >= 300
    assert (alone == beside) == (profile == "same")
