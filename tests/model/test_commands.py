"""Numbers that no scene can use are refused with the bound that holds."""

from __future__ import annotations

import pytest
from ligature.model.commands import (
    MAX_FORCE,
    MAX_POSITION,
    MAX_VELOCITY,
    ActuatorCommand,
    BodyCommand,
    Command,
    CommandType,
    PlaceCommand,
    Release,
)

HERE = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
FAR = (0.0, -2e4, 0.0, 0.0, 0.0, 0.0, 1.0)
REST = (0.0,) * 6


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (BodyCommand(0, CommandType.POSITION, FAR), "a POSITION command must stay within 10000 m, not -20000"),
        (BodyCommand(0, CommandType.VELOCITY, (2e4, 0, 0, 0, 0, 0)), "within 10000 m/s or rad/s, not 20000"),
        (BodyCommand(0, CommandType.FORCE, (0, 0, 0, 0, -2e6, 0)), "within 1e\\+06 N or N m, not -2e\\+06"),
        (BodyCommand(0, CommandType.FORCE, REST, (), (0.0, 2e6)), "joint commands must stay within 1e\\+06"),
        (ActuatorCommand(0, True, "Needle", FAR), "the offset must stay within 10000 m"),
        (PlaceCommand("camera", 0, FAR), "the pose must stay within 10000 m"),
    ],
)
def test_too_large_numbers_are_refused(command: Command, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        command.check()


@pytest.mark.parametrize(
    "command",
    [
        BodyCommand(0, CommandType.POSITION, (MAX_POSITION, -MAX_POSITION, *HERE[2:])),
        BodyCommand(0, CommandType.VELOCITY, (MAX_VELOCITY,) * 6),
        BodyCommand(0, CommandType.FORCE, (MAX_FORCE,) * 6, (CommandType.FORCE,), (-MAX_FORCE,)),
        ActuatorCommand(0, True, "Needle", None),
        ActuatorCommand(0, True, "Needle", HERE),
        PlaceCommand("light", 0, None),
        Release("body", 0),
    ],
)
def test_numbers_up_to_the_bound_pass(command: Command) -> None:
    command.check()


def test_no_command_is_for_an_object_that_the_scene_lacks() -> None:
    commands = (
        BodyCommand(2, CommandType.FORCE, REST), ActuatorCommand(2, False, "", None), PlaceCommand("camera", 2, None),
        Release("body", 2),
    )  # fmt: skip
    for command in commands:
        assert command.object is not None
        kind, _ = command.object
        command.check({kind: 3})
        for counts in ({kind: 2}, {kind: 1}, {kind: 0}, {}, {"other": 9}):
            with pytest.raises(ValueError, match=f"^the scene has no {kind} number 2$"):
                command.check(counts)
