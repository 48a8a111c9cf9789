"""Live curves: thread tension, tip forces, insertion depth, task score, and how the task stands in words.

Newtons, millimetres, percent, seconds.
"""

from __future__ import annotations

import csv
import io
import math
from collections import deque
from collections.abc import Callable
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray
from viser import GuiApi, uplot

from ligature.model.scene import ArmKind, Scene
from ligature.tasks import Attempt, MissingBodies, Scenery, judge_suture
from ligature.tasks.scores import SUTURE_PAIRS

SPAN = 30.0
"""Seconds that a curve shows."""

SAMPLES = 10
"""Samples of a curve per second of simulated time."""

COLOURS = ("#4dabf7", "#ffa94d", "#69db7c", "#f783ac", "#b197fc")

SCORE = "task score, % of holes"

TENSION, FORCE, DEPTH, FACTOR = "thread tension, N", "tip force, N", "depth in tissue, mm", "real-time factor"

RANGES = {SCORE: (-5.0, 105.0)}
"""Axis ranges of charts whose values have bounds."""

LEAST = {TENSION: 0.1, FORCE: 0.1, DEPTH: 1.0, FACTOR: 1.0}
"""Least axis range of a chart, so that noise does not fill it."""

PADDING = (14, 10, 0, 0)
"""Pixels above, right of, below and left of a chart, so that its labels are seen as a whole."""

TOOLS = (
    '<div class="lig-tools"><button type="button" data-ligature="csv">Save as CSV</button>'
    '<button type="button" data-ligature="png">Save as picture</button></div>'
)
"""Buttons that our script obeys."""

Values = Callable[[Any], list[float]]


class Curves:
    """Collects values from states (one element of the record) and shows them as charts.

    ``task`` is what the run is judged by; without one it is a suture through all pairs of holes that the scene has.
    """

    def __init__(self, scene: Scene, task: str = "") -> None:
        self._attempt = _attempt(scene, task)
        pace: tuple[str, list[str], Values] = (FACTOR, ["physics"], lambda _: [self._factor])
        self._charts = [chart for chart in (*charts_of(scene), *_score(self._attempt), pace) if chart[1]]
        self._times: deque[float] = deque(maxlen=int(SPAN * SAMPLES))
        self._rows: deque[list[float]] = deque(maxlen=int(SPAN * SAMPLES))
        self._handles: list[Any] = []
        self._spans: list[tuple[float, float]] = []
        self._factor = 0.0
        self._sent = float("-inf")
        self._task: Any = None

    def show(self, gui: GuiApi) -> None:
        """Put the charts into the container of ``gui`` that is open."""
        self._task = gui.add_html("")
        gui.add_html(TOOLS)
        empty = np.zeros(1)
        for title, names, _ in self._charts:
            series = (uplot.Series(label="s"), *_series(names))
            span = RANGES.get(title) or span_of(empty, LEAST[title])
            self._spans.append(span)
            self._handles.append(
                gui.add_uplot(
                    (empty, *(empty for _ in names)), series, title=title, height=150, scales=scales_of(span),
                    padding=PADDING, legend=uplot.Legend(show=len(names) > 1, live=False),
                )
            )  # fmt: skip

    def observe(self, state: Any, factor: float = 0.0) -> None:
        """Take a state, and the real-time factor; a reset begins the task anew."""
        self._factor = factor
        if self._attempt is not None:
            self._attempt.observe(state)
        time = float(state["sim_time"])
        if not self._times or time - self._times[-1] >= 1.0 / SAMPLES:
            self._times.append(time)
            self._rows.append([value for _, _, values in self._charts for value in values(state)])

    def refresh(self, state: Any) -> None:
        """Send the curves and the words of the task."""
        words = self._words(state)
        if words != self._task.content:
            self._task.content = words
        if not self._times or self._times[-1] == self._sent:
            return
        self._sent = self._times[-1]
        times, rows = np.array(self._times), np.array(self._rows)
        column = 0
        for number, (handle, (title, names, _)) in enumerate(zip(self._handles, self._charts, strict=True)):
            span = RANGES.get(title) or span_of(rows[:, column : column + len(names)], LEAST[title])
            if span != self._spans[number]:
                self._spans[number], handle.scales = span, scales_of(span)
            handle.data = (times, *(rows[:, column + i] for i in range(len(names))))
            column += len(names)

    def table(self) -> str:
        """What the charts show, as CSV: a row for each sample."""
        names = [f"{title}: {name}" for title, names, _ in self._charts for name in names]
        rows = [
            ["time, s", *names],
            *([f"{t:.3f}", *(f"{v:.6g}" for v in row)] for t, row in zip(self._times, self._rows, strict=True)),
        ]
        text = io.StringIO()
        csv.writer(text).writerows(rows)
        return text.getvalue()

    def _words(self, state: Any) -> str:
        attempt = self._attempt
        if attempt is None:
            return '<div style="font-size:12px;padding:2px 8px">No suturing task in this scene.</div>'
        measures = attempt.monitor.measures()
        passages = [f"{'exit' if p.exit else 'entry'} {p.pair} ({1e3 * p.miss:.1f} mm)" for p in measures.passages[-6:]]
        lines = [f"holes: {', '.join(passages) or 'none yet'}"]
        if attempt.task == "insertion":
            lines += attempt.judge().lines()
        elif attempt.task == "suture":
            pairs = max(sum(p.exit for p in measures.passages), 1)
            poses = state["body_pose"]
            lines += judge_suture(attempt.monitor.scenery, poses, measures.passages, measures.time, pairs).lines()
        lines += measures.lines()
        return '<div style="font-size:12px;padding:2px 8px">' + "<br>".join(escape(line) for line in lines) + "</div>"


