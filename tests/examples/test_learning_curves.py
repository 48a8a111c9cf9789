"""Learning curves are drawn from the tables that trainings write."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "learning_curves.py"


def test_curves_are_drawn_from_tables(tmp_path: Path) -> None:
    for seed in range(3):
        (tmp_path / f"{seed}.csv").write_text("".join(f"{n},{n / 100 + seed / 50},20\n" for n in (20, 40, 60)))
    tables = ",".join(str(tmp_path / f"{seed}.csv") for seed in range(3))
    command = [sys.executable, str(EXAMPLE), str(tmp_path / "a.png"), "episodes"]
    done = subprocess.run([*command, f"reach={tables}"], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "a.png").stat().st_size > 3000
    missing = subprocess.run([*command, "pick=nothing.csv"], capture_output=True, text=True, timeout=120)
    assert missing.returncode == 2 and "pick=nothing.csv" in missing.stdout
