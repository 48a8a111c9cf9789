"""The tests of `inside` in the Blender binary, which takes seconds to start: one for all files."""

from __future__ import annotations

from collections.abc import Callable

import pytest

# under a minute on an idle machine
pytestmark = pytest.mark.timeout(900)


LONG = ("test_changes.py", "test_ending.py", "test_outside.py", "test_quality.py", "test_random_scenes.py")
"""What `make test` runs in the newest Blender alone (`test_in_module`); `make test-slow` runs it in this one too."""


def test_the_add_on_holds_in_blender(blender: Callable[..., str]) -> None:
    output = blender(".", *(f"--ignore={file}" for file in LONG))
    assert " passed" in output and " failed" not in output


@pytest.mark.slow
def test_what_takes_long_holds_in_blender(blender: Callable[..., str]) -> None:
    output = blender(*LONG)
    assert " passed" in output and " failed" not in output


@pytest.mark.slow
@pytest.mark.parametrize("file", ["test_changes.py", "test_outside.py", "test_roundtrip.py"])
def test_every_real_file_is_changed_and_exported_safely(
    blender: Callable[..., str], monkeypatch: pytest.MonkeyPatch, file: str
) -> None:
    monkeypatch.setenv("LIGATURE_WHOLE_CORPUS", "1")
    assert " passed" in blender(file)
