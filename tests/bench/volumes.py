"""How fast a volume is drawn that a burr cuts: as a mesh, by rays, by a transfer function.

``python -m tests.bench.volumes [ROUNDS]``

Pictures of 640 x 480 with depth and ids of the drilling scene, each after a cut; the three ways take turns, so that what
else the machine does meets all of them. The processor time is that of all threads.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from dataclasses import replace

import ligature
import numpy as np
from ligature import Simulation
from ligature.model.voxels import Rendering
from ligature.render import Renderer, view_of

from tests.conftest import ROOT

PASSES = ("rgb", "depth", "ids")


def drawer(how: Rendering) -> tuple[Renderer, Callable[[int], None]]:
    """What draws the scene ``how``, and what takes the n-th picture."""
    scene = ligature.load(ROOT / "examples" / "plugins" / "drilling" / "drilling.yaml")
    bodies = [
        body
        if body.volume is None
        else replace(body, volume=replace(body.volume, look=replace(body.volume.look, rendering=how)))
        for body in scene.bodies
    ]
    sim = Simulation(replace(scene, bodies=tuple(bodies)), allow_plugins=True)
    state, camera = sim.state.copy(), sim.scene.cameras[0]
    view = view_of(camera, state["camera_world"][0, 0], (640, 480))
    renderer = Renderer(sim.scene)
    form = sim.scene.volumes[0].form
    voxels = state["volume_value"][0].reshape(form.values.shape)

    def draw(n: int) -> None:
        first = 20 + n % 40
        voxels[first : first + 4, 30:34, 24:28] = 0
        renderer.render(state, view, PASSES)

    return renderer, draw


def main() -> int:
    """Entry point."""
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 30
    ways = {how: drawer(how) for how in Rendering}
    taken: dict[Rendering, list[tuple[float, float]]] = {how: [] for how in ways}
    for n in range(rounds + 1):
        for how, (_, draw) in ways.items():
            begin = time.perf_counter(), time.process_time()
            draw(n)
            if n:
                taken[how].append((time.perf_counter() - begin[0], time.process_time() - begin[1]))
    device = next(iter(ways.values()))[0].device
    sys.stdout.write(f"{device}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}, medians of {rounds} pictures\n")
    for how, times in taken.items():
        wall, used = np.median(times, axis=0)
        best = min(times)[0]
        sys.stdout.write(
            f"{how.value.lower()}: {1e3 * wall:.0f} ms ({1 / wall:.1f} frames/s), shortest {1e3 * best:.0f} ms "
            f"({1 / best:.1f} frames/s), of the processor {1e3 * used:.0f} ms\n"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
