"""The names under which scripts import the client, as `env.sh` puts them on the path."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NAMES = ROOT / "simulator" / "ligature" / "client" / "names"


@pytest.fixture(scope="session", autouse=True)
def _names_on_the_path() -> None:
    sys.path.extend([str(ROOT / "build" / "python"), str(NAMES / "ambf"), str(NAMES / "tf")])
