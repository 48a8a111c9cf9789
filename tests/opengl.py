"""Tests that draw run where there is OpenGL."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from ligature.render import RenderUnavailable


@contextmanager
def opengl() -> Iterator[None]:
    """Skips the test where the machine has no OpenGL."""
    try:
        yield
    except RenderUnavailable as error:
        pytest.skip(str(error))
