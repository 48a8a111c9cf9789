"""The pictures of the documentation, drawn on the software rasteriser and compared with what is committed.

Set ``LIGATURE_UPDATE_PICTURES=1`` to draw them anew, and look at them before committing.
"""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature import Simulation
from ligature.model.frames import matrix_pose7, pose7_matrix
from ligature.render import CameraView, Frame, Renderer, view_of
from ligature.render.camera import perspective

from tests.opengl import opengl
from tests.render.stage import assert_looks_like
from tests.wound import pass_through_the_wound

ROOT = Path(__file__).resolve().parents[2]
PICTURES = ROOT / "docs" / "pictures"
SMALL = ROOT / "scenes" / "suturing_small" / "launch.yaml"
LAB = (10, 11, 6, 7, 8, 9)
"""Phantom, ghosts and the two arms of the lab's scene."""

MOVED = 0.02
"""Share of a picture that may change without notice: physics is not what these tests are about."""


def posed(launch: Path, models: tuple[int, ...] | None, arms: dict[str, list[float]], ticks: int) -> Simulation:
    """A scene with its arms brought to joint positions."""
    simulation = Simulation(ligature.load(launch, models))
    for arm, position in arms.items():
        simulation.bodies[arm].command_joints(position)
    simulation.step(ticks)
    return simulation


def renderer_of(simulation: Simulation) -> Renderer:
    with opengl():
        return Renderer(simulation.scene)


def view(simulation: Simulation, camera: int, size: tuple[int, int]) -> CameraView:
    return view_of(simulation.scene.cameras[camera], simulation.state["camera_world"][0, camera], size)


def body(simulation: Simulation, name: str) -> np.ndarray:
    """Pose of the body that is called ``name``."""
    index = next(b.index for b in simulation.scene.bodies if b.identity.name == name)
    return np.array(simulation.state["body_pose"][0, index])


