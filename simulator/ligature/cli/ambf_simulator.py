"""The command ``ambf_simulator``: AMBF's own flags, so that existing launch scripts run unchanged."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ligature.cli.numbers import LARGEST
from ligature.cli.options import RunOptions, arm_entry, arm_names, model_indices, name_prefix, rate_notes
from ligature.cli.supervisor import supervise

MAX_UPDATE_RATE = 1000.0
"""Updates per second of one tick each: no update can be shorter."""

_WITHOUT_EFFECT = {
    ("--plugins",): "AMBF's plug-ins in C++",
}


def parser() -> argparse.ArgumentParser:
    """The flags of AMBF 2.0, with their long names."""
    flags = argparse.ArgumentParser("ambf_simulator", description="Run AMBF launch files on Ligature.")
    flags.add_argument("--launch_file", required=True, help="launch file")
    flags.add_argument(
        "-l", "--load_multibodies", dest="l", help="indices of multibody configs, as 10,11,6 (default 1 without -a)"
    )
    flags.add_argument("-a", "--load_multibody_files", dest="a", help="model files, separated by commas")
    flags.add_argument("-i", "--load_devices", dest="i", default="", help="indices of input devices, for their proxies")
    flags.add_argument("-p", "--phx_frequency", dest="p", type=float, default=1000.0, help="updates per second")
    flags.add_argument("-t", "--fixed_phx_timestep", dest="t", type=_switch, help="the step is always fixed here")
    flags.add_argument("-s", "--sim_speed_factor", dest="s", type=float, default=1.0, help="simulated over wall time")
    flags.add_argument(
        "-g",
        "--show_gui",
        dest="g",
        type=_switch,
        help="1 shows a window for each camera; without this flag there is none",
    )
    flags.add_argument("--ns", default="", help="prefix of every namespace")
    flags.add_argument("--override_max_comm_freq", type=int, help="publishing rate with commands")
    flags.add_argument("--override_min_comm_freq", type=int, help="publishing rate without commands")
    flags.add_argument("--arm", action="append", default=[], type=_arm, help="NAME=KIND:BODY:TOOL (not an AMBF flag)")
    flags.add_argument("--only", default="", help="names of the arms that are there (not an AMBF flag)")
    flags.add_argument("--no-masters", action="store_true", help="no master arms (not an AMBF flag)")
    flags.add_argument(
        "--allow-plugins", action="store_true", help="run plug-ins in Python that the files name (not an AMBF flag)"
    )
    flags.add_argument("--base-frames", default="", help="ECM: poses of arms relative to it (not an AMBF flag)")
    flags.add_argument("--src-crtk", action="store_true", help="arms under /CRTK too (not an AMBF flag)")
    flags.add_argument("--names", choices=("ambf", "src"), default="ambf", help="name policy (not an AMBF flag)")
    flags.add_argument(
        "--cameras", action=argparse.BooleanOptionalAction,
        help="publish pictures of all cameras, or of none; by default as the scene sets it (not an AMBF flag)",
    )  # fmt: skip
    flags.add_argument("--root", action="append", default=[], help="further folder of scene files (not an AMBF flag)")
    flags.add_argument(
        "-d", "--htx_frequency", dest="d", type=float, default=0.0,
        help="most forces per second that `ligature teleop` sends to a device",
    )  # fmt: skip
    flags.add_argument(
        "-f", "--fixed_htx_timestep", dest="f", type=_switch,
        help="1: damping in `ligature teleop` reckons with one period of -d (1000 Hz) between readings",
    )  # fmt: skip
    flags.add_argument("-e", "--enableforces", dest="e", type=_switch, help="0: `ligature teleop` sends no forces")
    flags.add_argument("-n", "--ndevs", dest="n", type=int, help="the first N input devices, if -i is not given")
    for words, what in _WITHOUT_EFFECT.items():
        flags.add_argument(*words, dest=words[0].lstrip("-"), help=f"{what}; accepted, without effect")
    return flags


def _arm(text: str) -> str:
    """The text of an arm, unless it is none."""
    try:
        arm_entry(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    return text


def options_of(arguments: list[str]) -> RunOptions:
    """The run that AMBF's flags describe; exits with status 2 and a message on bad ones."""
    flags = parser()
    given = flags.parse_args(arguments)
    text = given.l if given.l is not None else ("" if given.a else "1")
    try:
        models = model_indices(text)
    except ValueError as error:
        flags.error(f"-l {error}")
    try:
        devices = model_indices(given.i)
    except ValueError as error:
        flags.error(f"-i {error}")
    if given.n is not None and given.n < 0:
        flags.error(f"-n {given.n}: the number of devices must be 0 or more")
    if given.n is not None and not given.i:
        devices = tuple(range(given.n))
    if not 0.0 <= given.d <= LARGEST:
        flags.error(f"-d must be a rate in Hz, at least 0, not {given.d:g}")
    try:
        only = arm_names(given.only)
    except ValueError as error:
        flags.error(f"--only {error}")
    try:
        name_prefix(given.ns)
    except ValueError as error:
        flags.error(f"--ns {error}")
    for root in given.root:
        if not Path(root).is_dir():
            flags.error(f"--root '{root}' is not a folder; give one that exists")
    if not given.p >= 1 or not 0 < given.s <= LARGEST:
        flags.error(f"-p must be at least 1 update per second, and -s larger than 0, not {given.p:g} and {given.s:g}")
    for name in ("override_min_comm_freq", "override_max_comm_freq"):
        frequency = getattr(given, name)
        if frequency is not None and frequency < 1:
            flags.error(f"--{name} must be at least 1 Hz, not {frequency}")
    return RunOptions(
        given.launch_file, models, tuple(f for f in (given.a or "").split(",") if f), tuple(given.root), given.ns,
        min(given.p, MAX_UPDATE_RATE), given.s,
        min_hz=given.override_min_comm_freq, max_hz=given.override_max_comm_freq,
        names=given.names, arms=tuple(given.arm), src_crtk=given.src_crtk, cameras=given.cameras,
        window=bool(given.g), camera_windows=bool(given.g), notes=_notes(given), devices=devices, only=only,
        masters=not given.no_masters,
        base_frames=given.base_frames, haptic_rate=given.d, haptic_fixed=bool(given.f), haptic_forces=given.e,
        allow_plugins=given.allow_plugins,
    )  # fmt: skip


def main() -> None:
    """Entry point of the command."""
    supervise(options_of(sys.argv[1:]))


def _switch(text: str) -> bool:
    """A flag as AMBF takes it: 1 or 0, true or false, yes or no, on or off."""
    if text.lower() in ("1", "true", "yes", "on"):
        return True
    if text.lower() in ("0", "false", "no", "off"):
        return False
    raise argparse.ArgumentTypeError(f"'{text}' is neither 1 nor 0")


def _notes(given: argparse.Namespace) -> tuple[str, ...]:
    """Notes on flags that have no effect."""
    notes = [
        f"{words[0]} ({what}) has no effect here"
        for words, what in _WITHOUT_EFFECT.items()
        if getattr(given, words[0].lstrip("-")) is not None
    ]
    if given.t is False:
        notes.append("-t 0: the step is always fixed; simulated time falls behind on a machine that is too slow")
    if given.p > MAX_UPDATE_RATE:
        notes.append(f"-p {given.p:g}: a tick lasts 1 ms; using {MAX_UPDATE_RATE:g} updates per second")
        return tuple(notes)
    return (*notes, *rate_notes(given.p))
