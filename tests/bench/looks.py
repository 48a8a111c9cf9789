"""How near the page's 3D view comes to the camera's picture: mean colours at the same pose, and both side by side.

    python -m tests.bench.looks [SCENE …] [--to FOLDER]

Prints the mean red, green and blue of both pictures and the largest difference of a channel over the mean level, and
writes ``looks-SCENE.png``: left what the camera sees, right what a browser draws. Needs Chromium.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import ligature
import numpy as np
from ligature.cockpit.address import Address
from ligature.cockpit.gate import Gate
from ligature.cockpit.page import serve
from ligature.cockpit.stage import Stage
from ligature.model.frames import matrix_pose7, pose7_matrix
from ligature.render import Renderer
from ligature.render.camera import view_of
from numpy.typing import NDArray
from PIL import Image

from tests.cockpit.conftest import Person, somebody, until

SCENES = ("suturing_small", "suturing", "soft_suturing", "needle_pick")
SIZE = (320, 240)
PAUSE = 1.0
"""Seconds between two looks at whether the browser has drawn everything."""


@dataclass(frozen=True, eq=False)
class Pair:
    """Two pictures (h, w, 3) of the same."""

    camera: NDArray[np.uint8]
    page: NDArray[np.uint8]

    @property
    def means(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Mean colours (3,) of both, 0..255."""
        return self.camera.reshape(-1, 3).mean(axis=0), self.page.reshape(-1, 3).mean(axis=0)

    @property
    def difference(self) -> float:
        """Largest difference of a channel's mean over the camera's mean level."""
        ours, theirs = self.means
        return float(np.abs(ours - theirs).max() / ours.mean())

    @property
    def together(self) -> Image.Image:
        """Both side by side."""
        return Image.fromarray(np.concatenate([self.camera, self.page], axis=1))


def compare(name: str, person: Person) -> Pair:
    """What the first camera of a scene sees, and what a browser draws from there."""
    scene = ligature.load(name)
    simulation = ligature.Simulation(scene)
    simulation.step(1)
    state, camera = simulation.state.copy(), scene.cameras[0]
    pose = state["camera_world"][0, camera.index]
    view = view_of(camera, pose, SIZE)
    renderer = Renderer(scene)
    ours = renderer.render(state, view, ("rgb",), camera.preprocessing_shaders).rgb
    renderer.release()
    simulation.close()
    clients: list[Any] = []
    server = serve(Address("127.0.0.1", 0), Gate(Address("127.0.0.1", 0), ""))
    try:
        stage = Stage(server, scene)
        for _ in range(2):  # tissue goes every other time
            stage.update(state)
        server.on_client_connect(clients.append)
        person.driver.get(f"http://127.0.0.1:{server.get_port()}")
        until(lambda: clients, "the browser is there")
        T = pose7_matrix(pose)
        R = np.eye(4)
        R[:3, :3] = np.column_stack([T[:3, 1], -T[:3, 2], -T[:3, 0]])  # right, down, into the picture
        x, y, z, w = matrix_pose7(R)[3:].tolist()
        angle = float(2.0 * np.arctan(0.5 * SIZE[1] / view.intrinsics[1, 1]))

        def drawn() -> NDArray[np.uint8]:
            shot = clients[0].get_render(
                SIZE[1], SIZE[0], wxyz=(w, x, y, z), position=T[:3, 3], fov=angle, transport_format="png"
            )
            return np.asarray(shot)[..., :3]

        last, still = drawn(), 0
        while still < 3:  # meshes and the surrounding come one after the other
            time.sleep(PAUSE)
            now = drawn()
            still = still + 1 if np.array_equal(now, last) and np.ptp(now) > 100 else 0
            last = now
        return Pair(ours, last)
    finally:
        server.stop()


def main() -> None:
    """Compare scenes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=SCENES)
    parser.add_argument("--to", type=Path, default=Path("build"))
    options = parser.parse_args()
    with somebody() as person:
        for name in options.scenes:
            pair = compare(name, person)
            camera, page = (" ".join(f"{value:5.1f}" for value in mean) for mean in pair.means)
            path = options.to / f"looks-{name}.png"
            pair.together.save(path)
            print(  # noqa: T201
                f"{name:16} camera {camera}  page {page}  largest difference {100 * pair.difference:.1f} %  {path}"
            )


if __name__ == "__main__":
    main()
