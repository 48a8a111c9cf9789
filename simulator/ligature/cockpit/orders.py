"""What the page's own script may order, parsed and bounded where it enters: a word and a value of its kind.

An order is JSON, ``{"do": word, "value": value}``. Numbers are shares: of the chosen speed, of a picture's
height.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any, NamedTuple

MOST_CHARACTERS = 500
"""Of an order; those of people have at most a hundred."""

MODES = {"fine": 0.1, "normal": 0.4, "fast": 1.0}
"""Speeds of the hand, as shares of the maximum velocity of goals."""

HELP = ("align", "pick", "bring")
"""What the page can do with a needle at the press of a button."""

PHASES = ("start", "move", "end")
"""Of a drag in the picture."""

FARTHEST = 4.0
"""Picture heights from the middle of a picture to where a drag may go."""

MOST_HEIGHT = 1080
"""Pixels of a picture from top to bottom that a browser may ask for."""


class Order(NamedTuple):
    """A word, and a value that is sound."""

    word: str
    value: Any


class Drag(NamedTuple):
    """A place in the picture: heights of it to the right and up from its middle."""

    phase: str
    right: float
    up: float


class View(NamedTuple):
    """What a browser shows: whether the picture is large, its pixels from top to bottom, and whether of both eyes.

    A browser that nobody sees wants a picture of no pixels.
    """

    large: bool
    height: int
    stereo: bool = True


def read_order(text: Any) -> Order | None:
    """The order that ``text`` is, None when it is none."""
    if not isinstance(text, str) or len(text) > MOST_CHARACTERS:
        return None
    try:
        message = json.loads(text)
    except (ValueError, RecursionError):
        return None
    if not isinstance(message, dict) or not set(message) <= {"do", "value"}:
        return None
    word = message.get("do")
    take = ORDERS.get(word) if isinstance(word, str) else None
    if take is None:
        return None
    try:
        return Order(str(word), take(message.get("value")))
    except ValueError:
        return None


def _nothing(value: Any) -> None:
    if value is not None:
        raise ValueError


def _flag(value: Any) -> bool:
    if not isinstance(value, bool):
        raise ValueError
    return value


def _number(value: Any, bound: float) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= bound:
        raise ValueError
    return float(value)


def _motion(value: Any) -> tuple[float, ...]:
    """Right, up, into the picture; turns about the same three; the jaw's opening: each -1..1."""
    if not isinstance(value, list) or len(value) != 7:
        raise ValueError
    return tuple(_number(share, 1.0) for share in value)


def _mode(value: Any) -> str:
    if not isinstance(value, str) or value not in MODES:
        raise ValueError
    return value


def _help(value: Any) -> str:
    if not isinstance(value, str) or value not in HELP:
        raise ValueError
    return value


def _share(value: Any) -> float:
    share = _number(value, 1.0)
    if share < 0.0:
        raise ValueError
    return share


def _drag(value: Any) -> Drag:
    if not isinstance(value, list) or len(value) != 3 or value[0] not in PHASES:
        raise ValueError
    return Drag(value[0], _number(value[1], FARTHEST), _number(value[2], FARTHEST))


def _view(value: Any) -> View:
    if not isinstance(value, list) or len(value) != 3:
        raise ValueError
    height = int(_number(value[1], MOST_HEIGHT))
    if height < 0:
        raise ValueError
    return View(_flag(value[0]), height, _flag(value[2]))


def _key(value: Any) -> str:
    """The key of an operator who reconnects, as `desk` issued it."""
    if not isinstance(value, str) or len(value) > 100:
        raise ValueError
    return value


ORDERS: dict[str, Callable[[Any], Any]] = {
    "hello": _key,
    "seen": _nothing,
    "start": _nothing,
    "hold": _nothing,
    "next": _nothing,
    "move": _motion,
    "speed": _mode,
    "drag": _drag,
    "assist": _help,
    "drive": _share,
    "view": _view,
    "dark": _flag,
    "csv": _nothing,
}
"""How the value of each word is read."""
