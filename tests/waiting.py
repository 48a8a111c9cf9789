"""Waits for conditions, for tests of what runs beside them: a wait ends when the condition holds, a sleep never knows."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

Value = TypeVar("Value")


def until(condition: Callable[[], Value], what: Any = "", seconds: float = 40.0, every: float = 0.01) -> Value:
    """Wait for ``condition`` to hold; returns what it returned.

    ``what`` names it for who reads the failure, or returns what is to be read then.
    """
    deadline = time.monotonic() + seconds
    while not (found := condition()):
        if time.monotonic() >= deadline:
            raise AssertionError(f"not within {seconds:g} s: {(what() if callable(what) else what) or condition}")
        time.sleep(every)
    return found


def steady(
    read: Callable[[], Any], span: float = 0.2, within: float = 1e-6, what: str = "", seconds: float = 20.0
) -> np.ndarray:
    """Wait until what ``read`` returns stays within a tolerance for ``span`` seconds; returns it."""
    deadline = time.monotonic() + seconds
    first, since = np.array(read()), time.monotonic()
    while time.monotonic() < since + span:
        assert time.monotonic() < deadline, f"not at rest within {seconds:g} s: {what or read}"
        time.sleep(0.01)
        now = np.array(read())
        if np.abs(now - first).max() > within:
            first, since = now, time.monotonic()
    return first


def stays(condition: Callable[[], Any], what: str = "", seconds: float = 0.2) -> None:
    """Check all the while that ``condition`` holds, for what must not happen."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        assert condition(), f"no longer: {what or condition}"
        time.sleep(0.01)
