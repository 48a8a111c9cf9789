"""Pages of the reference that are generated from the code: commands, topics, Python modules, as Markdown."""

from __future__ import annotations

import argparse
import ast
import importlib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np
import typer
from ligature.cli import ambf_simulator
from ligature.cli.main import app
from ligature.model.scene import ArmKind
from ligature.model.state import ARM_DTYPE, FIELDS
from ligature.ros.arms.commands import COMMANDS
from ligature.ros.arms.events import LATCHED, LATCHED_OF_KIND
from ligature.ros.arms.outlet import EVERY, SELDOM
from ligature.ros.arms.readings import readings
from ligature.ros.arms.services import SERVICES
from ligature.ros.cameras import PICTURES
from ligature.ros.reception import COMMANDS as OBJECTS
from ligature.ros.reception import RESETS
from ligature.ros.tissue import TOPICS as TISSUE

PACKAGE = Path(__file__).resolve().parents[2] / "simulator" / "ligature"


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *rows)]
    return "\n".join(lines) + "\n"


def _cell(text: str | None) -> str:
    return (text or "").replace("|", "\\|").replace("\n", " ")


# --- commands ---------------------------------------------------------------------------------


def commands() -> str:
    """Every command with its arguments and options, as the command line itself knows them."""
    group = typer.main.get_command(app)
    assert isinstance(group, click.Group)
    text = [
        "# Commands\n\nGenerated from the command line. [Command line](command_line.md) has the table of all commands and what "
        "they have in common.\n"
    ]
    text += [_command(name, command) for name, command in _leaves(group)]
    parser = ambf_simulator.parser()
    rows = [
        (" ".join(f"`{flag}`" for flag in action.option_strings), _cell(action.help))
        for action in parser._actions
        if not isinstance(action, argparse._HelpAction)
    ]
    text.append(f"## ambf_simulator\n\n{parser.description}\n\n{_table(('flag', 'meaning'), rows)}")
    return "\n".join(text)


def _leaves(group: click.Group, before: str = "") -> Iterator[tuple[str, click.Command]]:
    """The commands of a group and of the groups in it, by all their words."""
    for name, command in group.commands.items():
        if isinstance(command, click.Group):
            yield from _leaves(command, f"{before}{name} ")
        else:
            yield f"{before}{name}", command


def _command(name: str, command: click.Command) -> str:
    context = click.Context(command, info_name=f"ligature {name}")
    usage = " ".join(command.collect_usage_pieces(context))
    rows = [_parameter(parameter) for parameter in command.params if not getattr(parameter, "hidden", False)]
    table = _table(("argument or option", "default", "meaning"), rows)
    return f"## ligature {name}\n\n{command.help}\n\n```text\nligature {name} {usage}\n```\n\n{table}"


def _parameter(parameter: click.Parameter) -> tuple[str, str, str]:
    written = [parameter.human_readable_name] if isinstance(parameter, click.Argument) else list(parameter.opts)
    written += parameter.secondary_opts
    default = parameter.default
    shown = "" if default in (None, "", ()) or callable(default) or default is False else f"`{default}`"
    return ", ".join(f"`{word}`" for word in written), shown, _cell(getattr(parameter, "help", ""))


# --- topics -----------------------------------------------------------------------------------


def _type(message: Any) -> str:
    return f"`{message._type}`"


def topics() -> str:
    """Every topic and service, from the tables that the ROS process advertises from."""
    objects = [(kind, _type(command).replace("Cmd", "State"), _type(command)) for kind, command in OBJECTS.items()] + [
        ("sensor", "`ambf_msgs/SensorState`", "`ambf_msgs/SensorCmd`")
    ]
    objects.append(("contact sensor", "`ambf_msgs/ContactSensorState`", "`ambf_msgs/ContactSensorCmd`"))
    kinds = [kind for kind in ArmKind if readings(kind, (), "")]
    found = {kind: {reading.topic: reading for reading in readings(kind, (), "")} for kind in kinds}
    everywhere = {topic: reading for kind in kinds for topic, reading in found[kind].items()}
    published = [
        (f"`{topic}`", _type(type(reading.message)), _kinds(k for k in kinds if topic in found[k]), f"{200 // EVERY.get(topic, SELDOM)} Hz")
        for topic, reading in everywhere.items()
    ]  # fmt: skip
    published += [(f"`{name}`", _type(type_), "all", "on change, latched") for name, type_ in LATCHED.items()]
    published += [
        (f"`{name}`", _type(type_), kind.value, "on change, latched")
        for kind, events in LATCHED_OF_KIND.items() for name, type_ in events.items()
    ]  # fmt: skip
    listened = [
        (", ".join(f"`{topic}`" for topic in (command.verb, *aliases)), _type(type_), command.kind.value if command.kind else "all", _first(command.__doc__))
        for command, type_, _, *aliases in COMMANDS
    ]  # fmt: skip
    return "\n".join(
        [
            "# Topics and services\n\nGenerated from the tables of the code. What the topics mean: "
            "[ROS interface](ros_interface.md), [arms](arms.md), [cameras](cameras.md), [tasks](tasks.md).\n",
            "## Objects\n\nEvery object has `<object>/State` and `<object>/Command`.\n",
            _table(("object", "State", "Command"), objects),
            "## World\n",
            _table(
                ("topic", "type"),
                [("`World/State`", "`ambf_msgs/WorldState`"), ("`World/Command`", "`ambf_msgs/WorldCmd`")]
                + [(f"`World/Command/{name}`", "`std_msgs/Empty`") for name in RESETS],
            ),
            "## Cameras\n\nBelow `<camera>`, and below `<camera>/left` and `<camera>/right` of stereo cameras.\n",
            _table(("topic", "type"), [(f"`{topic}`", _type(type_)) for topic, type_ in PICTURES.items()]),
            "## Bodies of tissue\n\nBelow the topic of the body.\n",
            _table(
                ("topic", "type", "rate", "meaning"),
                [
                    (f"`{topic}`", _type(type_), "as State" if rate is None else f"{rate:.0f} Hz", _meaning(template))
                    for topic, (template, type_, rate) in TISSUE.items()
                ],
            ),
            "## Arms: published\n\nBelow the arm's name, such as `/PSM1`.\n",
            _table(("topic", "type", "arms", "rate"), published),
            "## Arms: commands\n",
            _table(("topic", "type", "arms", "meaning"), listened),
            "## Arms: services\n",
            _table(("service", "type"), [(f"`{name}`", _type(type_)) for name, type_ in SERVICES.items()]),
        ]
    )


