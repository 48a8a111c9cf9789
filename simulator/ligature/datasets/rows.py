"""The rows of an episode on their way into its HDF5 file: small ones gathered, pictures compressed one by one.

HDF5 would be asked for each row of some sixty arrays and compress with zlib; whole chunks are written here, which says
the same to readers.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import h5py
import numpy as np
from isal import isal_zlib
from numpy.typing import NDArray

from ligature.kernels import released

GATHERED = 256
"""Rows of a chunk, and so rows that wait for their chunk to be full."""

PICTURE = {"compression": "gzip", "compression_opts": 1, "shuffle": True}
"""How HDF5 is to unpack a picture; `Packed` holds it so."""

EFFORT = 2
"""Level of ISA-L's deflate: a fifth of the time of zlib's first level, 4 % larger."""


class Packed(NamedTuple):
    """A picture as HDF5's filters leave it; making one takes milliseconds, and no file."""

    shape: tuple[int, ...]
    dtype: str
    content: bytes

    @classmethod
    def of(cls, picture: NDArray[Any]) -> Packed:
        """A ``picture``: first bytes of all its numbers, then the second ones; deflated."""
        numbers = np.ascontiguousarray(picture).reshape(-1).view(np.uint8).reshape(-1, picture.itemsize)
        planes = numbers
        if picture.itemsize > 1:
            planes = np.empty(numbers.shape[::-1], dtype=np.uint8)
            _turn(numbers, planes)
        return cls(picture.shape, picture.dtype.str, bytes(isal_zlib.compress(planes, EFFORT)))


@released
def _turn(rows: NDArray[np.uint8], columns: NDArray[np.uint8]) -> None:
    """Fill ``columns`` (m, n) with ``rows`` (n, m)."""
    for k in range(rows.shape[1]):
        for i in range(rows.shape[0]):
            columns[k, i] = rows[i, k]


class EpisodeRows:
    """Arrays of ``file``, each of which gets row after row."""

    def __init__(self, file: h5py.File) -> None:
        self._file = file
        self._arrays: dict[str, h5py.Dataset] = {}
        self._waiting: dict[str, list[NDArray[Any]]] = {}
        self._types: dict[str, str] = {}

    def append(self, name: str, value: Any, dtype: str, **notes: str) -> None:
        """Add a row to the array ``name``; ``notes`` such as ``units`` are its attributes."""
        kind = self._types.get(name, dtype)
        row = np.asarray(value).astype(kind)  # a copy: a row that waits must not change with the simulation
        if name not in self._arrays:
            self._create(name, row.shape, dtype, GATHERED, {}, notes)
        waiting = self._waiting.setdefault(name, [])
        waiting.append(row)
        if len(waiting) == GATHERED:
            self._write(name)

    def widen(self, name: str, row: NDArray[Any]) -> bool:
        """Give the array ``name`` a type that keeps all digits of its rows and of ``row``; False if there is none."""
        array = self._arrays.get(name)
        if array is None or array.dtype == row.dtype:
            return True
        wide = np.result_type(array.dtype, row.dtype)
        if not _kept(row, wide):
            return False
        return wide == array.dtype or self._retype(name, array, wide)

    def _retype(self, name: str, array: h5py.Dataset, wide: np.dtype[Any]) -> bool:
        """Write an array anew with another type, unless that loses digits."""
        if self._waiting.get(name):
            self._write(name)
        values, notes = array[:], dict(array.attrs)
        if not _kept(values, wide):
            return False
        del self._file[name]
        self._create(name, values.shape[1:], wide.str, GATHERED, {}, notes)
        self._arrays[name].resize(len(values), axis=0)
        self._arrays[name][:] = values
        self._types[name] = wide.str
        return True

    def append_picture(self, name: str, picture: Packed, **notes: str) -> None:
        """Add a picture to the array ``name``."""
        if name not in self._arrays:
            self._create(name, picture.shape, picture.dtype, 1, PICTURE, notes)
        array = self._arrays[name]
        at = len(array)
        array.resize(at + 1, axis=0)
        array.id.write_direct_chunk((at, *[0] * len(picture.shape)), picture.content)

    def _create(
        self, name: str, shape: tuple[int, ...], dtype: str, chunk: int, options: dict[str, Any], notes: dict[str, str]
    ) -> None:
        """Create the array ``name``, of chunks of so many rows."""
        self._arrays[name] = array = self._file.create_dataset(
            name, (0, *shape), dtype, maxshape=(None, *shape), chunks=(chunk, *shape), **options
        )
        array.attrs.update(notes)

    def _write(self, name: str) -> None:
        array, rows = self._arrays[name], self._waiting.pop(name)
        at = len(array)
        array.resize(at + len(rows), axis=0)
        array[at:] = rows

    def finish(self) -> None:
        """Write the rows that wait."""
        for name in list(self._waiting):
            self._write(name)


def _kept(values: NDArray[Any], dtype: np.dtype[Any]) -> bool:
    """Whether numbers come back from another type as they were."""
    with np.errstate(invalid="ignore"):
        return bool((values.astype(dtype).astype(values.dtype) == values).all())


def add_actions(episode: h5py.File) -> None:
    """The action of a sample is the set-point of the next one; that of the last is its own."""
    for arm in episode["arms"].values() if "arms" in episode else ():
        for source, name in (("setpoint_js", "action_js"), ("local_setpoint_cp", "local_action_cp")):
            values = arm[source][:]
            _add_next(arm, name, values[:, 0] if source == "setpoint_js" else values, arm[source].attrs["units"])
        if "jaw" in arm:
            _add_next(arm, "jaw/action_js", arm["jaw/setpoint_js"][:, 0], "rad")


def _add_next(arm: h5py.Group, name: str, values: NDArray[Any], units: str) -> None:
    arm.create_dataset(name, data=np.concatenate([values[1:], values[-1:]])).attrs["units"] = units
