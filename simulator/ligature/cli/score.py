"""``ligature score``: the score of a task in a running simulation, a bag, or a record of a run."""

from __future__ import annotations

import json as text
import os
from collections.abc import Mapping
from pathlib import Path

from rich.console import Console

import ligature
from ligature.bus.record import Record, is_record
from ligature.cli.master import DEFAULT_MASTER, master_answers
from ligature.paths import reason


def score(task: str, file: Path | None, scene: Path | None, timeout: float, json: bool, console: Console) -> int:
    """Print score and measures; status 0 when the task was done, 1 when it was not, 2 when nothing could be judged."""
    try:
        if file is None:
            report, measures = _live(task, timeout)
        elif is_record(file):
            report, measures = _recorded(task, file, scene)
        else:
            report, measures = _in_bag(task, file, scene)
    except ligature.SceneError as error:
        console.print(str(error.diagnostics[0]), style="red", markup=False)
        return 2
    except OSError as error:
        console.print(f"{file}: {reason(error)}", style="red", markup=False)
        return 2
    except (ValueError, RuntimeError) as error:
        console.print(str(error), style="red", markup=False)
        return 2
    if json:
        console.print(text.dumps({"task": task, "score": report, "measures": measures}), markup=False)
    else:
        for name, value in {**report, **measures}.items():
            console.print(f"{name}: {value:.6g}" if isinstance(value, float) else f"{name}: {value}", markup=False)
    return 0 if report["success"] else 1


Figures = tuple[Mapping[str, object], Mapping[str, object]]


def _live(task: str, timeout: float) -> Figures:
    """The next score of a simulator that judges ``task``."""
    uri = os.environ.setdefault("ROS_MASTER_URI", DEFAULT_MASTER)
    if not master_answers(uri):
        raise RuntimeError(f"no ROS master answers at {uri}; start the simulator with 'ligature run … --task {task}'")
    from ligature.ros.scores import next_score

    return next_score(task, timeout)


def _recorded(task: str, file: Path, scene: Path | None) -> Figures:
    """Score a recorded run at its end, with all measures, by simulating it again."""
    from ligature.cli.resimulation import looks, resimulate
    from ligature.tasks import Attempt

    record, attempts = Record.read(file), list[Attempt]()

    def watch(simulation: ligature.Simulation) -> None:
        if not attempts:
            attempts.append(Attempt(simulation.scene, task))
        if looks(simulation):
            attempts[0].observe(simulation.state[0])

    if task == "pose_estimation":
        raise ValueError(f"{file}: a record of a run contains no reported pose; score a bag")
    resimulate(record, scene, watch).close()
    return attempts[0].judge().report(), attempts[0].monitor.measures().report()


def _in_bag(task: str, file: Path, scene: Path | None) -> Figures:
    from ligature.ros.bags import judge, opened

    with opened(file):
        pass
    if scene is None:
        raise ValueError("a bag contains poses but no scene; name the launch file with '--scene'")
    found, attempt = judge(file, ligature.load(str(scene)), task)
    measures = attempt.monitor.measures().report()
    return found.report(), {name: measures[name] for name in measures if name in ("time", "passages") or "path" in name}