def _meaning(template: type) -> str:
    """The first line of a docstring, after the type."""
    return _first(template.__doc__).partition(": ")[2]


def _kinds(kinds: Iterable[ArmKind]) -> str:
    names = [kind.value for kind in kinds]
    return "all" if len(names) == len(ArmKind) else ", ".join(names)


def _first(text: str | None) -> str:
    return _cell((text or "").strip().split("\n\n")[0])


# --- state ------------------------------------------------------------------------------------


def state() -> str:
    """Every field of the state record, from the table that gives its memory layout."""
    rows = [
        (f"`{field.name}`", f"`{np.dtype(field.type).name}`" if isinstance(field.type, str) else "record",
         ", ".join(map(str, field.shape)), _cell(field.meaning.replace("``", "`")))
        for field in FIELDS
    ]  # fmt: skip
    arm = [(f"`{name}`", ", ".join(map(str, ARM_DTYPE[name].shape))) for name in ARM_DTYPE.names or ()]
    return (
        "# State record\n\nGenerated from the table of the code. In Python `sim.state[name][0]` is the array of a field. Poses are x y z "
        "qx qy qz qw, twists and wrenches linear then angular, in world axes; the linear velocity is that of the centre of mass. SI "
        f"units. Rows are in the order of the scene's objects.\n\n{_table(('field', 'type', 'shape', 'meaning'), rows)}\n"
        "## Fields of an arm\n\nNames are those of CRTK. Rows of `*_js` are position, velocity, effort; local poses are in the base frame of the "
        f"arm.\n\n{_table(('field', 'shape'), arm)}"
    )


# --- Python -----------------------------------------------------------------------------------

PUBLIC = (
    "adf",
    "mesh",
    "authoring",
    "model",
    "robots",
    "plugins",
    "simulation",
    "tasks",
    "datasets",
    "environments",
    "render",
    "tissue",
    "client",
)
"""What programs import, in the order of their pages."""

PARTS = (
    "physics",
    "suture",
    "soft",
    "grasping",
    "arms",
    "sensing",
    "coasting",
    "bus",
    "ros",
    "teleop",
    "cockpit",
)
"""The parts of a simulation and of a run, for those who read or change them; `cli` has the page of its commands."""


def modules(package: str) -> list[str]:
    """The modules of a package that have public objects, by their names."""
    folder = PACKAGE / package
    if not folder.is_dir():
        return [f"ligature.{package}"]
    paths = sorted(path for path in folder.rglob("*.py") if path.name != "__init__.py" and "names" not in path.parts)
    names = [
        ".".join(("ligature", *path.relative_to(PACKAGE).with_suffix("").parts)) for path in paths if _public(path)
    ]
    return [f"ligature.{package}", *names]


def _public(path: Path) -> bool:
    found = ast.parse(path.read_text("utf-8")).body
    return any(isinstance(node, (ast.FunctionDef, ast.ClassDef)) and not node.name.startswith("_") for node in found)


def api(package: str) -> str:
    """The page of one package: what it exports under the package's name, the rest under the names of its modules.

    Of `PARTS` the modules are only listed.
    """
    text = [f"# ligature.{package}\n", f"```{{eval-rst}}\n.. automodule:: ligature.{package}\n```\n"]
    if package in PARTS:
        rows = [(f"`{name}`", _cell(_summary(name))) for name in modules(package)[1:]]
        return "\n".join([*text, "## Modules\n", _table(("module", "content"), rows)])
    left_out = ", ".join(sorted(_exported("ligature") | _exported(f"ligature.{package}")))
    for name in modules(package)[1:]:
        text.append(f"## {name}\n\n```{{eval-rst}}\n.. automodule:: {name}\n   :exclude-members: {left_out}\n```\n")
    return "\n".join(text)


def _summary(name: str) -> str:
    """The first sentences of a module, of which nothing is imported."""
    path = PACKAGE.parent.joinpath(*name.split(".")).with_suffix(".py")
    text = _first(ast.get_docstring(ast.parse(path.read_text("utf-8"))))
    return text.removesuffix("::").replace("``", "`")


def top() -> str:
    """The page of the package itself, name by name: it imports what it exports at the first use."""
    module = importlib.import_module("ligature")
    kinds = {name: "class" if isinstance(getattr(module, name), type) else "function" for name in module.__all__}
    directives = "\n".join(f".. auto{kinds[name]}:: ligature.{name}" for name in ("load", *sorted({*kinds} - {"load"})))
    return f"# ligature\n\n```{{eval-rst}}\n.. automodule:: ligature\n   :no-members:\n\n{directives}\n```\n"


def _exported(name: str) -> set[str]:
    return set(getattr(importlib.import_module(name), "__all__", ()))