def span_of(values: NDArray[np.float64], least: float) -> tuple[float, float]:
    """Ends of an axis that shows ``values`` and zero, at round numbers, so that they seldom change."""
    low, high = min(float(np.min(values)), 0.0), max(float(np.max(values)), 0.0)
    return -_round_up(-low, 0.0), _round_up(high, least)


def _round_up(value: float, least: float) -> float:
    """The next of 1, 2, 5, 10 … of its power of ten above ``value``, and at least ``least``."""
    value = max(1.05 * value, least)
    if value <= 0.0:
        return 0.0
    power = 10.0 ** math.floor(math.log10(value))
    return float(next(power * step for step in (1.0, 2.0, 5.0, 10.0) if power * step >= value * (1.0 - 1e-9)))


def scales_of(span: tuple[float, float]) -> dict[str, uplot.Scale]:
    """Axes of a chart whose values lie in ``span``."""
    return {"x": uplot.Scale(time=False), "y": uplot.Scale(range=span)}


def _attempt(scene: Scene, task: str) -> Attempt | None:
    try:
        return Attempt(scene, task or "suture", min(len(Scenery.of(scene).entries), SUTURE_PAIRS))
    except MissingBodies:
        return None


def _score(attempt: Attempt | None) -> list[tuple[str, list[str], Values]]:
    """The share of the task's holes passed in their order; a pose estimation is judged by a report alone."""
    if attempt is None or attempt.task == "pose_estimation":
        return []
    return [(SCORE, [attempt.task], lambda _: [100.0 * attempt.progress])]


def _series(names: list[str]) -> list[uplot.Series]:
    return [
        uplot.Series(label=name, stroke=COLOURS[i % len(COLOURS)], width=2, points={"show": False})
        for i, name in enumerate(names)
    ]


def charts_of(scene: Scene) -> list[tuple[str, list[str], Values]]:
    """Title, names of the curves and their values."""
    threads = [(rod.name.rpartition("/")[2], list(rod.bodies)) for rod in scene.rods]
    arms = [(i, arm.name) for i, arm in enumerate(scene.arms) if arm.kind is ArmKind.PSM]
    needles = [needle.body for needle in scene.needles]

    def tension(state: Any) -> list[float]:
        return [round(float(np.abs(state["rod_tension"][bodies]).max()), 3) for _, bodies in threads]

    def forces(state: Any) -> list[float]:
        return [float(np.linalg.norm(state["arm"][i]["spatial_measured_cf"][:3])) for i, _ in arms]

    def depths(state: Any) -> list[float]:
        count = int(state["insertion_count"])
        depth, body = 1e3 * state["insertion_depth"][:count], state["insertion_body"][:count]
        on_needle = np.isin(body, needles)
        return [float(depth[chosen].max(initial=0.0)) for chosen in (on_needle, ~on_needle)]

    return [
        (TENSION, [name or f"thread {i}" for i, (name, _) in enumerate(threads, 1)], tension),
        (FORCE, [name for _, name in arms], forces),
        (DEPTH, ["needle", "thread"] if scene.holes or scene.tissues else [], depths),
    ]
