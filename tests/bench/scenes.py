"""How fast scenes run, beside a reference of the same run: a 40-body chain of point joints in Bullet.

``python -m tests.bench.scenes``; writes ``build/bench.json`` and ``docs/pictures/bench_phases.png``, where the last
release's figures of ``docs/benchmarks.json`` stand beside them.
"""

from __future__ import annotations

import json
import os
import statistics
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import ligature
from ligature.cli.bench import Run
from ligature.model.scene import Scene
from ligature.simulation import PHASES

from tests.bench import ledger
from tests.bench.reference import Reference, ratio

ROOT = Path(__file__).resolve().parents[2]
SPANS, SECONDS = 60, 0.05
"""Spans of each run, and seconds of each: the reference is timed after each of them."""


def scenes() -> list[tuple[str, Scene]]:
    """Name and scene of what is measured."""
    corpus = (
        Path(os.environ.get("LIGATURE_CORPUS", ROOT.parent / "shared" / "corpus")) / "suturing_scene" / "launch.yaml"
    )
    found = [("suturing_small", ligature.load(ROOT / "scenes" / "suturing_small" / "launch.yaml"))]
    if corpus.exists():
        lab = ligature.load(corpus, (10, 11, 6, 7, 8, 9))
        found += [
            ("corpus: phantom, needle, thread, 2 PSMs", lab),
            ("corpus: phantom, needle, 2 PSMs, no thread", replace(lab, rods=())),
            ("corpus: 2 PSMs", ligature.load(corpus, (6, 7, 8, 9))),
        ]
    return found


def draw(series: dict[str, dict[str, Any]], path: Path) -> None:
    """A picture of where ticks spend their time, in steps of the reference: one bar for each scene, rate and version."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    bars = [
        (f"{name}\n{version}", run)
        for name in series["now"]
        for version in series
        if (run := series[version].get(name))
    ]
    figure, axis = pyplot.subplots(figsize=(10, 0.45 * len(bars) + 1), constrained_layout=True)
    left = [0.0] * len(bars)
    for phase in PHASES:
        parts = [run["phases_us"][phase] / run["reference_us"] for _, run in bars]
        axis.barh(range(len(bars)), parts, left=left, label=phase)
        left = [a + b for a, b in zip(left, parts, strict=True)]
    axis.set_yticks(range(len(bars)), [label for label, _ in bars], fontsize=7)
    axis.set_xlabel("tick, in steps of the reference")
    axis.legend(fontsize=7)
    axis.invert_yaxis()
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


def measured(name: str, scene: Scene, rate: float, reference: Reference) -> dict[str, Any]:
    """Figures of one scene with so many updates a second, which are printed, too."""
    run = Run(scene, rate)
    spans = [(1e6 * statistics.fmean(run.go_on(SECONDS)), reference.time().wall) for _ in range(SPANS)]
    figures, step = run.figures(), statistics.median(step for _, step in spans)
    phases = ", ".join(f"{k} {v:.0f}" for k, v in figures["phases_us"].items())
    sys.stdout.write(
        f"{name}: {figures['ticks_per_second']:.0f} ticks/s, real-time factor {figures['real_time_factor']:.2f}, p99 "
        f"{figures['tick_p99_us']:.0f} us, {ratio(spans):.2f} of the reference of {step:.0f} us; us: {phases}\n"
    )
    sys.stdout.flush()
    kept = {key: figures[key] for key in ("real_time_factor", "tick_p99_us", "phases_us", "memory_mb")}
    return {**kept, "reference_us": step, "ratio": ratio(spans)}


def main() -> int:
    """Entry point."""
    found = {}
    with Reference() as reference:
        for name, scene in scenes():
            for rate in (200.0, 1000.0):
                which = f"{name}, {rate:.0f} updates/s"
                found[which] = measured(which, scene, rate, reference)
    ledger.note("scenes", found)
    release = json.loads(ledger.RELEASE.read_text()).get("scenes", {}) if ledger.RELEASE.exists() else {}
    draw({"release": release, "now": found}, ROOT / "docs" / "pictures" / "bench_phases.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())
