"""The tests of `inside`, each file in a Blender of its own."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

# under a minute on an idle machine
pytestmark = pytest.mark.timeout(900)

INSIDE = Path(__file__).resolve().parent / "inside"


@pytest.mark.parametrize("file", sorted(p.name for p in INSIDE.glob("test_*.py")))
def test_the_add_on_holds_in_blender(blender: Callable[..., str], file: str) -> None:
    output = blender(file)
    assert " passed" in output and " failed" not in output


@pytest.mark.slow
@pytest.mark.parametrize("file", ["test_changes.py", "test_outside.py"])
def test_every_real_file_is_changed_and_exported_safely(
    blender: Callable[..., str], monkeypatch: pytest.MonkeyPatch, file: str
) -> None:
    monkeypatch.setenv("LIGATURE_WHOLE_CORPUS", "1")
    assert " passed" in blender(file)
