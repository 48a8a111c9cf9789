"""``ligature evaluate``: how well a policy does in an environment, as a table, JSON and a page with pictures."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from PIL import Image
from rich.console import Console

from ligature import __version__
from ligature.cli.command import ending_in_order
from ligature.cli.evaluation_page import write_page
from ligature.environments import SuturingEnv
from ligature.environments.evaluation import MEASURES, UNITS, Episode, report, run_episode, run_episodes
from ligature.environments.goals import GOALS, Goal
from ligature.environments.policies import PolicyError, load_policy
from ligature.environments.workers import WorkerEndedError
from ligature.paths import check_folder
from ligature.render import RenderUnavailable
from ligature.render.files import write_json, write_png

REPORT, PAGE = "evaluation.json", "index.html"
"""Files of an evaluation."""

EVERY = 10.0
"""Seconds between two lines of progress."""


def evaluate(
    policy: str,
    options: Mapping[str, Any],
    seeds: range,
    max_steps: int | None,
    out: Path | None,
    pictures: int,
    jobs: int,
    console: Console,
) -> int:
    """Run the episodes, print the summary, write JSON and page below ``out``; returns the exit status."""
    try:
        steps = max_steps or GOALS.get(options["task"], Goal).steps
        load_policy(policy)  # what is wrong with it is reported before anything is simulated, as what is with `out`
        if out is not None:
            _check_new(out)
        with ending_in_order():
            episodes = _run(policy, options, seeds, steps, jobs, console)
        found = report(policy, options, episodes, __version__)
        files = [] if out is None else [write_json(found, out / REPORT)]  # first of all: hours may be in it
        _print(found["summary"], console)
        if out is not None:
            shown = _drawn(policy, options, episodes[:pictures], steps, out, console)
            files.append(write_page(found, shown, out / PAGE))
            console.print("\n".join(map(str, files)), markup=False)
    except (PolicyError, ValueError, RenderUnavailable, WorkerEndedError) as error:
        console.print(str(error), style="red", markup=False)
        return 2
    return 0


def _check_new(out: Path) -> None:
    """Raise OSError for a folder that cannot be written, and ValueError for one that has an evaluation."""
    check_folder(out)
    for name in (REPORT, PAGE):
        if (out / name).exists():
            raise ValueError(f"'{out / name}' exists already; choose another folder")


def _drawn(
    policy: str, options: Mapping[str, Any], episodes: list[Episode], max_steps: int, out: Path, console: Console
) -> list[tuple[int, list[Path]]]:
    """Pictures of episodes; none, and a line with the reason, on a machine that cannot draw."""
    try:
        return _pictures(policy, options, episodes, max_steps, out)
    except RenderUnavailable as error:
        console.print(f"the page has no pictures: {error}", style="yellow", markup=False)
        return []


def _run(
    policy: str, options: Mapping[str, Any], seeds: range, max_steps: int, jobs: int, console: Console
) -> list[Episode]:
    episodes: list[Episode] = []
    begin = reported = time.perf_counter()
    for episode in run_episodes(policy, options, seeds, max_steps, jobs):
        episodes.append(episode)
        now = time.perf_counter()
        if now - reported > EVERY or len(episodes) == len(seeds):
            reported, done = now, sum(e.success for e in episodes)
            console.print(
                f"{len(episodes)} of {len(seeds)} episodes, {done} succeeded, {now - begin:.0f} s", markup=False
            )
    return episodes


def _print(summary: Mapping[str, Any], console: Console) -> None:
    for name in ("success", "lost"):
        share = summary[name]
        console.print(f"{name}: {share['mean']:.1%} ({share['low']:.1%} to {share['high']:.1%})", markup=False)
    for name in (*MEASURES, "time_to_success"):
        if summary[name] is not None:
            mean, low, high = (summary[name][part] for part in ("mean", "low", "high"))
            console.print(f"{name}: {mean:.3g} ({low:.3g} to {high:.3g}) {UNITS[name]}".rstrip(), markup=False)


class _Moments:
    """Writes pictures of the first, the middle and the last state of an episode."""

    def __init__(self, env: SuturingEnv, episode: Episode, out: Path) -> None:
        self._env, self._stem = env, out / str(episode.seed)
        self._moments = {0: "first", episode.steps // 2: "middle", episode.steps: "last"}
        self.files: list[Path] = []

    def __call__(self, step: int) -> None:
        if step in self._moments:
            path = self._stem.with_name(f"{self._stem.name}_{self._moments[step]}.png")
            self.files.append(write_png(Image.fromarray(self._env.render()), path))


def _pictures(
    policy: str, options: Mapping[str, Any], episodes: list[Episode], max_steps: int, out: Path
) -> list[tuple[int, list[Path]]]:
    """First, middle and last moment of episodes, which are run again for it: the same seed gives the same bits."""
    if not episodes:
        return []
    env, acts, shown = SuturingEnv(**options, max_steps=None, render_mode="rgb_array"), load_policy(policy), []
    try:
        for episode in episodes:
            look = _Moments(env, episode, out)
            run_episode(env, acts, episode.seed, max_steps, look)
            shown.append((episode.seed, look.files))
    finally:
        env.close()
    return shown
