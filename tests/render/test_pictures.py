"""The pictures of the documentation, drawn on the software rasteriser and compared with what is committed.

Set ``LIGATURE_UPDATE_PICTURES=1`` to draw them anew, and look at them before committing.
"""

from __future__ import annotations

import os
from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature import Simulation
from ligature.render import Renderer, RenderUnavailable, view_of
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
PICTURES = ROOT / "docs" / "pictures"
POSES = {
    "psm1/baselink": [0.025, -0.159, 0.205, 0.5, 0.3, 0.2, 0.5, 0.5],
    "psm2/baselink": [0.07, -0.143, 0.178, -0.4, -0.2, 0.1, 0.3, 0.3],
}


@pytest.fixture(scope="module")
def picture() -> np.ndarray:
    simulation = Simulation(ligature.load(ROOT / "scenes" / "suturing_small" / "launch.yaml"))
    for arm, pose in POSES.items():
        simulation.bodies[arm].command_joints(pose)
    simulation.step(2500)
    try:
        renderer = Renderer(simulation.scene)
    except RenderUnavailable as error:
        pytest.skip(str(error))
    camera = simulation.scene.cameras[0]
    view = view_of(camera, simulation.state["camera_world"][0, 0], (960, 600))
    frame = renderer.render(simulation.state, view)
    assert renderer.problems == []
    return frame.rgb


def test_the_small_scene_looks_as_in_the_readme(picture: np.ndarray) -> None:
    path = PICTURES / "suturing_small.png"
    if os.environ.get("LIGATURE_UPDATE_PICTURES"):
        path.parent.mkdir(exist_ok=True)
        Image.fromarray(picture).save(path, optimize=True)
    with Image.open(path) as image:
        expected = np.asarray(image.convert("RGB"), dtype=float)
    assert picture.shape == expected.shape
    difference = np.abs(picture.astype(float) - expected).max(axis=2)
    assert (difference > 24).mean() < 0.01
