"""Whether an export keeps the rules of its format, and what `lerobot-doctor`, code of others, says of it."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from ligature.datasets.lerobot import FORMATS, export

from tests.datasets.lerobot_rules import broken

OUTLIERS = re.compile(r"WARN: ([^\[:]+)(?:\[(\d+)\])?: (\d+) extreme outlier\(s\) \(>10 std from mean\)")
NEAR = 3
"""Samples around an event in which forces and velocities may leap."""

SETTLING = 10
"""Samples after the start of an episode in which needle and thread come to rest where they were put."""


def examined(folder: Path) -> tuple[dict[str, Any], list[str]]:
    """The doctor's report, and all that it has to say against ``folder``, as ``SEVERITY: message``."""
    done = subprocess.run(
        [Path(sys.executable).with_name("lerobot-doctor"), folder, "--json"], capture_output=True, text=True, timeout=240,
        env={**os.environ, "HF_HUB_OFFLINE": "1"},
    )  # fmt: skip
    report = json.loads(done.stdout)
    messages = (message for check in report["checks"] for message in check["messages"])
    return report, [f"{each['severity']}: {each['message']}" for each in messages if each["severity"] != "PASS"]


def sound(dataset: Path, folder: Path, known: Collection[str] = ()) -> None:
    """Export ``dataset`` in all formats below ``folder``: no rule is broken, and the doctor warns of nothing else.

    ``known`` are patterns of warnings that what was done calls for, one for each number of a feature; each must come,
    and be true: what is called constant is. Outliers are no fault where something happened, and nowhere else.
    """
    for name in FORMATS:
        export(dataset, folder / name, name, log=lambda _: None)
        assert broken(folder / name) == [], name
    _, findings = examined(folder / "lerobot-3.0")
    whole = _Export(folder / "lerobot-3.0")
    unknown = [line for line in findings if not _at_an_event(line, whole)]
    assert [line for line in unknown if not any(re.fullmatch(each, line) for each in known)] == []
    assert [each for each in known if not any(re.fullmatch(each, line) for line in unknown)] == []
    for line in unknown:
        if constant := re.match(r"WARN: (\S+): 1 constant .*: dim (\d+)", line):
            assert np.ptp(whole.columns[constant[1]][:, int(constant[2])]) == 0.0


class _Export:
    """All numbers of an export, by feature, and samples near which something happened."""

    def __init__(self, root: Path) -> None:
        rows = pa.concat_tables(pq.read_table(path) for path in sorted((root / "data").glob("*/*.parquet")))
        self.columns = {name: _table(rows[name]) for name in rows.column_names}
        episode, frame = (self.columns[name][:, 0] for name in ("episode_index", "frame_index"))
        self.near_events = frame < SETTLING
        for event in map(json.loads, (root / "meta/events.jsonl").read_text().splitlines()):
            self.near_events |= (episode == event["episode_index"]) & (np.abs(frame - event["frame_index"]) <= NEAR)


def _table(column: Any) -> np.ndarray:
    values = np.array(column.to_pylist())
    return values if values.ndim == 2 else values[:, None]


def _at_an_event(line: str, whole: _Export) -> bool:
    """Whether a warning is of outliers, and all of them are where something was grasped, met, let go or punctured."""
    found = OUTLIERS.match(line)
    if found is None:
        return False
    values = whole.columns[found[1]][:, int(found[2] or 0)]
    far = np.abs(values - values.mean()) > 10.0 * values.std()
    assert far.sum() == int(found[3]), line
    return bool(whole.near_events[far].all())
