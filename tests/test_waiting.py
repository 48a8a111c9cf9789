"""The waits that other tests rely on: each fails on what it is there to find."""

from __future__ import annotations

import re
import threading
import time
from pathlib import Path

import pytest

from tests.waiting import stays, steady, until

HERE = Path(__file__).parent


def later(seconds: float) -> threading.Event:
    """An event that is set after some seconds."""
    event = threading.Event()
    threading.Timer(seconds, event.set).start()
    return event


def test_a_wait_ends_with_its_condition_and_names_it_when_time_is_up() -> None:
    begin, event = time.monotonic(), later(0.1)
    assert until(event.is_set)
    assert 0.09 < time.monotonic() - begin < 5.0
    with pytest.raises(AssertionError, match=r"not within 0.05 s: pigs fly"):
        until(lambda: False, "pigs fly", 0.05)
    seen: list[int] = []
    with pytest.raises(AssertionError, match=r"not within 0.05 s: asked [2-9] times"):
        until(lambda: seen.append(0), lambda: f"asked {len(seen)} times", 0.05)


def test_what_still_moves_is_not_steady() -> None:
    begin, event = time.monotonic(), later(0.1)
    assert steady(lambda: 1.0 if event.is_set() else time.monotonic(), 0.1) == 1.0
    assert time.monotonic() - begin >= 0.19
    with pytest.raises(AssertionError, match="not at rest within"):
        steady(time.monotonic, 0.1, seconds=0.3)
    assert steady(lambda: [0.0, 1e-9 * time.monotonic()], 0.05)[0] == 0.0


def test_what_must_stay_may_not_end() -> None:
    stays(lambda: True, seconds=0.05)
    event = later(0.05)
    with pytest.raises(AssertionError, match="no longer: quiet"):
        stays(lambda: not event.is_set(), "quiet", 5.0)


MOST_SLEEPS = 82
"""Calls of `sleep` outside benches and `tests.waiting`. They pace what a test sends, or let a span pass that a claim is about; whoever
waits for something uses `until`, `steady` or `stays`. Lower it when one goes."""


def sleeps(text: str) -> int:
    """Calls of `sleep` in a text, also in programs that it holds as strings; simulated time that passes is a condition."""
    return len(re.findall(r"(?<!def )(?<!stage\.)\bsleep\(", text))


def test_no_test_sleeps_where_it_could_wait() -> None:
    files = [
        path
        for path in HERE.rglob("*.py")
        if "bench" not in path.parts and path.stem not in ("waiting", "test_waiting")
    ]
    count = {path.relative_to(HERE).as_posix(): sleeps(path.read_text(encoding="utf-8")) for path in files}
    assert sum(count.values()) <= MOST_SLEEPS, {name: number for name, number in count.items() if number}


def test_sleeps_are_counted() -> None:
    assert sleeps("import time\ntime.sleep(1)\nprogram = 'while True: sleep(0.1)'\n") == 2
    assert sleeps("def sleep(self): ...\nstage.sleep(0.1)\nasleep(1)\n") == 0
