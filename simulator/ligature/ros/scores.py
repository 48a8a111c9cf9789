"""Waits for the score that a running simulator publishes."""

from __future__ import annotations

import time
from typing import Any

import rospy
from diagnostic_msgs.msg import DiagnosticStatus

from ligature.ros.start import start_node

LOOKING = 10.0
"""Seconds to look for a simulator that judges."""


def next_score(task: str, timeout: float) -> tuple[dict[str, object], dict[str, object]]:
    """The newest score of ``task`` and the newest measures, waiting ``timeout`` seconds for a report.

    Raises RuntimeError when no simulator judges the task, or no report comes.
    """
    start_node("ligature_score", several=True)
    scores: list[Any] = []
    measures: list[Any] = []
    root = f"/ligature/tasks/{task}"
    subscriber = rospy.Subscriber(f"{root}/score", DiagnosticStatus, scores.append, queue_size=10)
    rospy.Subscriber(f"{root}/measures", DiagnosticStatus, measures.append, queue_size=10)
    begin = time.monotonic()
    while not (scores and measures):
        waited = time.monotonic() - begin
        if subscriber.get_num_connections() == 0 and waited > LOOKING:
            raise RuntimeError(f"no simulator scores '{task}'; start it with 'ligature run … --task {task}'")
        if waited > timeout:
            raise RuntimeError(f"no one reported the end of '{task}' within {timeout:g} s")
        time.sleep(0.02)
    return _values(scores[-1]), _values(measures[-1])


def _values(status: Any) -> dict[str, object]:
    return {row.key: _value(row.value) for row in status.values}


def _value(text: str) -> object:
    """The value of a written ``text``: bool, int, float, or the text itself."""
    if text in ("True", "False"):
        return text == "True"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
