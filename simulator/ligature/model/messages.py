"""What every command is made of: fields that know their wire form and their bounds.

A command is a frozen dataclass; each of its fields is declared by `wire` with a `Field`, and that one declaration
checks it, packs it and unpacks it. Numbers are in SI units. On the wire a message is one byte, its ``code``,
followed by its fields in order, little-endian.
"""

from __future__ import annotations

import dataclasses
import enum
import functools
import math
import struct
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, TypeVar

Vector = tuple[float, ...]
Result = TypeVar("Result")

MAX_NUMBERS = 250
"""Most numbers of one field: trees of others have up to 94 joints, and a length takes one byte."""

MAX_TEXT = 200
"""Most bytes of a text."""

LARGEST = 1e9
"""Largest magnitude of a number that has no bound of its own."""

_ABSENT = 255


class CodecError(ValueError):
    """A message too large for its wire form, or bytes that are no message."""


class Field:
    """One value of a message: its wire form, and what it may be."""

    def pack(self, value: Any) -> bytes:
        """The bytes of ``value``; raises `CodecError` when it does not fit."""
        raise NotImplementedError

    def unpack(self, data: bytes, at: int) -> tuple[Any, int]:
        """The value at offset ``at``, and the offset behind it."""
        raise NotImplementedError

    def check(self, what: str, value: Any) -> None:
        """Raise ValueError, naming ``what`` and the bound, when the value is invalid."""


@dataclass(frozen=True)
class Packed(Field):
    """A value of fixed size, by its `struct` format and its Python type."""

    format: str
    type: Callable[[Any], Any]

    def pack(self, value: Any) -> bytes:  # noqa: D102
        return struct.pack(self.format, value)

    def unpack(self, data: bytes, at: int) -> tuple[Any, int]:  # noqa: D102
        return self.type(struct.unpack_from(self.format, data, at)[0]), at + struct.calcsize(self.format)


INDEX = Packed("<i", int)
"""Number of an object of the scene; `Message.check` bounds it."""

COUNT = Packed("<I", int)
"""A whole number from 0 to 2³² − 1."""

FLAG = Packed("<?", bool)


@dataclass(frozen=True)
class OptionalIndex(Field):
    """Number of an object of the scene, or None."""

    def pack(self, value: Any) -> bytes:  # noqa: D102
        return INDEX.pack(-1 if value is None else value)

    def unpack(self, data: bytes, at: int) -> tuple[Any, int]:  # noqa: D102
        value, at = INDEX.unpack(data, at)
        return (None if value < 0 else value), at


@dataclass(frozen=True)
class Choice(Field):
    """One of ``options``, by its place among them."""

    options: tuple[Any, ...]

    def pack(self, value: Any) -> bytes:  # noqa: D102
        self.check("", value)
        return bytes([self.options.index(value)])

    def unpack(self, data: bytes, at: int) -> tuple[Any, int]:  # noqa: D102
        return self.options[data[at]], at + 1

    def check(self, what: str, value: Any) -> None:  # noqa: D102
        _check_option(value, self.options)


@dataclass(frozen=True)
class Choices(Field):
    """Any number of ``options``."""

    options: tuple[Any, ...]

    def pack(self, value: Any) -> bytes:  # noqa: D102
        _fits(value)
        return bytes([len(value), *(self.options.index(item) for item in value)])

    def unpack(self, data: bytes, at: int) -> tuple[Any, int]:  # noqa: D102
        end = at + 1 + data[at]
        return tuple([self.options[place] for place in _slice(data, at + 1, end)]), end

    def check(self, what: str, value: Any) -> None:  # noqa: D102
        _fits(value)
        for item in value:
            _check_option(item, self.options)


@dataclass(frozen=True)
class Real(Field):
    """One finite number from ``low`` to ``high``."""

    low: float = -LARGEST
    high: float = LARGEST

    def pack(self, value: Any) -> bytes:  # noqa: D102
        return struct.pack("<d", value)

    def unpack(self, data: bytes, at: int) -> tuple[Any, int]:  # noqa: D102
        return struct.unpack_from("<d", data, at)[0], at + 8

    def check(self, what: str, value: Any) -> None:  # noqa: D102
        if not math.isfinite(value):
            raise ValueError(f"{what} must be finite, not {value}")
        if not self.low <= value <= self.high:
            raise ValueError(f"{what} must be within {self.low:g} … {self.high:g}, not {value:g}")


@dataclass(frozen=True)
class Numbers(Field):
    """Finite numbers of magnitude up to ``bound``; as many as ``length`` states, None for any number.

    ``optional`` numbers may be absent, which is None.
    """

    length: int | None = None
    bound: float = LARGEST
    unit: str = "SI units"
    optional: bool = False

    def pack(self, value: Any) -> bytes:  # noqa: D102
        if value is None:
            return bytes([_ABSENT])
        _fits(value, self.length or MAX_NUMBERS)
        return struct.pack(f"<B{len(value)}d", len(value), *value)

    def unpack(self, data: bytes, at: int) -> tuple[Any, int]:  # noqa: D102
        n = data[at]
        if n == _ABSENT and self.optional:
            return None, at + 1
        return struct.unpack_from(f"<{n}d", data, at + 1), at + 1 + 8 * n

    def check(self, what: str, value: Any) -> None:  # noqa: D102
        if value is None and self.optional:
            return
        if self.length is not None and len(value) != self.length:
            raise ValueError(f"{what} must have {self.length} numbers, not {len(value)}")
        _fits(value)
        for number in value:
            if not math.isfinite(number):
                raise ValueError(f"{what} must be finite, not {number}")
            if abs(number) > self.bound:
                raise ValueError(f"{what} must stay within {self.bound:g} {self.unit}, not {number:g}")


