"""Launch files hand on what they are given: every option of a command is an argument, and arrives as it was meant."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

import pytest
import typer
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.cli.main import app
from ligature.teleop.ready import names

pytestmark = pytest.mark.ros
ROOT = Path(__file__).resolve().parents[2]
FILES = {
    "simulator": ("run", "launch"), "teleoperation": ("teleop", "config"), "record": ("record", "out"),
    "replay": ("replay", "file"),
}  # fmt: skip
"""Launch files, each with its command and the command's argument."""
RENAMED = {"launch": "scene"}
COMMANDS = typer.main.get_command(app).commands  # type: ignore[attr-defined]
word = st.from_regex(re.compile(r"[A-Za-z/][A-Za-z0-9_/.=]{0,12}", re.ASCII), fullmatch=True).filter(
    lambda text: text.lower() not in ("true", "false") and "//" not in text
)


def values(option: Any) -> st.SearchStrategy[Any]:
    """What an option may be given."""
    if getattr(option, "is_flag", False):
        return st.booleans()
    if option.name in ("models", "devices"):
        return st.lists(st.integers(0, 20), min_size=1, max_size=4).map(lambda found: ",".join(map(str, found)))
    fixed = {
        "names": ["ambf", "src"],
        "task": ["insertion", "suture"],
        "cockpit_at": ["127.0.0.1:8081", "0.0.0.0:9000"],
    }
    if option.name in fixed:
        return st.sampled_from(fixed[option.name])
    kind = option.type.name
    if kind.startswith("float"):
        return st.floats(1.0, 900.0).map(lambda x: round(x, 3))
    if kind.startswith("integer"):
        return st.integers(1, 900)
    found = st.sampled_from(["/etc", "/home", "/usr", "/var"]) if getattr(option.type, "exists", False) else word
    return st.lists(found, min_size=1, max_size=3, unique=True) if option.multiple else found


def given_to(file: str, arguments: dict[str, Any]) -> dict[str, Any]:
    """What the command of a launch file is called with, as the command itself reads it."""
    from roslaunch.config import ROSLaunchConfig
    from roslaunch.xmlloader import XmlLoader

    def text(name: str, value: Any) -> str:
        if isinstance(value, list):
            return (":" if name == "root" else " ").join(value)
        return str(value).lower() if isinstance(value, bool) else str(value)

    config = ROSLaunchConfig()
    argv = [f"{name}:={text(name, value)}" for name, value in arguments.items()]
    XmlLoader().load(str(ROOT / "launch" / f"{file}.launch"), config, argv=argv, verbose=False)
    (node,) = config.nodes
    words = shlex.split(node.args)
    if node.type == "ligature_command":
        command, *words = words
    else:
        assert node.type == "ligature_run"
        command = "run"
    found = COMMANDS[command].make_context(command, words, resilient_parsing=True).params
    return {name: str(value) if isinstance(value, Path) else value for name, value in found.items()}


@pytest.fixture(autouse=True)
def packages(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"{ROOT}:{ROOT / 'ros_msgs'}")


@pytest.mark.parametrize("file", sorted(FILES))
def test_every_option_of_the_command_is_an_argument(file: str) -> None:
    text = (ROOT / "launch" / f"{file}.launch").read_text()
    declared = set(re.findall(r'<arg name="(\w+)"[^>]* doc="[^"]+"', text)) - {"options", "terminal"}
    command, _ = FILES[file]
    options = {RENAMED.get(p.name, p.name) for p in COMMANDS[command].params if not getattr(p, "hidden", False)}
    assert declared == options


@pytest.mark.parametrize("file", sorted(FILES))
def test_what_is_given_arrives(file: str) -> None:
    command, argument = FILES[file]
    options = {p.name: p for p in COMMANDS[command].params if p.name != argument}
    plain = given_to(file, {RENAMED.get(argument, argument): "some where"})
    assert plain[argument] == "some where"

    @settings(max_examples=60, deadline=None)
    @given(st.fixed_dictionaries({}, optional={name: values(option) for name, option in options.items()}))
    def arrives(chosen: dict[str, Any]) -> None:
        found = given_to(file, {RENAMED.get(argument, argument): "x", **chosen})
        for name in options:
            value = found[name]
            value = [str(v) for v in value] if isinstance(value, (list, tuple)) and options[name].multiple else value
            assert value == chosen.get(name, plain[name]) or (not value and not plain[name] and name not in chosen)

    arrives()


@pytest.mark.parametrize("device", names())
def test_every_ready_device_has_a_launch_file_with_its_driver(device: str) -> None:
    from roslaunch.config import ROSLaunchConfig
    from roslaunch.xmlloader import XmlLoader

    def nodes(*argv: str) -> dict[str, Any]:
        config = ROSLaunchConfig()
        path = ROOT / "launch" / f"teleop_{device}.launch"
        XmlLoader().load(str(path), config, argv=list(argv), verbose=False)
        return {node.type: node for node in config.nodes}

    found = nodes()
    assert shlex.split(found["ligature_command"].args) == ["teleop", "--device", device]
    if device in ("keyboard", "mouse"):
        assert found["ligature_command"].launch_prefix == "xterm -e" and len(found) == 1
    elif device == "mtm":
        assert len(found) == 1
    else:
        assert len(found) == 2 and len(nodes("driver:=false")) == 1
        other = nodes("topic:=/other/")["ligature_command"].args
        assert shlex.split(other) == ["teleop", "--device", f"{device}=/other/"]


@pytest.mark.parametrize("file", ["suturing_small", "suturing_task", "cockpit"])
def test_the_files_of_one_scene_take_the_same_arguments(file: str) -> None:
    found = given_to(file, {"rate": 200, "cameras": False, **({"scene": "theatre"} if file == "cockpit" else {})})
    assert (found["rate"], found["cameras"]) == (200.0, False)
    scene = {"cockpit": "theatre", "suturing_small": "suturing_small", "suturing_task": "suturing"}[file]
    assert scene in str(found["launch"])
    assert (found["task"], found["names"]) == (("pose_estimation", "src") if file == "suturing_task" else ("", "ambf"))
    assert found["cockpit_at"] == ("127.0.0.1:8080" if file == "cockpit" else None)
