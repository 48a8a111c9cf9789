"""A page of recorded runs: a slider goes through their time, curves of all of them lie over each other.

Metres, seconds of simulated time since a recording begins.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray
from viser import uplot

from ligature.cockpit.address import Address
from ligature.cockpit.curves import COLOURS, LEAST, PADDING, charts_of, scales_of, span_of
from ligature.cockpit.gate import Gate
from ligature.cockpit.page import look_from, serve
from ligature.cockpit.stage import Stage, first_view
from ligature.model.frames import pose7_matrix
from ligature.model.scene import ArmKind, Scene
from ligature.robots.fitting import base_pose

PERIOD = 0.05
"""Seconds between the states that are kept, and between turns of the page."""

MOST_STATES = 3000
"""Of a reel; every other one is dropped when there are more."""


class Reel:
    """States of a run at even times; `take` is called with each update's record (1,)."""

    def __init__(self, name: str, scene: Scene) -> None:
        self.name, self.scene = name, scene
        self.states: list[NDArray[np.void]] = []
        self.times: list[float] = []
        self._period, self._begin = PERIOD, 0.0

    def take(self, state: NDArray[np.void]) -> None:
        """Keep a state when it is time for one."""
        now = float(state["sim_time"][0])
        if not self.states:
            self._begin = now
        if self.states and now - self._begin < self.times[-1] + self._period * (1.0 - 1e-6):
            return
        self.states.append(state.copy())
        self.times.append(now - self._begin)
        if len(self.states) > MOST_STATES:
            self.states, self.times, self._period = self.states[::2], self.times[::2], 2.0 * self._period

    @property
    def duration(self) -> float:
        """Seconds that it covers."""
        return self.times[-1] if self.times else 0.0

    def at(self, when: float) -> NDArray[np.void]:
        """The state (1,) nearest to a time."""
        k = int(np.searchsorted(self.times, when))
        if k > 0 and (k == len(self.times) or when - self.times[k - 1] < self.times[k] - when):
            k -= 1
        return self.states[k]


def apart(scene: Scene, one: NDArray[np.void], other: NDArray[np.void]) -> list[tuple[str, float]]:
    """How far tips of instruments and the needle are apart in two states (1,): names and metres."""
    found = []
    for index, arm in enumerate(scene.arms):
        if arm.kind is ArmKind.PSM:
            tips = []
            for state in (one, other):
                T = base_pose(scene, arm) if arm.base < 0 else pose7_matrix(state["body_pose"][0, arm.base])
                tips.append((T @ pose7_matrix(state["arm"][0, index]["local_measured_cp"]))[:3, 3])
            found.append((arm.name, float(np.linalg.norm(tips[0] - tips[1]))))
    for needle in scene.needles[:1]:
        places = [state["body_pose"][0, needle.body, :3] for state in (one, other)]
        found.append(("needle", float(np.linalg.norm(places[0] - places[1]))))
    return found


class ReplayPage:
    """Serves ``reels`` of one scene; raises ValueError where they are of different scenes."""

    def __init__(self, reels: Sequence[Reel], address: Address, token: str, warn: Callable[[str], None]) -> None:
        first = reels[0]
        for other in reels[1:]:
            if other.states[0].dtype != first.states[0].dtype:
                raise ValueError(
                    f"'{other.name}' is of another scene than '{first.name}'; compare two runs of one scene"
                )
        self._reels, self._address = list(reels), address
        self.server = serve(address, Gate(address, token, warn))
        gui = self.server.gui
        look_from(self.server, *first_view(first.scene, first.states[0]))
        self._stage = Stage(self.server, first.scene)
        self.duration = max(reel.duration for reel in reels)
        names = [reel.name for reel in reels]
        self._words = gui.add_html("")
        self._time: Any = gui.add_slider("Time, s", 0.0, max(round(self.duration, 2), PERIOD), PERIOD, 0.0)
        self._play: Any = gui.add_checkbox("Play", False)
        self._shown: Any = gui.add_dropdown("Shown", tuple(names), initial_value=names[0])
        panel = gui.add_panel()
        with panel.add_tab("Curves"):
            self._draw_charts()
        panel.dock_left()
        panel.set_width(420)
        self._last: tuple[float, str] | None = None
        self._clock = time.monotonic()

    @property
    def url(self) -> str:
        """What to open in a browser."""
        return Address(self._address.host, self.server.get_port()).url

    def _draw_charts(self) -> None:
        """Every curve of every run, over the time since its recording begins."""
        gui, scene = self.server.gui, self._reels[0].scene
        times = np.unique(np.concatenate([reel.times for reel in self._reels]))
        for title, names, values in charts_of(scene):
            if not names:
                continue
            rows, series = [], [uplot.Series(label="s")]
            for reel in self._reels:
                kept = np.array([values(state[0]) for state in reel.states]).reshape(len(reel.states), -1)
                for i, name in enumerate(names):
                    label = name if len(self._reels) == 1 else f"{name}, {reel.name}"
                    colour = COLOURS[(len(series) - 1) % len(COLOURS)]
                    series.append(uplot.Series(label=label, stroke=colour, width=2, points={"show": False}))
                    rows.append(np.interp(times, reel.times, kept[:, i], right=np.nan))
            span = span_of(np.nan_to_num(np.array(rows)), LEAST[title])
            gui.add_uplot(
                (times, *rows), tuple(series), title=title, height=170, scales=scales_of(span), padding=PADDING,
                legend=uplot.Legend(show=len(rows) > 1, live=False),
            )  # fmt: skip

    def turn(self) -> None:
        """Show the state at the slider; advance while playing."""
        now = time.monotonic()
        if self._play.value:
            there = float(self._time.value) + now - self._clock
            if there >= self.duration:
                self._play.value = False
            self._time.value = round(min(there, self._time.max), 3)
        self._clock = now
        wanted = (float(self._time.value), str(self._shown.value))
        if wanted != self._last:
            self._last = wanted
            self._show(*wanted)
        time.sleep(PERIOD)

    def _show(self, when: float, name: str) -> None:
        reel = next(reel for reel in self._reels if reel.name == name)
        state = reel.at(when)
        self._stage.update(state)
        words = [f"{name}: {when:.2f} s of {reel.duration:.2f} s"]
        if len(self._reels) > 1:
            one, other = (reel.at(when) for reel in self._reels[:2])
            words.append("apart: " + ", ".join(f"{n} {1e3 * d:.1f} mm" for n, d in apart(reel.scene, one, other)))
        self._words.content = (
            '<div id="replay" style="padding:4px 8px;font-size:13px">'
            + "<br>".join(escape(word) for word in words)
            + "</div>"
        )

    def close(self) -> None:
        """End the page."""
        self.server.stop()
