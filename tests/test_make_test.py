"""How `make test` runs tests: those that watch real time at once with all others, and once more when few fail."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import ROOT
from tests.waiting import until

PLAIN = {"PATH": "/usr/bin:/bin", "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
"""Environment of a pytest that starts in a third of the time."""

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
    [(0, 0, "1", 0), (1, 0, "1", 0), (3, 0, "1", 0), (3, 0, "0", 1), (41, 0, "1", 1), (0, 1, "1", 1), (2, 1, "1", 1)],
)
def test_few_that_fail_run_once_more(tmp_path: Path, late: int, broken: int, retry: str, status: int) -> None:
    (tmp_path / "test_some.py").write_text(TESTS.format(late=late, broken=broken))
    (tmp_path / "pyproject.toml").write_text("[tool.pytest.ini_options]\naddopts = '-p no:cacheprovider'\n")
    run = subprocess.run(
        ["sh", ROOT / ".ci" / "real_time_tests.sh", sys.executable, "."],
        cwd=tmp_path, env={**PLAIN, "LIGATURE_RETRY": retry}, capture_output=True, text=True,
    )  # fmt: skip
    assert run.returncode == status, run.stdout + run.stderr
    _, *named = run.stdout.split("passed the second time only:\n")
    assert named == ([] if status or not late else ["".join(f"test_some.py::test_late[{k}]\n" for k in range(late))])


@pytest.mark.parametrize(("late", "wanted", "status"), [(0, 0, 0), (0, 3, 3), (1, 0, 0), (1, 3, 3), (41, 3, 1)])
def test_what_runs_between_counts(tmp_path: Path, late: int, wanted: int, status: int) -> None:
    (tmp_path / "test_some.py").write_text(TESTS.format(late=late, broken=0))
    (tmp_path / "pyproject.toml").write_text("[tool.pytest.ini_options]\naddopts = '-p no:cacheprovider'\n")
    run = subprocess.run(
        ["sh", ROOT / ".ci" / "real_time_tests.sh", sys.executable, "."],
        cwd=tmp_path, env={**PLAIN, "LIGATURE_BETWEEN": f"echo now between; exit {wanted}"},
        capture_output=True, text=True,
    )  # fmt: skip
    assert run.returncode == status, run.stdout + run.stderr
    before, after = run.stdout.split("now between\n")
    assert ("failed" in before) == (late > 0) and ("1 passed" in after) == (late == 1)


HALF = """
import os, signal, time
def test_meets_the_other_half():
    open("{own}", "w").close()
    end = time.monotonic() + 60
    while not os.path.exists("{other}"):
        assert time.monotonic() < end
def test_ctrl_c_is_heard():
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
def test_gives_way():
    assert os.nice(0) - {before} == {nice}
    try:
        group = int(open("/proc/self/autogroup").read().split()[-1])
    except OSError:
        return
    assert not {nice} or group == 5
def test_result():
    time.sleep({seconds})
    open("{own} is over", "w").close()
    assert {passes}
"""


def halves(
    folder: Path,
    real_time: object = True,
    others: object = True,
    seconds: float = 0.0,
    lag: float = 0.0,
    retry: int = 0,
) -> subprocess.Popen[str]:
    """Both halves of the tests of ``folder``, which pass or fail, as a process group of their own.

    Each takes ``seconds``, the one that does not watch real time ``lag`` more.
    """
    (folder / ".ci").symlink_to(ROOT / ".ci")
    (folder / "tests" / "watching").mkdir(parents=True)
    (folder / "pyproject.toml").write_text("[tool.pytest.ini_options]\naddopts = '-p no:cacheprovider'\n")
    (folder / "tests" / "watching" / "test_one.py").write_text(
        HALF.format(own="watching", other="other", before=os.nice(0), nice=0, passes=real_time, seconds=seconds)
    )
    (folder / "tests" / "test_two.py").write_text(
        HALF.format(
            own="other", other="watching", before=os.nice(0), nice=19 - os.nice(0), passes=others, seconds=seconds + lag
        )
    )
    return subprocess.Popen(
        ["sh", ".ci/unit_tests.sh", sys.executable, "tests/watching"],
        cwd=folder, env={"PATH": "/usr/bin:/bin", "LIGATURE_RETRY": str(retry)}, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, text=True, start_new_session=True,
    )  # fmt: skip


@pytest.mark.parametrize(("real_time", "others"), [(False, True), (True, False)])
def test_both_halves_run_at_once_and_count(tmp_path: Path, real_time: bool, others: bool) -> None:
    run = halves(tmp_path, real_time, others)
    output, _ = run.communicate(timeout=200)
    assert (run.returncode == 0) == (real_time and others), output
    first, then = output.split("the other tests, which ran meanwhile:")
    for part, passes in ((first, real_time), (then, others)):
        assert ("4 passed" if passes else "1 failed, 3 passed") in part, output


def test_what_fails_runs_once_more_when_the_other_half_is_over(tmp_path: Path) -> None:
    run = halves(tmp_path, "os.path.exists('other is over')", lag=5.0, retry=1)
    output, _ = run.communicate(timeout=200)
    assert run.returncode == 0 and "passed the second time only:\ntests/watching/test_one.py::test_result" in output, (
        output
    )


def test_ctrl_c_ends_both_halves(tmp_path: Path) -> None:
    run = halves(tmp_path, seconds=50.0)
    until(lambda: (tmp_path / "other").exists() and (tmp_path / "watching").exists(), "both halves run")
    os.killpg(run.pid, signal.SIGINT)
    run.communicate(timeout=60)
    assert run.returncode != 0

    def here(process: Path) -> bool:
        try:
            return (process / "cwd").resolve() == tmp_path
        except OSError:
            return False

    until(lambda: not any(map(here, Path("/proc").glob("[0-9]*"))), "all processes have ended", 20.0)
