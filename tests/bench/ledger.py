"""Figures of `make bench` in one JSON file, and what got slower since the last release.

``python -m tests.bench.ledger`` compares ``build/bench.json`` with ``docs/benchmarks.json``, the release's, and exits
with status 1 when a ratio to the reference loop of its run lost more than `LOSS`.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
NOW, RELEASE = ROOT / "build" / "bench.json", ROOT / "docs" / "benchmarks.json"
LOSS = 0.10
"""Part of a ratio by which it may grow: machines differ, ratios of one run little."""


def note(section: str, figures: dict[str, Any], path: Path = NOW) -> None:
    """Put the figures of one benchmark into the file, in place of its earlier ones."""
    found = json.loads(path.read_text()) if path.exists() else {}
    path.parent.mkdir(exist_ok=True)
    path.write_text(json.dumps({**found, section: figures}, indent=1, sort_keys=True) + "\n")


def losses(release: dict[str, Any], now: dict[str, Any]) -> list[str]:
    """What has become slower: every figure ``ratio`` that both have, by its path; smaller is better."""
    found = []
    for path, before in _ratios(release):
        after = dict(_ratios(now)).get(path)
        if after is not None and after > (1.0 + LOSS) * before:
            found.append(f"{path}: {after:.3f} of the reference, {before:.3f} in the release")
    return found


def _ratios(figures: Any, path: str = "") -> list[tuple[str, float]]:
    if not isinstance(figures, dict):
        return []
    own = [(path, float(figures["ratio"]))] if "ratio" in figures else []
    return own + [entry for name, value in figures.items() for entry in _ratios(value, f"{path}/{name}".strip("/"))]


def main() -> int:
    """Entry point."""
    if not NOW.exists() or not RELEASE.exists():
        sys.stdout.write(f"nothing to compare: {NOW if not NOW.exists() else RELEASE} is missing\n")
        return 0
    found = losses(json.loads(RELEASE.read_text()), json.loads(NOW.read_text()))
    for line in found:
        sys.stdout.write(f"slower by more than {LOSS:.0%}: {line}\n")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
