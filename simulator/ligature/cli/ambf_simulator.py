"""The command ``ambf_simulator``: AMBF's own flags, so that existing launch scripts run unchanged."""

from __future__ import annotations

import argparse
import sys

from ligature.cli.options import RunOptions
from ligature.cli.supervisor import Supervisor

_NOT_SIMULATED = {
    "d": "haptic rate",
    "f": "fixed haptic step",
    "e": "force feedback",
    "n": "input devices",
    "i": "input devices",
    "plugins": "plug-ins",
}


def parser() -> argparse.ArgumentParser:
    """The flags of AMBF 2.0 (ADF specification §5)."""
    flags = argparse.ArgumentParser("ambf_simulator", description="Run AMBF launch files on Ligature.")
    flags.add_argument("--launch_file", required=True, help="launch file")
    flags.add_argument("-l", help="indices of multibody configs, such as 10,11,6 (default 1 without -a)")
    flags.add_argument("-a", help="model files, separated by commas")
    flags.add_argument("-p", type=float, default=1000.0, help="updates per second")
    flags.add_argument("-t", default="1", help="fixed step; the step is always fixed here")
    flags.add_argument("-s", type=float, default=1.0, help="simulation speed factor")
    flags.add_argument("-g", default="1", help="graphics")
    flags.add_argument("--ns", default="", help="prefix of every namespace")
    flags.add_argument("--override_max_comm_freq", type=int, help="publishing rate with commands")
    flags.add_argument("--override_min_comm_freq", type=int, help="publishing rate without commands")
    flags.add_argument("--names", choices=("ambf", "src"), default="ambf", help="name policy (not an AMBF flag)")
    flags.add_argument("--root", action="append", default=[], help="further folder of scene files (not an AMBF flag)")
    for name, what in _NOT_SIMULATED.items():
        flags.add_argument(f"-{name}" if len(name) == 1 else f"--{name}", help=f"{what}; accepted, without effect")
    return flags


def options_of(arguments: list[str]) -> RunOptions:
    """The run that AMBF's flags describe; exits with status 2 and a message on bad ones."""
    flags = parser()
    given = flags.parse_args(arguments)
    text = given.l if given.l is not None else (None if given.a else "1")
    try:
        models = tuple(int(part) for part in text.split(",") if part.strip()) if text is not None else ()
    except ValueError:
        flags.error(f"-l '{text}' is not a list of whole numbers such as 10,11,6")
    if not 1 <= given.p <= 1000 or given.s <= 0:
        flags.error("-p must be 1 to 1000 updates per second and -s larger than 0")
    return RunOptions(
        given.launch_file, models, tuple(f for f in (given.a or "").split(",") if f), tuple(given.root), given.ns,
        given.p, given.s, min_hz=given.override_min_comm_freq, max_hz=given.override_max_comm_freq,
        names=given.names,
    )  # fmt: skip


def main() -> None:
    """Entry point of the command."""
    sys.exit(Supervisor(options_of(sys.argv[1:])).run())


if __name__ == "__main__":
    main()
