"""Commands where the system allows little, and in environments that nobody reckons with: they work or say what to do."""

from __future__ import annotations

import errno
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from ligature.limits import shortage

BODY = "bodies: [B]\nB: {name: b, mass: 1, collision shape: SPHERE, collision geometry: {radius: 0.02}}\n"
LIGATURE = Path(sys.executable).parent / "ligature"
WIDE = st.sampled_from(["0", "1", "7", "100000000000", "²", "x"])
VARIABLES: dict[str, st.SearchStrategy[str | None]] = {
    "COLUMNS": WIDE,
    "LINES": WIDE,
    "HOME": st.sampled_from([None, "", "/nonexistent", "relative"]),
    "TERM": st.sampled_from([None, "", "nonsense", "dumb"]),
    "LC_ALL": st.sampled_from([None, "C", "POSIX", "ja_JP.eucJP", "xx"]),
    "TZ": st.sampled_from(["", "Nowhere/No", ":/etc/passwd", "UTC+99"]),
    "TMPDIR": st.sampled_from(["", "/nonexistent", "relative"]),
    "NUMBA_NUM_THREADS": st.sampled_from(["", "0", "-1", "many", "99999"]),
    "NUMBA_DISABLE_JIT": st.sampled_from(["0", "1", ""]),
    "OMP_NUM_THREADS": st.sampled_from(["0", "x", "1"]),
    "PATH": st.sampled_from(["/nonexistent", ""]),
}
NAMES = st.text(st.characters(codec="utf-8", exclude_characters="\0/"), min_size=1, max_size=40).map(os.fsencode)
FOLDERS = NAMES | st.binary(min_size=1, max_size=60).map(lambda name: name.replace(b"\0", b"%").replace(b"/", b'"'))


def checked(folder: bytes, changes: dict[str, str | None], before: str = "") -> subprocess.CompletedProcess[str]:
    """``ligature check`` of a sound scene in ``folder``, started by a shell after the words ``before``."""
    os.makedirs(folder, exist_ok=True)
    with open(os.path.join(folder, b"scene.yaml"), "w") as file:
        file.write(BODY)
    environment = {**os.environ, **{name: value for name, value in changes.items() if value is not None}}
    for name in (name for name, value in changes.items() if value is None):
        environment.pop(name, None)
    return subprocess.run(
        ["/bin/bash", "-c", f'{before}\nexec "$@"', "bash", LIGATURE, "check", "scene.yaml"],
        cwd=folder, env=environment, capture_output=True, text=True, errors="replace", timeout=120, stdin=subprocess.DEVNULL,
    )  # fmt: skip


@settings(max_examples=12, phases=[Phase.generate])  # each takes a second: none to find a smaller one
@given(
    st.fixed_dictionaries({}, optional=VARIABLES),
    FOLDERS.filter(lambda name: name not in (b".", b"..")),
    st.sampled_from(["", "umask 777", "exec 0<&-", "ulimit -f 0", "ulimit -n 64", "ulimit -c 0; ulimit -s 1024"]),
)
def test_a_check_does_its_work_wherever_it_is_started(
    tmp_path_factory: pytest.TempPathFactory, changes: dict[str, str | None], name: bytes, before: str
) -> None:
    folder = os.path.join(os.fsencode(tmp_path_factory.mktemp("any")), name)
    done = checked(folder, changes, before)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "scene.yaml: 0 errors, 0 warnings" in done.stdout
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("columns", ["0", "1", "99999999999"])
def test_findings_are_printed_on_terminals_of_any_width(columns: str, tmp_path: Path) -> None:
    done = subprocess.run(
        [LIGATURE, "bench", "none.yaml"], cwd=tmp_path, env={**os.environ, "COLUMNS": columns},
        capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert "does not exist" in " ".join(done.stdout.split()), done.stdout + done.stderr


@settings(max_examples=8, phases=[Phase.generate])
@given(st.sampled_from(["ulimit -v {}000", "ulimit -n {}"]), st.integers(0, 250))
def test_too_low_a_limit_is_named_with_the_remedy(
    tmp_path_factory: pytest.TempPathFactory, limit: str, number: int
) -> None:
    """What is above the least with which Python starts, and below what it takes to check a scene."""
    limit = limit.format(5 if "-n" in limit else 70 + number)
    done = checked(os.fsencode(tmp_path_factory.mktemp("any")), {}, limit)
    assert done.returncode == 2, (limit, done.stdout + done.stderr)
    assert "Traceback" not in done.stderr
    assert re.search(r"the system lets this process (open|have) \d+ .*'ulimit -[nv] \w+'", done.stderr), done.stderr


@given(st.sampled_from(sorted(errno.errorcode)), st.integers(0, 3))
def test_a_shortage_is_found_behind_other_errors_and_others_are_none(number: int, depth: int) -> None:
    error: Exception = OSError(number, os.strerror(number))
    for _ in range(depth):
        outer = RuntimeError("something else")
        outer.__cause__, error = error, outer
    short = number in (errno.EMFILE, errno.ENFILE, errno.EAGAIN, errno.ENOMEM)
    assert bool(shortage(error)) == short
