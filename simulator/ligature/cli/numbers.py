"""Numbers that commands take and print: finite ones, and nouns that agree with them.

Click lets "nan" through every range, for it compares as neither too small nor too large, and infinity where a range has
one end. What counts by such a number never ends, or fails in the words of Python.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import typer
from typer.core import TyperCommand

LARGEST = 1e12
"""Largest magnitude of a number that an option takes; what is beyond it overflows when it is counted in ticks."""


def counted(number: int, one: str, more: str = "") -> str:
    """``number`` and a noun, as in ``1 error`` and ``2 errors``; ``more`` is the plural where an s does not make it."""
    return f"{number} {one if number == 1 else more or one + 's'}"


class FiniteCommand(TyperCommand):
    """A command whose numbers are finite, at most `LARGEST`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the words of a command line; raises `typer.BadParameter` for a number that is not finite."""
        rest = super().parse_args(ctx, args)
        for parameter in self.params:
            value = ctx.params.get(parameter.name or "")
            if isinstance(value, float) and not math.fabs(value) <= LARGEST:
                raise typer.BadParameter(f"{value:g} is not a finite number up to {LARGEST:g}.", ctx, parameter)
        return rest


class Commands(typer.Typer):
    """A group of commands, each a `FiniteCommand`."""

    def command(self, *args: Any, **options: Any) -> Callable[[Any], Any]:
        """Register a function as a command, as `typer.Typer.command` does."""
        return super().command(*args, **{"cls": FiniteCommand, **options})