@dataclass(frozen=True)
class Pose(Numbers):
    """A position in metres and a unit quaternion, x y z qx qy qz qw."""

    length: int | None = 7
    unit: str = "m"

    def check(self, what: str, value: Any) -> None:  # noqa: D102
        super().check(what, value)
        if value is not None:
            check_unit(value[3:])


@dataclass(frozen=True)
class Text(Field):
    """Up to `MAX_TEXT` bytes of UTF-8; None where it is ``optional`` and absent."""

    optional: bool = False

    def pack(self, value: Any) -> bytes:  # noqa: D102
        if value is None:
            return bytes([_ABSENT])
        raw = _encoded(value)
        return bytes([len(raw)]) + raw

    def unpack(self, data: bytes, at: int) -> tuple[Any, int]:  # noqa: D102
        n = data[at]
        if n == _ABSENT and self.optional:
            return None, at + 1
        end = at + 1 + n
        return _slice(data, at + 1, end).decode("utf-8"), end

    def check(self, what: str, value: Any) -> None:  # noqa: D102
        if value is not None:
            _encoded(value)


def _encoded(text: str) -> bytes:
    raw = text[: MAX_TEXT + 1].encode("utf-8", "replace")  # a character takes at least one byte
    if len(raw) > MAX_TEXT:
        raise CodecError(f"a text has at most {MAX_TEXT} bytes")
    return raw


def check_unit(quaternion: Vector) -> None:
    """Raise ValueError unless the length of ``quaternion`` (4,) is within 10 % of 1."""
    length = math.sqrt(sum(v * v for v in quaternion))
    if not 0.9 <= length <= 1.1:
        raise ValueError(f"the quaternion has the length {length:.3g}; it must be 1")


def _check_option(value: Any, options: tuple[Any, ...]) -> None:
    if value not in options:
        names = ", ".join(f"{o.name} ({o.value})" if isinstance(o, enum.Enum) else str(o) for o in options)
        raise CodecError(f"'{str(value)[:40]}' is not one of {names}")


def _fits(values: Any, most: int = MAX_NUMBERS) -> None:
    if len(values) > most:
        raise CodecError(f"a command has at most {most} numbers here, not {len(values)}")


def _slice(data: bytes, at: int, end: int) -> bytes:
    if end > len(data):
        raise CodecError("the data ends too early")
    return data[at:end]


def wire(field: Field, what: str = "", **options: Any) -> Any:
    """A dataclass field that travels as ``field``; errors call it ``what``, else by its name."""
    return dataclasses.field(metadata={"wire": field, "what": what}, **options)


@dataclass(frozen=True)
class Message:
    """What travels from a front end to the physics process. Subclasses declare their ``code``, unique, once."""

    code: ClassVar[int] = -1
    by_code: ClassVar[dict[int, type[Message]]] = {}

    def __init_subclass__(cls, code: int = -1) -> None:
        """Register a message under its ``code``; base classes that are never sent have none."""
        if code < 0:
            return
        if not 0 <= code < 256 or code in Message.by_code:
            raise TypeError(f"{cls.__name__}: the code {code} is taken, or no byte")
        cls.code = code
        Message.by_code[code] = cls

    @classmethod
    @functools.cache
    def fields(cls) -> tuple[tuple[str, str, Field], ...]:
        """Name, name in errors, and `Field` of every value."""
        return tuple((f.name, f.metadata["what"] or f.name, f.metadata["wire"]) for f in dataclasses.fields(cls))

    @property
    def object(self) -> tuple[str, int] | None:
        """Kind and number of the object that it commands; None for what commands none."""
        return None

    @property
    def slot(self) -> Hashable | None:
        """A newer message with an equal slot replaces this one; None for what must not be lost."""
        return self.object

    @property
    def releases(self) -> bool:
        """Whether it ends what was commanded to its object."""
        return False

    def check(self, counts: Mapping[str, int] | None = None) -> None:
        """Raise ValueError, with what was expected, when a value is invalid.

        With ``counts``, the number of objects of each kind in the scene, also when the scene lacks the object.
        """
        for name, what, field in self.fields():
            field.check(what, getattr(self, name))
        self.check_together(counts)
        if counts is not None and self.object is not None:
            kind, index = self.object
            if not 0 <= index < counts.get(kind, 0):
                raise ValueError(f"the scene has no {kind} number {index}")

    def check_together(self, counts: Mapping[str, int] | None) -> None:
        """Raise ValueError when valid values do not fit each other or, with ``counts``, the scene."""


def handle(handlers: Mapping[type[Message], Callable[[Any], Result]], message: Message) -> Result:
    """Call the handler of the message's class, or of the nearest base that has one.

    Raises TypeError when there is none.
    """
    for cls in type(message).__mro__:
        if cls in handlers:
            return handlers[cls](message)
    raise TypeError(f"nothing handles {type(message).__name__}")
