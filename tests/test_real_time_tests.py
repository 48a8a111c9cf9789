"""A test that watches real time runs once more when few fail: what fails always fails still, and what passed late is named."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import ROOT

TESTS = """
from pathlib import Path
import pytest

@pytest.mark.parametrize("number", range({late}))
def test_late(number):
    mark = Path(__file__).with_name(f"seen{{number}}")
    seen = mark.exists()
    mark.touch()
    assert seen

@pytest.mark.parametrize("number", range({broken}))
def test_broken(number):
    assert False

def test_good():
    pass
"""


@pytest.mark.parametrize(
    ("late", "broken", "retry", "status"),
    [(0, 0, "1", 0), (1, 0, "1", 0), (3, 0, "1", 0), (3, 0, "0", 1), (4, 0, "1", 1), (0, 1, "1", 1), (2, 1, "1", 1)],
)
def test_few_that_fail_run_once_more(tmp_path: Path, late: int, broken: int, retry: str, status: int) -> None:
    (tmp_path / "test_some.py").write_text(TESTS.format(late=late, broken=broken))
    (tmp_path / "pyproject.toml").write_text("[tool.pytest.ini_options]\naddopts = '-p no:cacheprovider'\n")
    run = subprocess.run(
        ["sh", ROOT / ".ci" / "real_time_tests.sh", sys.executable, "."],
        cwd=tmp_path, env={"PATH": "/usr/bin:/bin", "LIGATURE_RETRY": retry}, capture_output=True, text=True,
    )  # fmt: skip
    assert run.returncode == status, run.stdout + run.stderr
    _, *named = run.stdout.split("passed the second time only:\n")
    assert named == ([] if status or not late else ["".join(f"test_some.py::test_late[{k}]\n" for k in range(late))])
