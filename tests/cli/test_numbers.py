"""Numbers on the command line: each that is not finite is refused by every command, and nouns agree with them."""

from __future__ import annotations

import re
from collections.abc import Iterator

import click
import pytest
from ligature.cli import ambf_simulator
from ligature.cli.main import app
from ligature.cli.numbers import counted
from typer.main import get_command

STRANGE = ("nan", "-nan", "inf", "-inf", "1e400", "1e300", "infinity")


def _commands(group: click.Command, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], click.Command]]:
    if isinstance(group, click.Group):
        for name, command in group.commands.items():
            yield from _commands(command, (*path, name))
    else:
        yield path, group


def _of_numbers() -> Iterator[tuple[click.Command, click.Parameter]]:
    for _, command in _commands(get_command(app)):
        for parameter in command.params:
            if isinstance(parameter.type, click.types.FloatParamType | click.FloatRange):
                yield command, parameter


def _words(command: click.Command, but: click.Parameter) -> list[str]:
    """What a command needs besides one option."""
    words: list[str] = []
    for parameter in command.params:
        if parameter.required and parameter is not but:
            given = "pose_estimation" if parameter.name == "task" else "x"
            words += [parameter.opts[0], given] if isinstance(parameter, click.Option) else [given]
    return words


@pytest.mark.parametrize("number", STRANGE)
def test_no_command_takes_a_number_that_is_not_finite(number: str) -> None:
    found = list(_of_numbers())
    assert len(found) > 15
    for command, parameter in found:
        words = [*_words(command, parameter), f"{parameter.opts[-1]}={number}"]
        if not parameter.opts[-1].startswith("--"):
            words[-1:] = [parameter.opts[-1], number]
        with pytest.raises(click.BadParameter) as refused:
            command.make_context(command.name or "", words)
        assert parameter.name == getattr(refused.value.param, "name", None), (words, refused.value)
        assert re.search("is not a finite number|is not in the range", refused.value.message), refused.value.message


@pytest.mark.parametrize("number", STRANGE)
@pytest.mark.parametrize("flag", [a.option_strings[0] for a in ambf_simulator.parser()._actions if a.type is float])
def test_the_flags_of_ambf_take_no_number_that_is_not_finite(flag: str, number: str) -> None:
    with pytest.raises(SystemExit) as ended:
        options = ambf_simulator.options_of(["--launch_file", "x", flag, number])
        raise SystemExit(2 if max(options.rate, options.speed, options.haptic_rate) <= 1e12 else 0)
    assert ended.value.code == 2


@pytest.mark.parametrize(("number", "text"), [(0, "0 errors"), (1, "1 error"), (2, "2 errors")])
def test_nouns_agree_with_their_number(number: int, text: str) -> None:
    assert counted(number, "error") == text
    assert counted(number, "body", "bodies").endswith("body" if number == 1 else "bodies")