def in_colours(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """Numbers as colours from yellow (``low``) over green to dark blue (``high``); black where not finite."""
    stops = np.array([[253, 231, 37], [94, 201, 98], [33, 145, 140], [59, 82, 139], [68, 1, 84]], dtype=float)
    share = np.clip((np.where(np.isfinite(values), values, high) - low) / (high - low), 0, 1) * (len(stops) - 1)
    step = np.minimum(share.astype(int), len(stops) - 2)
    mixed = stops[step] + (share - step)[..., None] * (stops[step + 1] - stops[step])
    return np.where(np.isfinite(values)[..., None], mixed, 0).astype(np.uint8)


def in_labels(ids: np.ndarray) -> np.ndarray:
    """Ids as colours that differ from those of their neighbours; black is background."""
    i = ids.astype(np.int64)
    colours = np.stack([60 + i * 89 % 190, 60 + i * 151 % 190, 60 + i * 47 % 190], axis=-1)
    return np.where((ids > 0)[..., None], colours, 0).astype(np.uint8)


def passes(frame: Frame, low: float, high: float, fourth: np.ndarray) -> np.ndarray:
    """Colour, depth, ids and a fourth picture side by side, two by two."""
    depth = in_colours(frame.depth, low, high)
    return np.vstack([np.hstack([frame.rgb, fourth]), np.hstack([depth, in_labels(frame.ids)])])


@pytest.fixture(scope="module")
def small() -> Simulation:
    arms = {
        "psm1/baselink": [0.025, -0.159, 0.205, 0.5, 0.3, 0.2, 0.5, 0.5],
        "psm2/baselink": [0.07, -0.143, 0.178, -0.4, -0.2, 0.1, 0.3, 0.3],
    }
    return posed(SMALL, None, arms, 2500)


@pytest.fixture(scope="module")
def soft() -> Simulation:
    arms = {
        "psm1/baselink": [-0.05, -0.12, 0.165, 0.5, 0.3, 0.2, 0.5, 0.5],
        "psm2/baselink": [0.0, -0.12, 0.17, -0.4, -0.2, 0.1, 0.3, 0.3],
    }
    simulation = posed(ROOT / "scenes" / "soft_suturing" / "launch.yaml", None, arms, 1500)
    pass_through_the_wound(simulation)
    return simulation


def test_the_small_scene_looks_as_in_the_readme(small: Simulation) -> None:
    renderer = renderer_of(small)
    frame = renderer.render(small.state, view(small, 0, (960, 600)))
    assert renderer.problems == []
    assert_looks_like(frame.rgb, PICTURES / "suturing_small.png", MOVED)


def test_the_small_scene_has_its_ground_truth(small: Simulation) -> None:
    frame = renderer_of(small).render(small.state, view(small, 0, (480, 360)))
    normals = (127.5 + 127.5 * frame.normals).astype(np.uint8)
    normals[frame.ids == 0] = 0
    assert_looks_like(passes(frame, 0.05, 0.2, normals), PICTURES / "suturing_small_passes.png", MOVED)


def test_a_needle_is_steel_and_a_thread_is_round_from_near(small: Simulation) -> None:
    eye, needle = np.array(small.state["camera_world"][0, 0, :3]), body(small, "Needle")[:3]
    away = (eye - needle) / np.linalg.norm(eye - needle)
    right = np.cross([0.0, 1.0, 0.0], away)
    R = np.array([right / np.linalg.norm(right), np.cross(away, right) / np.linalg.norm(right), away])
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, -R @ (needle + 0.06 * away)
    near = CameraView(T, perspective(0.6, 1.6, 0.001, 10.0), 0.001, 10.0, 720, 450)
    frame = renderer_of(small).render(small.state, near)
    assert_looks_like(frame.rgb, PICTURES / "suturing_small_near.png", MOVED)
    names = [b.identity.name for b in small.scene.bodies]
    steel = frame.rgb[frame.ids == 1 + names.index("Needle")].astype(int)
    assert steel.max() > 200 and steel.min() < 90, "bare metal shows lights and the dark between them"
    assert np.abs(steel.max(axis=1) - steel.min(axis=1)).mean() < 40, "steel has no colour of its own"
    thread = frame.rgb[frame.ids == 1 + names.index("Thread")].astype(int)
    assert thread.std(axis=0).max() > 8, "a round thread is lighter in the middle than at its sides"


def test_a_needle_in_soft_tissue_crosses_the_wound(soft: Simulation) -> None:
    """Shaft between the lips, thread behind it, a mark where it went in; and the pad through the endoscope."""
    pad = body(soft, "Pad")[:3]
    at = pad + [0.0, 0.006, 0.0075]
    frame = renderer_of(soft).render(soft.state, from_above(at, at + [0.02, -0.05, 0.06], (720, 450)), ("rgb", "ids"))
    assert_looks_like(frame.rgb, PICTURES / "tissue.png", MOVED)
    names = [b.identity.name for b in soft.scene.bodies]
    assert {"Needle", "Pad", "Thread"} <= {names[i - 1] for i in np.unique(frame.ids) if i}


def test_the_soft_scene_looks_as_in_the_pages(soft: Simulation) -> None:
    frame = renderer_of(soft).render(soft.state, view(soft, 0, (640, 480)))
    assert_looks_like(frame.rgb, PICTURES / "soft_suturing.png", MOVED)


def from_above(at: np.ndarray, eye: np.ndarray, size: tuple[int, int]) -> CameraView:
    """What is seen from ``eye`` (3,) that looks at ``at`` (3,), z up."""
    away = (eye - at) / np.linalg.norm(eye - at)
    right = np.cross([0.0, 0.0, 1.0], away)
    right /= np.linalg.norm(right)
    R = np.array([right, np.cross(away, right), away])
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, -R @ eye
    return CameraView(T, perspective(0.45, size[0] / size[1], 0.001, 10.0), 0.001, 10.0, *size)


def test_a_labs_scene_is_seen_with_both_eyes_depth_and_ids(corpus: Path) -> None:
    arms = {
        "/ambf/env/psm1/baselinksimple": [-0.008, -0.12, 0.235, 0.5, 0.3, 0.2, 0.5, 0.5],
        "/ambf/env/psm2/baselinksimple": [-0.005, -0.15, 0.235, -0.4, -0.2, 0.1, 0.3, 0.3],
    }
    simulation = posed(corpus / "suturing_scene" / "launch.yaml", LAB, arms, 1)
    back = pose7_matrix(body(simulation, "CameraFrame"))
    back[:3, 3] += 0.06 * back[:3, 2]  # so that the instruments come into view
    simulation.bodies["/ambf/env/phantom/CameraFrame"].set_pose(matrix_pose7(back))
    simulation.step(1500)
    renderer = renderer_of(simulation)
    left, right = (renderer.render(simulation.state, view(simulation, eye, (640, 480))) for eye in (0, 1))
    assert_looks_like(passes(left, 0.1, 0.4, right.rgb), PICTURES / "lab_scene.png", MOVED)
    names = [b.identity.name for b in simulation.scene.bodies]
    seen = {names[i - 1] for i in np.unique(left.ids) if 0 < i <= len(names)}
    assert {"Needle", "Phantom", "Thread"} <= seen
