"""A recorded run, simulated again, as an episode of a dataset: labelled by the ground truth, judged if possible."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import ligature
from ligature.bus.record import Record
from ligature.cli.options import RunOptions
from ligature.cli.resimulation import looks, resimulate
from ligature.cli.sampling import Sampled
from ligature.datasets import DatasetWriter
from ligature.datasets.interrupts import interrupted_once
from ligature.datasets.labels import ACTIVITIES, ActivityWatch, MarkedPhases, phase_of
from ligature.model.commands import MarkPhase
from ligature.tasks import Attempt

NEEDS_REPORT = "pose_estimation"
"""The task that is scored by a reported pose."""


class _Sampler:
    """Samples a run while it is simulated again; ``files`` owns the writer."""

    def __init__(self, dataset: Sampled, task: str, source: str, marked: MarkedPhases, files: ExitStack) -> None:
        self._dataset, self._task, self._source, self._files = dataset, task, source, files
        self._marked = marked
        self._writer: DatasetWriter | None = None
        self._attempt: Attempt | None = None

    def watch(self, simulation: ligature.Simulation) -> None:
        """Sample an update when a sample is due."""
        if self._writer is None:
            self._begin(simulation)
        assert self._writer is not None
        state = simulation.state[0]
        if self._attempt is not None and looks(simulation):
            self._attempt.observe(state)
        self._writer.sample(self._phase(simulation))

    def _phase(self, simulation: ligature.Simulation) -> str:
        """What the operator marked; where nobody marked anything, what the arms do."""
        if self._marked.names:
            return self._marked.at(_updates(simulation))
        return phase_of(self._activities.activities(simulation.state[0]))

    def _begin(self, simulation: ligature.Simulation) -> None:
        given, sampling = self._dataset, self._dataset.sampling
        most = 1.0 / (simulation.dt * simulation.ticks_per_update)
        if sampling.rate > most * (1.0 + 1e-9):
            raise ValueError(
                f"--rate is {sampling.rate:g}, and the run has {most:g} updates a second; give at most that"
            )
        self._attempt = Attempt(simulation.scene, self._task) if self._task else None
        self._activities = ActivityWatch(simulation.scene)
        writer = DatasetWriter(
            given.path, simulation, sampling.cameras, sampling.size, sampling.rate, self._marked.names or ACTIVITIES,
            given.text or self._task, self._marked.gestures, {"source": self._source},
        )  # fmt: skip
        self._writer = self._files.enter_context(writer)

    def finish(self) -> str:
        """End the episode; returns its outcome as text."""
        assert self._writer is not None
        found, why = self._dataset.success, "" if self._dataset.success is None else "as the operator found"
        figures: dict[str, float | int | str] = {}
        if found is None and self._attempt is not None:
            score = self._attempt.judge().report()
            found, why = bool(score["success"]), str(score.get("why", ""))
        if self._attempt is not None:
            figures = {f"measured_{name}": value for name, value in self._attempt.monitor.measures().report().items()}
        self._writer.end_episode(bool(found), judged=found is not None, why=why, **figures)
        if found is None:
            return (
                "the episode has no result: name its task with '--task', or its outcome with '--success' or '--failure'"
            )
        return f"the episode is a {'success' if found else 'failure'}{': ' + why if why else ''}"


def _updates(simulation: ligature.Simulation) -> int:
    """Updates since the start of the run, as records count them."""
    return round(simulation.time / simulation.dt) // simulation.ticks_per_update


def sampled(record: Record, scene: Path | None, dataset: Sampled) -> tuple[ligature.Simulation, str]:
    """Simulate ``record`` again into ``dataset``; returns the simulation at its end, and how the episode went.

    Raises ValueError for a task that a record cannot be judged by.
    """
    if dataset.task == NEEDS_REPORT:
        raise ValueError(f"a record of a run contains no reported pose, which '{NEEDS_REPORT}' needs")
    recorded = RunOptions.from_text(record.header.options).task
    task = dataset.task or (recorded if recorded != NEEDS_REPORT else "")
    with interrupted_once(), ExitStack() as files:
        marks = [(update, command.phase) for update, command in record.commands if isinstance(command, MarkPhase)]
        sampler = _Sampler(dataset, task, "recorded run", MarkedPhases(marks), files)
        simulation = resimulate(record, scene, sampler.watch)
        return simulation, sampler.finish()
