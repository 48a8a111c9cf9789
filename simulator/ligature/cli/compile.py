"""``ligature compile``: compiles kernels ahead, by running scenes for a moment, each in a process of its own."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from rich.console import Console

import ligature
from ligature.bundle import SCENES
from ligature.cli.numbers import counted
from ligature.datasets import DatasetError, DatasetWriter
from ligature.model.frames import inverse, matrix_pose7, pose7_matrix
from ligature.model.piercing import Needle
from ligature.paths import reason
from ligature.process import end_with_parent, program
from ligature.robots.arm import Kinematics
from ligature.robots.ecm import Ecm
from ligature.robots.mtm import Mtm
from ligature.robots.psm import Psm
from ligature.tasks.plans import COARSE, throws
from ligature.tasks.throws import NeedleArc, Throw

COMPILED_SCENES = tuple(
    tuple(SCENES / name / "launch.yaml" for name in names)
    for names in (("suturing",), ("needle_insertion", "soft_suturing"))
)
"""Bundled scenes that between them need nearly all kernels, by process.

One begins with threads; the other with bodies and tissue, so that it need not wait for the first.
"""

TICKS = 300
"""Ticks that each scene runs, of which arms find their home for the last part."""

PICTURES = 3
"""Of the first one nothing is kept, the second keeps what stands still, the third begins with it."""

BEFORE, BEYOND, SPEED = 0.005, 0.01, 0.05
"""Metres of a needle's circle before the entry at which its tip begins, and of thread that goes in; metres a second."""

FIRM = 20.0
"""Metres a second by which the needle goes back for each metre that it is beside its circle."""


def compile_ahead(scenes: Sequence[Path], console: Console) -> int:
    """Compile what ``scenes`` need, or what most need; returns 1 when one of them cannot run."""
    groups = [(scene,) for scene in scenes] or COMPILED_SCENES
    begin = time.monotonic()
    console.print(
        f"compiling the kernels of {counted(sum(map(len, groups)), 'scene')} in "
        f"{counted(len(groups), 'process', 'processes')}; this takes 1 to 3 minutes, once",
        markup=False,
    )
    running = {group: _start(group, console) for group in groups}
    status = 0
    for group, (process, reader) in running.items():
        reader.join()
        if process.wait():
            names = ", ".join(map(str, group))
            console.print(f"{names} cannot run (status {process.returncode})", style="red", markup=False)
            status = 1
    console.print(f"compiled after {time.monotonic() - begin:.0f} s", markup=False)
    return status


def _start(scenes: Sequence[Path], console: Console) -> tuple[subprocess.Popen[str], threading.Thread]:
    """A process that runs ``scenes`` one by one, and the thread that shows what it prints."""
    process = subprocess.Popen(
        program("ligature.cli.compile", *map(str, scenes)), stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        encoding="utf-8", errors="replace", preexec_fn=end_with_parent,
    )  # fmt: skip

    def show() -> None:
        assert process.stdout is not None
        for line in process.stdout:
            console.print(f"{scenes[-1].parent.name or scenes[-1]}: {line.rstrip()}", style="dim", markup=False)

    reader = threading.Thread(target=show, daemon=True)
    reader.start()
    return process, reader


def run_for_a_moment(launch: Path) -> None:
    """Call what a run of the scene calls; raises `ligature.SceneError`.

    Ticks, arms that move, a needle and its thread that pass through tissue, a restored snapshot, pictures, a dataset:
    what is compiled here does not stop a run for seconds where it is first needed.
    """
    simulation = ligature.Simulation(ligature.load(launch))
    simulation.step(TICKS)
    for name in simulation.arms:
        simulation.arms[name].home()
    simulation.step(TICKS)
    psm = Psm("LARGE_NEEDLE_DRIVER:400006")
    for kinematics in (psm, Ecm(), Mtm("left")):
        _solve(kinematics)
    joints = np.zeros(psm.n)
    psm.solve(psm.frames(joints)[-1], joints, joints)
    for needle in simulation.scene.needles[:1]:
        for throw in islice(throws(simulation.scene, simulation.state[0], needle.arc.radius, COARSE), 1):
            _pierce(simulation, needle, throw)
    simulation.restore(simulation.snapshot())
    simulation.step()
    _draw(simulation)


def _solve(kinematics: Kinematics) -> None:
    """Solve forward and inverse kinematics and the Jacobians of an arm."""
    middle = 0.5 * (kinematics.lower + kinematics.upper)
    pose = kinematics.forward(middle)
    kinematics.inverse(pose), kinematics.inverse(pose, middle)
    kinematics.jacobian_body(middle), kinematics.jacobian_spatial(middle)


def _pierce(simulation: ligature.Simulation, needle: Needle, throw: Throw) -> None:
    """Turn a needle on its circle until its thread is in, and release it."""
    body = simulation.scene.bodies[needle.body]
    arc, handle = NeedleArc.of(needle, body), simulation.bodies[body.identity.topic]
    spin = SPEED / arc.radius * throw.normal
    poses = [
        throw.arc_at(tip / arc.radius, arc) @ inverse(arc.T_body_arc)
        for tip in np.arange(-BEFORE, arc.length + BEYOND, SPEED * simulation.dt)
    ]
    handle.set_pose(matrix_pose7(poses[0]).tolist())
    for T_world_body in poses:
        wanted, now = T_world_body @ body.T_body_inertial, pose7_matrix(handle.pose) @ body.T_body_inertial
        back = FIRM * (wanted[:3, 3] - now[:3, 3])
        handle.command_twist([*(np.cross(spin, now[:3, 3] - throw.centre) + back), *spin])
        simulation.step()
    handle.release()
    simulation.step(TICKS)


def _draw(simulation: ligature.Simulation) -> None:
    """Take pictures with the first camera, if any, until they begin with what stands still; then record one sample."""
    from ligature.render.context import RenderUnavailable

    for camera in list(simulation.cameras)[:1]:
        try:
            for _ in range(PICTURES):
                simulation.cameras[camera].capture()
                simulation.step(TICKS)
        except RenderUnavailable:
            return
        with TemporaryDirectory() as folder, DatasetWriter(Path(folder) / "moment.h5", simulation, [camera]) as writer:
            writer.sample()


def main() -> None:
    """Entry point of a process that compiles: its arguments are launch files."""
    try:
        for argument in sys.argv[1:]:
            run_for_a_moment(Path(argument))
    except (ligature.SceneError, DatasetError) as error:
        sys.exit(str(error))
    except OSError as error:
        sys.exit(reason(error))
