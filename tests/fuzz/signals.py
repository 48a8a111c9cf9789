"""Ends commands at random moments by signals: ``python -m tests.fuzz.signals --rounds 40``.

A round starts a command of a user in an empty folder, sends it one to three signals of a terminal or a service within a
millisecond at a random moment of its start, its work or its end, and sees that it ends within two seconds by that signal
or, if it was done, by itself; without a traceback, with a last line that a user can read, and without files half-written.
Round N is the same in every run but for the moment that a busy machine gives it.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
import uuid
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from ligature.process import end_with_parent

from tests.fuzz.kills import _free_ports, _marked

ROOT = Path(__file__).resolve().parents[2]
SCENES = ROOT / "scenes"
LIMIT, FINISHED_LIMIT = 2.0, 6.0
"""Seconds after the first signal in which the command and all its processes must have ended; the latter for a dataset,
whose last episode is finished."""

START = 1.2
"""Seconds in which a command starts, and which get a part of all rounds."""

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
SMALL = str(SCENES / "suturing_small" / "launch.yaml")
_MARK = "LIGATURE_SIGNALS"


def _mesh(folder: Path) -> str:
    """A closed mesh in which CoACD finds much to cut: a comb."""
    mesh = folder / "comb.obj"
    lines, faces = [], []
    for k in range(30):
        x = 2.0 * k
        base = 8 * k
        lines += [f"v {x + dx} {dy} {dz}" for dz in (0, 1 + k % 5) for dx, dy in ((0, 0), (1, 0), (1, 9), (0, 9))]
        for a, b, c, d in ((1, 4, 3, 2), (5, 6, 7, 8), (1, 2, 6, 5), (2, 3, 7, 6), (3, 4, 8, 7), (4, 1, 5, 8)):
            faces += [f"f {base + a} {base + b} {base + c}", f"f {base + a} {base + c} {base + d}"]
    mesh.write_text("\n".join([*lines, *faces]) + "\n")
    return str(mesh)


COMMANDS: dict[str, tuple[Callable[[Path], list[str]], float]] = {
    "render": (lambda out: ["render", SMALL, "--camera", "cameraL", "--out", str(out / "o"), "--seconds", "0.5"], 5.0),
    "check": (lambda out: ["check", *map(str, sorted(SCENES.glob("*/launch.yaml")))], 6.0),
    "bench": (lambda out: ["bench", SMALL, "--seconds", "3"], 6.0),
    "decompose": (lambda out: ["decompose", _mesh(out), "-o", str(out / "o.obj")], 6.0),
    "evaluate": (
        lambda out: ["evaluate", "random", "--env", "reach", "--episodes", "3", "--out", str(out / "o")],
        9.0,
    ),
    "evaluate -j": (
        lambda out: ["evaluate", "random", "--env", "reach", "--episodes", "4", "-j", "2", "--out", str(out / "o")],
        9.0,
    ),
    "cockpit": (lambda out: ["cockpit", "needle_pick", "--cockpit-at", f"127.0.0.1:{_free_ports(1)[0]}"], 8.0),
    "demo": (lambda out: ["demo", "--dataset", str(out / "o.h5"), "--size", "64x48"], 8.0),
    "poses": (lambda out: ["poses", SMALL, "--out", str(out / "o.npz"), "--seconds", "1"], 5.0),
    "compile": (lambda out: ["compile", SMALL], 5.0),
    "cold bench": (lambda out: ["bench", SMALL, "--seconds", "3"], 40.0),
    "cold compile": (lambda out: ["compile", SMALL], 40.0),
}
"""Commands, and the longest seconds after which they are asked to end."""


@dataclass(frozen=True)
class Ending:
    """How a round ended; ``faults`` is empty when all is well."""

    command: str
    number: int
    signals: tuple[str, ...]
    lived: float
    ended: float
    status: int
    faults: tuple[str, ...]
    output: str

    def __str__(self) -> str:
        words = f"{self.command} {self.number}: {'+'.join(self.signals)} after {self.lived:.2f} s, ended in {self.ended:.2f} s"
        return f"{words} with {self.status}: {'; '.join(self.faults) or 'well'}"


def end(command: str, number: int, latest: float | None = None) -> Ending:
    """One round of ``command``."""
    rng = random.Random(f"{command} {number}")
    words, longest = COMMANDS[command]
    numbers = [rng.choice(SIGNALS) for _ in range(rng.choice((1, 1, 2, 3)))]
    moment = rng.uniform(0.0, latest or longest) if rng.random() < 0.7 else rng.uniform(0.0, START)
    mark = uuid.uuid4().hex
    with tempfile.TemporaryDirectory() as folder:
        program = subprocess.Popen(
            [str(Path(sys.executable).parent / "ligature"), *words(Path(folder))],
            cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            env=_environment(command, folder, mark), preexec_fn=_begin, start_new_session=True,
        )  # fmt: skip
        before, started = set(Path(folder).rglob("*")), time.monotonic()
        with suppress(subprocess.TimeoutExpired):
            program.wait(moment)
        lived, begin, done = time.monotonic() - started, time.monotonic(), program.poll() is not None
        send = rng.choice((os.kill, os.killpg))  # a service, or a terminal
        for one in numbers:
            with suppress(ProcessLookupError):
                send(program.pid, one)
            time.sleep(rng.uniform(0.0, 3e-4))
        limit = FINISHED_LIMIT if command == "demo" else LIMIT
        while _left(program, mark) and time.monotonic() - begin < limit:
            time.sleep(0.01)
        ended, left = time.monotonic() - begin, _left(program, mark)
        for pid in left:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        output = program.communicate()[0]
        faults = [] if not left else [f"left: {', '.join(left.values())}"]
        faults += _faults(program.returncode, numbers, done, output)
        after = set(Path(folder).rglob("*")) - before
        faults += [
            f"part-file '{path.name}'" for path in after if ".part" in path.name or path.name.startswith((".", "tmp"))
        ]
    names = tuple(one.name for one in numbers)
    return Ending(command, number, names, lived, ended, program.returncode, tuple(faults), output)


def _environment(command: str, folder: str, mark: str) -> dict[str, str]:
    """Where a ``cold`` command has nothing compiled."""
    cold = {"LIGATURE_CACHE": f"{folder}/cache"} if command.startswith("cold") else {}
    return {**os.environ, "TMPDIR": folder, _MARK: mark, **cold}


def _begin() -> None:
    end_with_parent()
    for number in SIGNALS:
        signal.signal(number, signal.SIG_DFL)


def _left(program: subprocess.Popen[str], mark: str) -> dict[int, str]:
    return _marked(f"{_MARK}={mark}", program)  # type: ignore[arg-type]


def _faults(status: int, numbers: list[signal.Signals], done: bool, output: str) -> list[str]:
    """What is wrong with the status and the output of a command that got signals."""
    asked = {*(-number for number in numbers), *(128 + number for number in numbers), 0}
    found = []
    if not done and status not in asked:
        found.append(f"status {status}")
    if "Traceback" in output or "Exception" in output:
        found.append("a traceback")
    return found


def main() -> int:
    """Entry point."""
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("--rounds", type=int, default=40, help="of each command")
    flags.add_argument("--first", type=int, default=0)
    flags.add_argument("--command", action="append", choices=COMMANDS)
    given = flags.parse_args()
    wrong = 0
    for command in given.command or COMMANDS:
        for number in range(given.first, given.first + given.rounds):
            ending = end(command, number)
            wrong += bool(ending.faults)
            sys.stdout.write(f"{ending}\n" + (f"{ending.output[-1500:]}\n" if ending.faults else ""))
            sys.stdout.flush()
    sys.stdout.write(f"{wrong} rounds with faults\n")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
