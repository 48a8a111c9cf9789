"""What one row of the schema states: a key's path, type, unit, default, choices, meaning and what becomes of it."""

from __future__ import annotations

import enum
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any


class Type(enum.Enum):
    """What a value is; block types name their sub-keys in the text of the value."""

    NUMBER = "number"
    INTEGER = "integer"
    UNSIGNED = "whole number >= 0"
    FLAG = "true/false"
    TEXT = "text"
    PATH = "path"
    CHOICE = "one of"
    VECTOR = "{x, y, z}"
    RPY = "{r, p, y}"
    POSE = "{position, orientation}"
    MAP = "block"
    MAPS = "list of blocks"
    TEXTS = "list of text"
    INTEGERS = "list of whole numbers"
    MATRIX = "4x4 list of lists"
    NUMBER_OR_MAP = "number or block"
    ANY = "anything"


class Status(enum.Enum):
    """What becomes of a key."""

    USED = "used"
    IGNORED = "read and ignored, as in AMBF"
    UNUSED = "without effect here"
    KEPT = "kept as written for plug-ins"
    NOT_SIMULATED = "checked, not simulated"
    OURS = "Ligature's own; AMBF ignores it"


class Fault(enum.Enum):
    """What AMBF gives up when a value is bad or missing; we give up the object instead of the file."""

    FILE = "the whole file is rejected"
    OBJECT = "the object is left out"
    VALUE = "the default is used"


@dataclass(frozen=True)
class Key:
    """One key of one kind of object.

    Attributes
    ----------
    path
        Dotted: ``friction.static`` is the key ``static`` of the block ``friction``; ``array[].offset``
        lies in each item of the list ``array``.
    default
        Value when the key is absent; None when there is none.
    unit
        SI unit of a number, empty for pure numbers and texts.
    required
        The key must stand in its block whenever the block stands there.
    choices
        Accepted spellings and what each means.
    fault
        What AMBF gives up when the value is bad or missing.
    least, most
        Smallest value and largest magnitude that can be simulated; a value beyond is an error. ``most`` holds for each
        component of a vector, and for the position of a pose; of a length in metres it is `FARTHEST` unless given.
    above
        Whether ``least`` itself is too small.
    """

    path: str
    type: Type
    default: Any = None
    unit: str = ""
    doc: str = ""
    required: bool = False
    choices: Mapping[str, str] = field(default_factory=dict)
    status: Status = Status.USED
    fault: Fault = Fault.FILE
    least: float | None = None
    most: float | None = None
    above: bool = False

    def __post_init__(self) -> None:
        if self.most is None and self.unit.split(",")[0] == "m" and self.status in (Status.USED, Status.OURS):
            object.__setattr__(self, "most", FARTHEST)

    @property
    def block(self) -> str:
        """Path of the enclosing block, empty at the top."""
        return self.path.rpartition(".")[0]

    @property
    def name(self) -> str:
        """The key itself, without its blocks."""
        return self.path.rpartition(".")[2]


def each(names: str | Iterable[str], type_: Type, path: str, *args: Any, **kwargs: Any) -> tuple[Key, ...]:
    """One key for each name, ``{}`` in ``path`` and in the meaning replaced by it."""
    keys = (Key(path.format(name), type_, *args, **kwargs) for name in names)
    return tuple(replace(key, doc=key.doc.format(key.name)) for key in keys)


def ignored(names: str | Iterable[str], doc: str) -> tuple[Key, ...]:
    """Keys of real files that have no effect, here as in AMBF; any value is fine."""
    return tuple(Key(name, Type.ANY, doc=doc, status=Status.IGNORED) for name in names)


def unused(keys: Iterable[Key], *paths: str) -> tuple[Key, ...]:
    """Keys that AMBF uses and that have no effect here; their values are checked all the same.

    With ``paths`` only those; the others stay as they are.
    """
    return tuple(replace(key, status=Status.UNUSED) if not paths or key.path in paths else key for key in keys)


def spellings(*names: str) -> dict[str, str]:
    """Each name in lower case, Capitalised and UPPER case, mapped to UPPER case."""
    return {form: n.upper() for n in names for form in (n.lower(), n.capitalize(), n.upper())}


FARTHEST = 1e4
"""Largest length in metres: beyond it collisions of parts of millimetres lose precision."""

LONGEST_ARM = 100.0
"""Largest distance in metres of a centre of mass or a joint from its body's frame: it multiplies errors of rotation."""

LARGEST_SCALE = 1e3
"""Largest scale of a mesh: that between millimetres and metres."""

HEAVIEST, STRONGEST = 1e6, 1e3
"""Largest mass in kg and gravity in m/s² that can be simulated."""

ZERO = (0.0, 0.0, 0.0)
POSE_ZERO = (ZERO, ZERO)
