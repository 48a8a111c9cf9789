"""What callers give to a writer of datasets, looked at before anything is written.

Each function raises ValueError for what no dataset can keep, with what would be right.
"""

from __future__ import annotations

import operator
import reprlib
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.datasets.labels import GESTURES, MOST_PHASES

OWN = frozenset({
    "format", "version", "scene", "rate", "phases", "activities", "gestures", "depth_unit", "closed", "success",
    "samples",
})  # fmt: skip
"""Attributes that no remark may replace."""

OWN_OF_ALL = frozenset({"recorded"})
"""The same of the whole dataset alone: readers expect less of what was recorded."""

TRUTHS = frozenset({"judged"})
"""Remarks that readers take for true or false."""

MOST_RATE, LARGEST = 1000.0, 8192
"""Samples a second, and pixels of a side of a picture; readers refuse more."""


def truth_of(what: str, value: object) -> bool:
    """The truth value ``value``: a bool, also of numpy and in an array of one, or 0 or 1."""
    if isinstance(value, np.ndarray | np.generic) and value.dtype == bool and value.size == 1:
        return bool(value.item())
    if isinstance(value, bool | int | np.integer) and value in (0, 1):
        return bool(value)
    raise ValueError(f"'{what}' is {_shown(value)}; it must be True or False")


def unique_names(what: str, given: object) -> tuple[str, ...]:
    """Names, none of them empty or there twice."""
    if isinstance(given, str | bytes) or not isinstance(given, Iterable):
        raise ValueError(f"{what} is {_shown(given)}; it must be a list of names, () for none")
    names = tuple(given)
    for k, name in enumerate(names):
        if not isinstance(name, str) or not name:
            raise ValueError(f"{what}: {_shown(name)} is not a name; each must be a text that is not empty")
        if name in names[:k]:
            raise ValueError(f"{what}: '{name}' is there twice; give each name once")
    return names


def phases_of(given: object) -> tuple[str, ...]:
    """Names of phases."""
    phases = unique_names("phases", given)
    if len(phases) > MOST_PHASES:
        raise ValueError(f"a dataset has at most {MOST_PHASES} phases, not {len(phases)}")
    remarks_of({f"phase {k}": phase for k, phase in enumerate(phases)})
    return phases


def check_gestures(gestures: object, phases: tuple[str, ...]) -> None:
    """Look at gestures by the names of phases."""
    for phase, gesture in _mapping("gestures", gestures).items():
        if phase not in phases:
            raise ValueError(f"gestures: '{phase}' is not a phase; the phases are {', '.join(phases) or 'none'}")
        if not isinstance(gesture, str) or gesture not in GESTURES:
            raise ValueError(f"gestures: '{gesture}' is not one of the gestures {', '.join(GESTURES)}")


def rate_of(rate: object) -> float:
    """Samples per simulated second."""
    if isinstance(rate, bool) or not isinstance(rate, int | float | np.integer | np.floating):
        raise ValueError(f"rate is {_shown(rate)}; it must be a number of samples per simulated second")
    if not 0.0 < rate <= MOST_RATE:
        raise ValueError(f"rate must be above 0 and at most {MOST_RATE:g} samples per simulated second, not {rate}")
    return float(rate)


def size_of(size: Any) -> tuple[int, int]:
    """Width and height of pictures."""
    try:
        width, height = map(operator.index, size)
    except (TypeError, ValueError):
        raise ValueError(f"size is {_shown(size)}; it must be a width and a height in pixels, as (320, 240)") from None
    if not 1 <= min(width, height) <= max(width, height) <= LARGEST:
        raise ValueError(f"size is a width and a height in pixels, from 1 to {LARGEST} each, not {width} and {height}")
    return width, height


def remarks_of(remarks: object, of_all: bool = False) -> dict[str, Any]:
    """Attributes as HDF5 is to keep them, of the whole dataset if ``of_all``."""
    own = OWN | OWN_OF_ALL if of_all else OWN
    return {_remark_name(name, own): _remark(name, value) for name, value in _mapping("remarks", remarks).items()}


def _remark_name(name: object, own: frozenset[str]) -> str:
    if not isinstance(name, str) or not name or not _is_kept(name):
        raise ValueError(f"remarks: {_shown(name)} cannot be the name of a remark; use letters, digits and _")
    if name in own:
        raise ValueError(f"'{name}' is set by the writer; give your remark another name")
    return name


def _remark(name: str, value: object) -> object:
    if name in TRUTHS:
        return truth_of(name, value)
    if name == "task" and not isinstance(value, str):
        raise ValueError(f"'task' is a {type(value).__name__}; it must be a text")
    if not _is_scalar(value):
        raise ValueError(f"'{name}' is a {type(value).__name__}; it must be a number or a text")
    if isinstance(value, int) and not -(2**63) <= value < 2**64:
        raise ValueError(f"'{name}' is {value}, which has more than 64 bits; give it as a text")
    if isinstance(value, str) and not _is_kept(value):
        raise ValueError(f"'{name}' is {value!r}, which no file can hold; leave out NUL and lone surrogates")
    return value


def values_of(extra: object) -> dict[str, NDArray[Any]]:
    """A caller's numbers by their names, with their own types: truth values, whole numbers, and floats."""
    found = {}
    for name, value in _mapping("extra", extra).items():
        if not isinstance(name, str) or not name.isprintable() or name in ("", ".", "..") or "/" in name:
            raise ValueError(f"extra: {name!r} cannot be the name of an array; use letters, digits and _")
        found[name] = _numbers(name, value)
    return found


def _numbers(name: str, value: object) -> NDArray[Any]:
    try:
        numbers = np.asarray(value)
    except (TypeError, ValueError) as error:
        raise ValueError(f"extra: '{name}' is not an array of numbers: {error}") from error
    if not numbers.size:
        raise ValueError(f"extra: '{name}' is empty; it must have a number")
    if numbers.dtype.kind not in "biuf":
        raise ValueError(
            f"extra: '{name}' is {_shown(value)}, of the type {numbers.dtype}; it must be floats, whole numbers of at "
            "most 64 bits, or True and False"
        )
    if numbers.dtype.kind != "f":
        return numbers
    if numbers.dtype.itemsize > np.dtype(float).itemsize:
        with np.errstate(over="ignore"):
            numbers = numbers.astype(float)
    if not np.isfinite(numbers).all():
        place = np.argwhere(~np.isfinite(numbers))[0].tolist()
        raise ValueError(
            f"extra: '{name}' has {numbers[tuple(place)]}{f' at {place}' if place else ''}; numbers must be finite"
        )
    return numbers


def _mapping(what: str, given: object) -> Mapping[Any, Any]:
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise ValueError(f"{what} is {_shown(given)}; it must be values by their names, as a dict")
    return given


def _is_scalar(value: object) -> bool:
    if isinstance(value, np.generic) and not isinstance(value, str):
        return value.dtype.kind in "biuf"
    return isinstance(value, bool | int | float | str)


def _is_kept(text: str) -> bool:
    """Whether HDF5 gives a text back as it is."""
    return "\0" not in text and not any("\ud800" <= letter <= "\udfff" for letter in text)


def _shown(value: object) -> str:
    return reprlib.repr(value)
