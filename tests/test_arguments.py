"""Arguments as programs and notebooks have them: any container of the right numbers works, others are reported."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from typing import Any

import ligature
import numpy as np
import pytest
from ligature.model.commands import BodyCommand, CommandType
from ligature.model.frames import pose7_matrix
from ligature.render.context import RenderUnavailable, create_context

from tests.opengl import opengl

MODEL = """
bodies: [Needle, Table]
cameras: [eye]
Needle: {name: Needle, mass: 0.1, collision shape: SPHERE, collision geometry: {radius: 0.01}}
Table: {name: Table, mass: 0}
eye: {name: eye, location: {x: 1, y: 0, z: 0}}
"""
POSE = [0.25, -0.5, 1.0, 0.5, 0.5, 0.5, 0.5]
SAME: dict[str, Callable[[list[float]], Any]] = {
    "list": list, "tuple": tuple, "array": np.array, "row": lambda v: np.array([v]), "column": lambda v: np.array([v]).T,
    "float32": lambda v: np.array(v, np.float32), "objects": lambda v: np.array(v, object), "masked": np.ma.array,
    "texts": lambda v: [str(n) for n in v], "decimals": lambda v: [Decimal(n) for n in v],
    "matrix": lambda v: pose7_matrix(v), "nested": lambda v: pose7_matrix(v).tolist(),
    "scalars": lambda v: [np.float64(n) for n in v], "read-only": lambda v: np.broadcast_to(np.array(v), (7,)),
}  # fmt: skip
WRONG: dict[str, Any] = {
    "text": "home", "nothing": None, "short": POSE[:3], "long": [*POSE, 0.0], "empty": [], "names": {"x": 1.0},
    "no numbers": [None] * 7, "nan": [float("nan")] * 7, "infinite": [float("inf"), *POSE[1:]], "no rotation": [0.0] * 7,
    "complex": np.array(POSE, complex), "generator": (n for n in POSE), "unequal": [[1.0], [1.0, 2.0]],
    "scaled matrix": 2.0 * np.eye(4), "mirrored matrix": np.diag([1.0, 1.0, -1.0, 1.0]), "a function": print,
    "huge": [10**400] * 7,
}  # fmt: skip
WHOLE = (3, 3.0, np.int64(3), np.uint8(3), np.float32(3.0), np.array(3), np.array([3]), Decimal(3))
BROKEN = (1.5, "3", None, [1, 2], float("nan"), float("inf"), 1j, object())
INDICES = ([0], (0,), np.array([0]), range(1), {0}, [np.int32(0)])
NO_INDICES = ("0", 0, [0.0], ["0"], [None], b"0", 0.5)


@pytest.fixture
def scene(tmp_path: Path) -> ligature.Scene:
    file = tmp_path / "model.yaml"
    file.write_text(MODEL)
    return ligature.load(file)


@pytest.mark.parametrize("verb", ["set_pose", "command_pose", "place"])
def test_a_pose_is_the_same_in_any_container(scene: ligature.Scene, verb: str) -> None:
    hashes = set()
    for container in SAME.values():
        with ligature.Simulation(scene) as sim:
            handle: Any = sim.cameras["eye"] if verb == "place" else sim.bodies["Needle"]
            getattr(handle, verb)(container(POSE))
            sim.step(3)
            hashes.add(sim.state_hash())
    assert len(hashes) == 1


@pytest.mark.parametrize("verb", ["set_pose", "command_pose", "place"])
@pytest.mark.parametrize("wrong", WRONG)
def test_what_is_no_pose_is_reported_and_changes_nothing(scene: ligature.Scene, verb: str, wrong: str) -> None:
    with ligature.Simulation(scene) as sim, ligature.Simulation(scene) as other:
        handle: Any = sim.cameras["eye"] if verb == "place" else sim.bodies["Needle"]
        with pytest.raises((TypeError, ValueError), match=r"takes|must|not"):
            getattr(handle, verb)(WRONG[wrong])
        for simulation in (sim, other):
            simulation.step(3)
        assert sim.state_hash() == other.state_hash()


def test_ticks_are_whole_numbers_of_any_type(scene: ligature.Scene) -> None:
    with ligature.Simulation(scene) as sim:
        for number, ticks in enumerate(WHOLE, 1):
            sim.step(ticks)  # type: ignore[arg-type]
            assert sim.state["tick"][0] == 3 * number
        for broken in BROKEN:
            with pytest.raises(TypeError, match="it must be a whole number"):
                sim.step(broken)  # type: ignore[arg-type]


def test_indices_of_models_are_whole_numbers_in_any_container() -> None:
    for good in INDICES:
        assert [body.identity.name for body in ligature.load("peg_transfer", models=good).bodies]  # type: ignore[arg-type]
    for bad in NO_INDICES:
        with pytest.raises(TypeError, match="it must be a list of whole numbers"):
            ligature.load("peg_transfer", models=bad)  # type: ignore[arg-type]


@pytest.mark.parametrize("what", ["files", "roots", "soft", "arms"])
@pytest.mark.parametrize("one", ["/tmp", Path("/tmp"), b"/tmp"])
def test_one_text_is_no_list(what: str, one: Any) -> None:
    """Of ``roots="/tmp"`` the first letter is the whole disk."""
    with pytest.raises(TypeError, match=f"{what} is .*; it must be a list, such as "):
        ligature.load("peg_transfer", **{what: one})
    if what == "roots":
        with pytest.raises(TypeError, match="it must be a list"):
            ligature.adf.Resolver(one)


def test_what_is_no_path_no_arm_and_no_name_is_reported(scene: ligature.Scene) -> None:
    for path in (5, None, b"suturing", ["suturing"]):
        with pytest.raises(TypeError, match="it must be the path of a file, or the name of a scene"):
            ligature.load(path)  # type: ignore[arg-type]
    with pytest.raises(ligature.SceneError, match="holds a NUL character"):
        ligature.load("suturing\0small")
    for what in ("files", "roots", "soft", "arms"):
        with pytest.raises(TypeError, match=f"{what} is 5; it must be a list"):
            ligature.load("peg_transfer", **{what: 5})  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="arms is .* it must be a list of mappings"):
        ligature.load("peg_transfer", arms=["MTML=mtm"])  # type: ignore[list-item]
    with ligature.Simulation(scene) as sim:
        for name in (0, None, b"Needle", 1.5, ()):
            for handles in (sim.bodies, sim.joints, sim.cameras):
                assert name not in handles
        for size in ("big", (10.5, 10), (1,), 5, (None, 1)):
            with pytest.raises(TypeError, match="a size of pictures must be a width and a height"):
                sim.cameras["eye"].view(size)  # type: ignore[arg-type]


@pytest.mark.parametrize("dt", [1, True, np.float32(1e-3), Fraction(1, 1000), np.int8(1)])
def test_a_tick_of_any_type_is_a_number_of_double_precision(scene: ligature.Scene, dt: Any) -> None:
    """For any other type, all code would be compiled again."""
    with ligature.Simulation(scene, dt, update=2 * dt) as sim:
        assert type(sim.dt) is float and sim.dt == float(dt)
        assert sim.ticks_per_update == 2
        for name in ("dt", "scene", "ticks_per_update"):
            with pytest.raises(AttributeError):
                setattr(sim, name, getattr(sim, name))


@pytest.mark.parametrize("body", ["Needle", 2, -1, 3.5, None, np.float64(0.0), 10**30, [0]])
def test_what_is_no_body_is_reported(scene: ligature.Scene, body: Any) -> None:
    with ligature.Simulation(scene) as sim:
        before = sim.state_hash()
        for act in (sim.touched, lambda index: sim.set_pose(index, np.array(POSE))):
            with pytest.raises((TypeError, ValueError), match="it must be an index|no body number"):
                act(body)
        assert sim.state_hash() == before


@pytest.mark.parametrize("command", ["home", None, 3, [0.0] * 6, object(), CommandType.FORCE])
def test_what_is_no_command_is_reported(scene: ligature.Scene, command: Any) -> None:
    with ligature.Simulation(scene) as sim, pytest.raises(TypeError, match=r"takes the commands of ligature\.model"):
        sim.apply(command)


@pytest.mark.parametrize("number", list(CommandType))
def test_a_type_of_command_may_be_its_number(scene: ligature.Scene, number: CommandType) -> None:
    """A number was taken for a position."""
    target = (0.0,) * 6 if number is not CommandType.POSITION else tuple(POSE)
    wanted = BodyCommand(0, number, target, (number,), (0.5,))
    for kind in (int(number), np.int64(number), float(number)):
        command = BodyCommand(0, kind, target, (kind,), (0.5,))  # type: ignore[arg-type]
        command.check()
        assert command == wanted and command.type is number and command.joint_types[0] is number


@pytest.mark.parametrize("kind", ["POSITION", None, 7, -1, 1.5, [1]])
def test_what_is_no_type_of_command_is_reported(scene: ligature.Scene, kind: Any) -> None:
    with ligature.Simulation(scene) as sim:
        for act in (
            lambda: sim.bodies["Needle"].command_joints([0.1], kind),
            lambda: sim.apply(BodyCommand(0, kind, (0.0,) * 6)),
        ):
            with pytest.raises(ValueError, match=r"is not one of FORCE \(0\), POSITION \(1\), VELOCITY \(2\)"):
                act()


def test_an_element_of_a_thread_takes_no_command() -> None:
    with ligature.Simulation(ligature.load("suturing_small")) as sim:
        element = sim.bodies["Thread_005"]
        for act in (
            lambda: element.command_wrench([0.0] * 6),
            lambda: element.command_pose(POSE),
            lambda: element.command_twist([0.0] * 6),
            lambda: element.command_joints([0.0]),
        ):
            with pytest.raises(ValueError, match="is an element of a thread and takes no commands"):
                act()


def test_what_is_no_scene_is_reported() -> None:
    for thing in ("suturing", None, Path("launch.yaml"), 3):
        with pytest.raises(TypeError, match="ligature.load"):
            ligature.Simulation(thing)  # type: ignore[arg-type]


@pytest.mark.parametrize("key", [2, 4])
def test_a_misspelled_name_gets_the_one_that_is_meant(tmp_path: Path, key: int) -> None:
    """One letter of a name is lost; a file and a scene as well as a body."""
    body = "Needle"[:key] + "Needle"[key + 1 :]
    name = "suturing"[:key] + "suturing"[key + 1 :]
    (tmp_path / "launch.yaml").write_text(MODEL)
    with ligature.Simulation(ligature.load(tmp_path / "launch.yaml")) as sim, pytest.raises(KeyError) as unknown:
        sim.bodies[body]
    assert str(unknown.value).endswith("choose one of /Needle")
    with pytest.raises(ligature.SceneError, match="did you mean 'suturing'"):
        ligature.load(name)
    with pytest.raises(ligature.SceneError, match="did you mean '.*launch.yaml'"):
        ligature.load(tmp_path / ("launch"[:key] + "launch"[key + 1 :] + ".yaml"))


def _draw(found: Any) -> None:
    try:
        create_context()
    except RenderUnavailable as error:
        found.put(str(error))


def test_a_child_that_was_forked_after_a_picture_reports_that_it_cannot_draw() -> None:
    with opengl():
        create_context().release()
    fork = multiprocessing.get_context("fork")
    found = fork.Queue()
    child = fork.Process(target=_draw, args=(found,))
    child.start()
    try:
        assert "'spawn'" in found.get(timeout=30)
    finally:
        child.kill()
        child.join()
