"""How fast cameras are drawn, beside PyBullet's own renderer on the same view of the same scene in the same run.

``python -m tests.bench.render``

Physics paces itself at 1 kHz in a process of its own while frames are timed, as in ``ligature run``.
"""

from __future__ import annotations

import multiprocessing
import os
import statistics
import sys
import time
from pathlib import Path
from typing import Any

import ligature
import numpy as np
from ligature import Simulation
from ligature.model.poses import pose7_matrices
from ligature.model.scene import Scene
from ligature.render import CameraView, Renderer, view_of
from ligature.render.thread import Tube
from ligature.render.visuals import VisualLoader

ROOT = Path(__file__).resolve().parents[2]
PASSES = ("rgb", "depth", "ids")
SIZE = (640, 480)
SECONDS = 3.0
LOOKS = {None: "as the device is given", 4: "4 samples", 0: "hard edges"}
CHUNK = 2500
"""Triangles that PyBullet takes at a time."""


def scenes() -> list[tuple[str, Path, tuple[int, ...] | None]]:
    """Name, launch file and models of what is measured."""
    found: list[tuple[str, Path, tuple[int, ...] | None]] = [
        (name, ROOT / "scenes" / name / "launch.yaml", None) for name in ("suturing", "suturing_small")
    ]
    corpus = Path(os.environ.get("LIGATURE_CORPUS", ROOT.parent / "shared" / "corpus"))
    if (launch := corpus / "suturing_scene" / "launch.yaml").exists():
        found.append(("corpus: phantom, needle, thread, 2 PSMs", launch, (10, 11, 6, 7, 8, 9)))
    return found


def run_physics(launch: Path, models: tuple[int, ...] | None, ready: Any, stop: Any, result: Any) -> None:
    """Step at 1 kHz of wall time until ``stop``; puts the real-time factor in ``result``."""
    simulation = Simulation(ligature.load(launch, models))
    simulation.step(200)
    ready.set()
    begin, ticks = time.perf_counter(), 0
    while not stop.is_set():
        due = int((time.perf_counter() - begin) * 1e3) - ticks
        if due > 0:
            simulation.step(min(due, 5))
            ticks += min(due, 5)
        else:
            time.sleep(2e-4)
    result.value = ticks / ((time.perf_counter() - begin) * 1e3)


def frames_per_second(draw: Any, seconds: float) -> tuple[float, float]:
    """Median rate of ``draw``, called for ``seconds``, and the milliseconds of processor time of a frame.

    The second, over all threads, depends little on what else the machine does.
    """
    draw()
    times: list[float] = []
    used, end = time.process_time(), time.perf_counter() + seconds
    while time.perf_counter() < end or len(times) < 3:
        begin = time.perf_counter()
        draw()
        times.append(time.perf_counter() - begin)
    return 1.0 / statistics.median(times), (time.process_time() - used) / len(times) * 1e3


def beside_physics(launch: Path, models: tuple[int, ...] | None, draw: Any) -> tuple[float, float]:
    """Frames a second of ``draw`` while physics runs at 1 kHz, and the real-time factor that physics holds."""
    context = multiprocessing.get_context("spawn")
    ready, stop, factor = context.Event(), context.Event(), context.Value("d", 0.0)
    process = context.Process(target=run_physics, args=(launch, models, ready, stop, factor))
    process.start()
    ready.wait()
    rate, _ = frames_per_second(draw, SECONDS)
    stop.set()
    process.join()
    return rate, float(factor.value)


class Tiny:
    """PyBullet's software renderer with the same triangles at the same places."""

    def __init__(self, scene: Scene, simulation: Simulation) -> None:
        import pybullet

        self._bullet, self._client = pybullet, pybullet.connect(pybullet.DIRECT)
        T_world = pose7_matrices(np.concatenate([simulation.state[key][0] for key in ("body_pose", "ghost_world")]))
        drawn = [
            (p.triangles, T_world[p.owner] @ p.T_owner_piece) for p in VisualLoader().of_scene(scene) if not p.coarse
        ]
        drawn += [(Tube(scene, rod).triangles(T_world), np.eye(4)) for rod in scene.rods]
        for triangles, T in drawn:
            for first in range(0, len(triangles.faces), CHUNK):
                self._add(triangles.positions @ T[:3, :3].T + T[:3, 3], triangles.faces[first : first + CHUNK])

    def _add(self, positions: Any, faces: Any) -> None:
        used, index = np.unique(faces, return_inverse=True)
        lists = {"vertices": positions[used].tolist(), "indices": index.reshape(-1).tolist()}
        shape = self._bullet.createVisualShape(self._bullet.GEOM_MESH, **lists, physicsClientId=self._client)
        assert shape >= 0
        self._bullet.createMultiBody(0, -1, shape, physicsClientId=self._client)

    def draw(self, view: CameraView) -> Any:
        """Colour, depth and ids of ``view``."""
        return self._bullet.getCameraImage(
            view.width,
            view.height,
            view.view.T.reshape(-1).tolist(),
            view.projection.T.reshape(-1).tolist(),
            shadow=0,
            renderer=self._bullet.ER_TINY_RENDERER,
            physicsClientId=self._client,
        )


def main() -> int:
    """Entry point."""
    for name, launch, models in scenes():
        scene = ligature.load(launch, models)
        simulation = Simulation(scene)
        simulation.step(200)
        view = view_of(scene.cameras[0], simulation.state["camera_world"][0, 0], SIZE)
        write, state = sys.stdout.write, simulation.state.copy()
        tiny = Tiny(scene, simulation)
        reference, effort = frames_per_second(lambda tiny=tiny, view=view: tiny.draw(view), SECONDS)
        for samples in (None, 4, 0):
            renderer = Renderer(scene, samples)

            def draw(renderer: Renderer = renderer, view: CameraView = view, state: Any = state) -> None:
                state["body_pose"][0, 0, 0] += 1e-9  # something always moves, so that shadow maps are drawn anew
                renderer.render(state, view, PASSES)

            alone, own = frames_per_second(draw, SECONDS)
            loaded, factor = beside_physics(launch, models, draw)
            write(
                f"{name}, {SIZE[0]}x{SIZE[1]} {'+'.join(PASSES)}, {renderer.triangles} triangles, {LOOKS[samples]}, "
                f"{renderer.device}: {alone:.1f} frames/s alone ({alone / reference:.1f} times PyBullet's {reference:.1f}), "
                f"{own:.0f} ms of processor time a frame (PyBullet's {effort:.0f}), "
                f"{loaded:.1f} beside physics at real-time factor {factor:.2f}\n"
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
