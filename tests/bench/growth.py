"""How the time of a tick grows with arms, bodies and elements of a thread: ``python -m tests.bench.growth``.

Scenes are generated; the reference loop runs in turn with each. Writes ``build/bench.json`` and
``docs/pictures/bench_growth.png``.
"""

from __future__ import annotations

import importlib.util
import statistics
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import ligature
from ligature.cli.bench import Run
from ligature.model.scene import Scene

from tests.bench import ledger
from tests.bench.reference import Reference, ratio

ROOT = ledger.ROOT
SPANS, SECONDS, RATE = 30, 0.05, 200.0
"""Spans of each run, seconds of each, and updates a second; the reference is timed after each span."""
SERIES = {"arms": (0, 1, 2, 3, 4), "bodies": (10, 30, 100, 300, 1000), "elements": (40, 80, 160, 400)}
APART = 1.5
"""Metres between arms that are added, so that they do not touch."""

BODY = """
BODY b{k}:
  name: b{k}
  namespace: /ambf/env/
  mass: 0.1
  collision shape: BOX
  collision geometry: {{x: 0.02, y: 0.02, z: 0.02}}
  location:
    position: {{x: {x}, y: {y}, z: 0.0105}}
    orientation: {{r: 0, p: 0, y: 0}}
"""
FLOOR = """
BODY floor:
  name: floor
  namespace: /ambf/env/
  mass: 0
  collision shape: BOX
  collision geometry: {x: 4, y: 4, z: 0.1}
  location:
    position: {x: 0, y: 0, z: -0.05}
    orientation: {r: 0, p: 0, y: 0}
"""


def _author() -> Any:
    """The script that writes `suturing_small`."""
    spec = importlib.util.spec_from_file_location("author", ROOT / "scenes" / "author_suturing_small.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _written(folder: Path, author: Any, names: tuple[str, ...]) -> Path:
    for kind in ("high_res", "low_res"):
        source = ROOT / "scenes" / "suturing_small" / kind
        if source.exists():
            (folder / kind).symlink_to(source)
    files = author.documents()
    files.update({f"{name}.yaml": author.psm(name) for name in names})
    files["launch.yaml"]["multibody configs"] = ["phantom.yaml", *(f"{name}.yaml" for name in names)]
    for name, document in files.items():
        (folder / name).write_text(author.text(document), encoding="utf-8")
    return folder / "launch.yaml"


def arms(count: int, folder: Path) -> Scene:
    """The small suturing scene with ``count`` arms."""
    author = _author()
    (x, y, z), turn = author.BASE_POSES["psm1"]
    for extra in (3, 4):
        author.BASE_POSES[f"psm{extra}"] = ((x + APART * (extra - 2), y, z), turn)
    return ligature.load(_written(folder, author, tuple(f"psm{k}" for k in range(1, count + 1))), roots=[ROOT])


def elements(count: int, folder: Path) -> Scene:
    """The small suturing scene without arms, with a thread of ``count`` elements as long as 40."""
    author = _author()
    author.THREAD_ELEMENTS = count
    return ligature.load(_written(folder, author, ()), roots=[ROOT])


def bodies(count: int, folder: Path) -> Scene:
    """``count`` boxes at rest on a floor, apart from each other."""
    names = ", ".join(["BODY floor", *(f"BODY b{k}" for k in range(count))])
    boxes = (BODY.format(k=k, x=0.05 * (k % 32) - 0.8, y=0.05 * (k // 32) - 0.8) for k in range(count))
    path = folder / "boxes.yaml"
    path.write_text(f"bodies: [{names}]\njoints: []\n{FLOOR}{''.join(boxes)}", encoding="utf-8")
    return ligature.load(path)


def tick_us(make: Callable[[int, Path], Scene], count: int, reference: Reference) -> tuple[float, float]:
    """Microseconds of a median tick, and the median of a tick over a step of the reference."""
    with tempfile.TemporaryDirectory() as folder:
        run = Run(make(count, Path(folder)), RATE)
    spans = [(1e6 * statistics.median(run.go_on(SECONDS)), reference.time().wall) for _ in range(SPANS)]
    return float(run.figures()["tick_p50_us"]), ratio(spans)


def draw(found: dict[str, dict[str, dict[str, float]]], path: Path) -> None:
    """A picture of all series: time of a tick in reference steps."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, len(found), figsize=(10, 3), constrained_layout=True)
    for axis, (name, series) in zip(axes, found.items(), strict=True):
        counts = [int(count) for count in series]
        axis.plot(counts, [entry["ratio"] for entry in series.values()], "o-")
        axis.set(xlabel=name, ylim=(0, None))
    axes[0].set_ylabel("tick, in steps of the reference")
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


def main() -> int:
    """Entry point."""
    makers = {"arms": arms, "bodies": bodies, "elements": elements}
    found: dict[str, dict[str, dict[str, float]]] = {}
    with Reference() as reference:
        for name, counts in SERIES.items():
            found[name] = {}
            for count in counts:
                tick, part = tick_us(makers[name], count, reference)
                found[name][str(count)] = {"tick_us": tick, "ratio": part}
                sys.stdout.write(f"{count} {name}: {tick:.0f} us a tick, {part:.2f} of the reference\n")
                sys.stdout.flush()
    ledger.note("growth", found)
    draw(found, ROOT / "docs" / "pictures" / "bench_growth.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())
