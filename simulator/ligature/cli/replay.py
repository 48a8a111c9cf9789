"""``ligature replay``: a run's record simulated again bit for bit, or a bag played into a running simulator."""

from __future__ import annotations

import os
import time
from pathlib import Path

from rich.console import Console

import ligature
from ligature.bus.record import Record, is_record
from ligature.cli.master import DEFAULT_MASTER, master_answers
from ligature.cli.numbers import counted
from ligature.cli.options import RunOptions
from ligature.cli.resimulation import TICK, resimulate
from ligature.cli.sampling import Sampled, Sampling
from ligature.paths import reason


def replay(
    file: Path,
    scene: Path | None,
    joints: str,
    speed: float,
    console: Console,
    dataset: Sampled | None = None,
    allow_plugins: bool = False,
) -> int:
    """Replay ``file``, or write it into ``dataset``; the exit status is 1 when a run did not repeat bit for bit."""
    try:
        if is_record(file):
            if joints or speed != 1.0:
                raise ValueError("--joints and -s play bags; leave them out: a record is simulated as fast as possible")
            return _again(Record.read(file), scene, dataset, console, allow_plugins)
        if dataset is not None:
            return _sampled_bag(file, scene, dataset, console)
        return _play(file, joints, speed, console)
    except ligature.SceneError as error:
        for diagnostic in error.diagnostics:
            console.print(str(diagnostic), style="red", markup=False)
    except OSError as error:
        console.print(f"{file}: {reason(error)}", style="red", markup=False)
    except (ValueError, RuntimeError) as error:
        console.print(str(error), style="red", markup=False)
    return 1


def _again(record: Record, scene: Path | None, dataset: Sampled | None, console: Console, allow_plugins: bool) -> int:
    rate = RunOptions.from_text(record.header.options).rate
    console.print(
        f"{counted(len(record.commands), 'command')}, {record.updates / rate:.3f} s of simulated time", markup=False
    )
    clock = time.perf_counter()
    if dataset is None:
        simulation = resimulate(record, scene, allow_plugins=allow_plugins)
    else:
        from ligature.cli.replay_dataset import sampled

        simulation, outcome = sampled(record, scene, dataset)
        console.print(outcome, markup=False)
    took, found = time.perf_counter() - clock, simulation.state_hash()
    console.print(
        f"{counted(len(record.commands), 'command')}, {simulation.time:.3f} s simulated in {took:.1f} s", markup=False
    )
    if record.begun:
        begin = record.start * simulation.ticks_per_update * TICK
        console.print(f"the recording covers the last {simulation.time - begin:.3f} s", markup=False)
    simulation.close()
    if found != record.end:
        console.print(
            f"the run ended in another state than recorded: {found} instead of {record.end}", style="red", markup=False
        )
        return 1
    console.print(f"the same bits: {found}", markup=False)
    return 0


def _sampled_bag(file: Path, scene: Path | None, dataset: Sampled, console: Console) -> int:
    """Convert the content of a bag to a dataset, without simulation."""
    from ligature.datasets.bags import record_bag
    from ligature.ros.bags import judge

    success, why = dataset.success, "" if dataset.success is None else "as the operator found"
    if success is None and dataset.task:
        if scene is None:
            raise ValueError("'--task' judges a bag in a scene: name its launch file with '--scene'")
        score = judge(file, ligature.load(scene), dataset.task)[0].report()
        success, why = bool(score["success"]), str(score.get("why", ""))
    sampling = dataset.sampling
    cameras = None if sampling.cameras == Sampling().cameras else sampling.cameras
    text = dataset.text or dataset.task
    count = record_bag(file, dataset.path, sampling.rate, cameras, sampling.size, text, success, why)
    outcome = "not judged" if success is None else f"a {'success' if success else 'failure'}{why and f': {why}'}"
    console.print(f"{counted(count, 'sample')} at {sampling.rate:g} a second; the episode is {outcome}", markup=False)
    return 0


def _play(file: Path, joints: str, speed: float, console: Console) -> int:
    uri = os.environ.setdefault("ROS_MASTER_URI", DEFAULT_MASTER)
    from ligature.ros.bags import opened

    with opened(file):
        pass
    if not master_answers(uri):
        console.print(f"no ROS master answers at {uri}; start the simulator with 'ligature run' first", markup=False)
        return 1
    from ligature.ros.playback import play

    sent = play(file, joints, speed, lambda text: console.print(text, markup=False))
    console.print(f"{counted(sent, 'command')} sent", markup=False)
    return 0
