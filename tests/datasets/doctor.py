"""Whether an export keeps the rules of its format, and what `lerobot-doctor`, code of others, says of it."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ligature.datasets.lerobot import FORMATS, export

from tests.datasets.lerobot_rules import broken


def examined(folder: Path) -> tuple[dict[str, Any], list[str]]:
    """The doctor's report, and all that it has to say against ``folder``, as ``SEVERITY: message``."""
    done = subprocess.run(
        [Path(sys.executable).with_name("lerobot-doctor"), folder, "--json"], capture_output=True, text=True, timeout=240,
        env={**os.environ, "HF_HUB_OFFLINE": "1"},
    )  # fmt: skip
    report = json.loads(done.stdout)
    messages = (message for check in report["checks"] for message in check["messages"])
    return report, [f"{each['severity']}: {each['message']}" for each in messages if each["severity"] != "PASS"]


def sound(dataset: Path, folder: Path, known: Sequence[str] = ()) -> None:
    """Export ``dataset`` in all formats below ``folder``: no rule is broken, and the doctor has no warning.

    ``known`` are patterns of warnings that what was done calls for; no other may come.
    """
    for name in FORMATS:
        export(dataset, folder / name, name, log=lambda _: None)
        assert broken(folder / name) == [], name
    _, findings = examined(folder / "lerobot-3.0")
    assert [line for line in findings if not any(re.fullmatch(each, line) for each in known)] == []
