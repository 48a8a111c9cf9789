"""What one generated scene goes through: checked as `ligature check` does, simulated for a second, and judged."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
from ligature.adf import Severity
from ligature.cli.check import findings
from ligature.model.commands import ActuatorCommand, BodyCommand, CommandType, Release
from ligature.model.scene import Scene

from tests.fuzz.scenes import Case, scene

TICKS, STRIDE = 1000, 20
FAST = 50.0
"""Speed in m/s below which all bodies stay; one that falls freely for a second reaches 10."""


def simulate(folder: Path, number: int) -> str:
    """Write scene ``number`` to ``folder`` and run it; returns ``clean``, ``errors`` or ``refused``, by what check states.

    Raises AssertionError for what must not happen: errors without place, states that are not finite, divergence, and
    bodies above `FAST` in a scene without errors, unless it is sent commands, a loop does not close at its start, or
    check states that it starts with a spring that throws bodies.
    """
    case = scene(number)
    for name, text in case.files.items():
        (folder / name).write_text(text)
    entry = folder / case.entry
    found = findings(entry, [], strict=False)
    errors = [finding for finding in found if finding.severity >= Severity.ERROR]
    fast = any(finding.code == "speed" for finding in found)
    assert all(error.mark is not None for error in errors), f"an error without a place: {errors}"
    try:
        loaded = ligature.load(entry)
    except ligature.SceneError:
        assert errors, "refused, while check finds nothing"
        return "refused"
    _run(loaded, case, strict=not (errors or fast or case.torn or case.driven))
    return "errors" if errors else "clean"


def _run(loaded: Scene, case: Case, strict: bool) -> None:
    simulation = ligature.Simulation(loaded)
    try:
        for tick in range(0, TICKS, STRIDE):
            if case.driven:
                _command(simulation, loaded, np.random.default_rng((case.number, tick)))
            simulation.step(STRIDE)
            for name in simulation.state.dtype.names or ():
                if simulation.state[name].dtype.kind == "f":
                    assert np.isfinite(simulation.state[name]).all(), (
                        f"'{name}' is not finite after {tick + STRIDE} ticks"
                    )
            speeds = np.linalg.norm(simulation.state["body_twist"][0, :, :3], axis=1)
            top_speed = int(speeds.argmax())
            key = loaded.bodies[top_speed].identity.key
            assert not strict or speeds[top_speed] < FAST, (
                f"'{key}' moves at {speeds[top_speed]:.0f} m/s after {tick + STRIDE} ticks; {simulation.problems[:1]}"
            )
        diverged = [str(problem) for problem in simulation.problems if problem.code == "diverged"]
        assert not (strict and diverged), diverged[0]
    finally:
        simulation.close()


def _command(simulation: ligature.Simulation, loaded: Scene, rng: np.random.Generator) -> None:
    """Command a body, its joints, or an actuator, as a client could; or let it go."""
    body = loaded.bodies[int(rng.integers(len(loaded.bodies)))]
    kind = CommandType(int(rng.integers(3)))
    if kind is CommandType.POSITION:
        pose = simulation.state["body_pose"][0, body.index].copy()
        pose[:3] += rng.normal(scale=0.05, size=3)
        target = tuple(pose.tolist())
    else:
        target = tuple(rng.normal(scale=0.2, size=6).tolist())
    values = tuple(rng.normal(scale=0.3, size=len(body.joints)).tolist())
    types = tuple(CommandType(int(t)) for t in rng.integers(3, size=len(values)))
    simulation.apply(BodyCommand(body.index, kind, target, types, values))
    if rng.random() < 0.3:
        simulation.apply(Release("body", body.index))
    if loaded.actuators and rng.random() < 0.3:
        actuator = int(rng.integers(len(loaded.actuators)))
        simulation.apply(ActuatorCommand(actuator, bool(rng.integers(2)), body.identity.identifier))
