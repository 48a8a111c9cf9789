"""What every scene of ours must do: load without complaint, run, stay finite, repeat bit for bit."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import ligature
import numpy as np
import pytest
from ligature import Simulation
from ligature.adf import Severity
from ligature.arms import ArmSet
from ligature.model.frames import axis_rotation, frame, inverse
from ligature.model.scene import Scene
from ligature.model.state import new_state
from ligature.render import Renderer, view_of
from PIL import Image

from tests.opengl import opengl
from tests.wound import pass_through_the_wound

SCENES = Path(__file__).resolve().parents[2] / "scenes"
LAUNCHES = sorted(SCENES.glob("*/launch*.yaml"))
AUTHORS = sorted(path.stem for path in SCENES.glob("author_*.py") if "\ndef texts(" in path.read_text(encoding="utf-8"))
"""Scripts that write files as text; pictures are another matter."""


@pytest.fixture(scope="module", params=LAUNCHES, ids=lambda path: f"{path.parent.name}/{path.stem}")
def launch(request: pytest.FixtureRequest) -> Path:
    return request.param


def run(launch: Path, ticks: int) -> ligature.Simulation:
    simulation = ligature.Simulation(ligature.load(launch))
    simulation.step(ticks)
    return simulation


def test_loads_without_warnings(launch: Path) -> None:
    findings = [d for d in ligature.load(launch).diagnostics if d.severity >= Severity.WARNING]
    assert not findings, "\n".join(map(str, findings))


def test_runs_a_second_and_stays_finite(launch: Path) -> None:
    simulation = run(launch, 1000)
    assert simulation.time == pytest.approx(1.0)
    for name in ("body_pose", "body_twist", "joint_position", "joint_velocity"):
        assert np.isfinite(simulation.state[name]).all(), name


def test_repeats_bit_for_bit(launch: Path) -> None:
    assert run(launch, 300).state_hash() == run(launch, 300).state_hash()


def test_is_drawn_with_something_in_the_middle(launch: Path) -> None:
    simulation = run(launch, 1)
    with opengl():
        renderer = Renderer(simulation.scene)
    view = view_of(simulation.scene.cameras[0], simulation.state["camera_world"][0, 0], (160, 120))
    frame = renderer.render(simulation.state, view)
    assert renderer.problems == []
    assert frame.ids[40:80, 40:120].all()
    assert frame.rgb[40:80, 40:120].std() > 3.0


def test_arms_of_the_field_are_there(launch: Path) -> None:
    """Names that clients look for: both PSMs with their tool, the needle or what else is handled, the camera frame."""
    scene = ligature.load(launch)
    arms = {"PSM2"} if launch.parent.name == "needle_insertion" else {"PSM1", "PSM2", "ECM"}
    assert arms <= {arm.name for arm in scene.arms}
    tools = {f"/ambf/env/{arm.lower()}/toolyawlink" for arm in arms if arm != "ECM"}
    assert {*tools, "/ambf/env/phantom/CameraFrame"} <= {body.identity.topic for body in scene.bodies}


def authored_by(name: str) -> ModuleType:
    """An authoring script, imported."""
    spec = importlib.util.spec_from_file_location(name, SCENES / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("script", AUTHORS)
def test_files_are_what_their_script_writes(script: str) -> None:
    module = authored_by(script)
    for name, text in module.texts().items():
        assert (module.HERE / name).read_text(encoding="utf-8") == text, name


def test_every_scene_has_its_script() -> None:
    for launch in LAUNCHES:
        assert (SCENES / f"author_{launch.parent.name}.py").is_file(), launch


def test_triangles_rest_on_the_board_around_their_posts() -> None:
    author = authored_by("author_peg_transfer")
    simulation = run(SCENES / "peg_transfer" / "launch.yaml", 1000)
    place = np.array(author.theatre.PLACE)
    for number, (x, y) in enumerate(author.posts()[:6], 1):
        block = simulation.bodies[f"Block{number}"]
        at = block.pose[:3] - place
        assert np.hypot(at[0] - x, at[1] - y) < 1e-3, number
        assert at[2] == pytest.approx(author.BOARD[2] + author.HEIGHT / 2, abs=2e-4), number
        assert np.abs(block.twist).max() < 1e-3, number


def reaching(scene: Scene, arms: ArmSet, places: list[np.ndarray]) -> list[set[str]]:
    """The arms that bring their tool, pointing down, to each of ``places`` (3,)."""
    down = np.diag([1.0, -1.0, -1.0])
    found = []
    for place in places:
        reached = set()
        for arm in (a for a in scene.arms if a.name in ("PSM1", "PSM2")):
            T_base = inverse(scene.bodies[arm.base].T_world_body)
            turns = [frame(down @ axis_rotation((0, 0, 1), t), place) for t in np.linspace(-1.5, 1.5, 7)]
            if arms[arm.name].kinematics.inverse(np.array([T_base @ T for T in turns])).ok.any():
                reached.add(arm.name)
        found.append(reached)
    return found


def test_every_post_is_within_reach_of_an_arm() -> None:
    author = authored_by("author_peg_transfer")
    scene = ligature.load(SCENES / "peg_transfer" / "launch.yaml")
    places = [np.array(author.theatre.PLACE) + [x, y, author.BOARD[2] + 0.03] for x, y in author.posts()]
    assert all(reaching(scene, Simulation(scene).arms, places))


def test_both_arms_reach_both_sides_of_the_wound_and_the_needle() -> None:
    author = authored_by("author_soft_suturing")
    scene = ligature.load(SCENES / "soft_suturing" / "launch.yaml")
    top = author.BOARD_HIGH[2] + author.PAD[2]
    beside = [(author.ASIDE + x, y, top + 0.012) for x in (-0.008, 0.008) for y in (-0.02, 0.0, 0.02)]
    places = [np.array(author.theatre.PLACE) + place for place in [*beside, (*author.NEEDLE, 0.02)]]
    assert reaching(scene, Simulation(scene).arms, places) == [{"PSM1", "PSM2"}] * 7


def test_a_needle_passes_both_lips_of_the_wound_and_stays_on_its_way() -> None:
    simulation = Simulation(ligature.load(SCENES / "soft_suturing" / "launch.yaml"))
    top = pass_through_the_wound(simulation)
    state = simulation.state[0]
    count = int(state["puncture_count"][0])
    across = np.sort(state["puncture_point"][0, :count, 0] - simulation.bodies["Pad"].pose[0])
    assert count == 3 and across[0] == pytest.approx(-0.0085, abs=5e-4), across
    assert np.abs(across[1:] - [-0.002, 0.002]).max() < 5e-4, "the walls of the wound are where its width has them"
    form = simulation.scene.tissues[0].form
    moved = state["tissue_node"][simulation.scene.tissues[0].rows] - new_state(simulation.scene)["tissue_node"][0]
    assert np.isfinite(moved).all() and 1e-5 < np.abs(moved).max() < 2e-3
    assert np.abs(moved[form.fixed]).max() < 1e-12
    assert top == pytest.approx(state["tissue_node"][:, 2].max(), abs=1e-3)


def test_looks_are_what_their_script_writes() -> None:
    module = authored_by("author_looks")
    for name, text in module.files().items():
        assert (module.HERE / name).read_text(encoding="utf-8") == text, name
    for name, pixels in module.pictures().items():
        with Image.open(module.HERE / name) as image:
            assert np.abs(np.asarray(image, dtype=float) - pixels).mean() < 3.0, name  # of 255, by compression
