"""Draws how policies got better: one panel for each task, one line for each seed, and the mean.

``python examples/learning_curves.py OUT.png "episodes shown" reach=reach_0.csv,reach_1.csv pick=pick_0.csv,…``, where
``scale_out.py`` and ``train_sac.py`` wrote the tables: the first column is how much was learnt from, the second the
share of unseen episodes that succeeded. It needs matplotlib.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

try:
    import matplotlib as mpl
    import numpy as np

    mpl.use("Agg")
    from matplotlib import pyplot as plt
    from matplotlib.axes import Axes
    from matplotlib.ticker import PercentFormatter
except ModuleNotFoundError as missing:
    sys.exit(f"{missing}; run: pip install matplotlib")

LINE, FAINT = "#2563a8", "#9bbbdc"


def curve(path: Path) -> np.ndarray:
    """A table's first two columns (n, 2)."""
    found = np.loadtxt(path, delimiter=",", usecols=(0, 1), ndmin=2)
    if not len(found):
        raise ValueError(f"{path} has no rows")
    return found


def draw(axes: Axes, name: str, curves: list[np.ndarray]) -> None:
    """One task: its seeds, and their mean where all of them were measured."""
    for one in curves:
        axes.plot(*one.T, color=FAINT, linewidth=1.0)
    shared = sorted(set.intersection(*(set(one[:, 0]) for one in curves)))
    mean = [np.mean([one[one[:, 0] == x, 1][0] for one in curves]) for x in shared]
    axes.plot(shared, mean, color=LINE, linewidth=2.0)
    axes.set_title(f"{name}, {len(curves)} seeds", fontsize=10)
    axes.set_ylim(-0.03, 1.03)
    axes.yaxis.set_major_formatter(PercentFormatter(1.0))
    axes.grid(alpha=0.3)


def main() -> int:
    """Draw all panels."""
    arguments = argparse.ArgumentParser(description="Draw learning curves.")
    arguments.add_argument("out", type=Path, help="picture to write")
    arguments.add_argument("what", help="that the first columns count")
    arguments.add_argument("tables", nargs="+", metavar="TASK=FILE.csv,…", help="one of each seed")
    given = arguments.parse_args()
    figure, panels = plt.subplots(
        1, len(given.tables), figsize=(3.2 * len(given.tables), 2.6), sharey=True, squeeze=False, layout="constrained"
    )
    for axes, entry in zip(panels[0], given.tables, strict=True):
        name, _, files = entry.partition("=")
        try:
            draw(axes, name, [curve(Path(file)) for file in files.split(",")])
        except (OSError, ValueError) as error:
            print(f"{entry}: {error}")
            return 2
        axes.set_xlabel(given.what)
    panels[0, 0].set_ylabel("success")
    figure.savefig(given.out, dpi=110)
    print(given.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
