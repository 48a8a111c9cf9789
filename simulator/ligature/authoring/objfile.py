"""Writes OBJ and MTL files in the dialect that AMBF reads: the same mesh gives the same bytes.

One ``usemtl`` block per part; every material has ``Kd``; texture names are relative and stand alone
on their lines, since the reference takes the rest of the line for the name. Metres, no axis change.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ligature.adf.frames import Array

DIGITS = 7
"""Significant digits of coordinates: what single precision holds."""


class MeshWriteError(ValueError):
    """A mesh that cannot be written; the message is the reason."""


@dataclass(frozen=True)
class Paint:
    """A material: colours 0..1, ``alpha`` 1 is opaque, names of texture files next to the OBJ or empty."""

    name: str
    diffuse: tuple[float, float, float] = (0.8, 0.8, 0.8)
    specular: tuple[float, float, float] = (0.2, 0.2, 0.2)
    shininess: float = 32.0
    alpha: float = 1.0
    texture: str = ""
    normal_map: str = ""


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles (m, 3) of one material; ``normals`` (m, 3, 3) and ``uvs`` (m, 3, 2) are of their corners."""

    paint: Paint
    vertices: Array
    triangles: NDArray[np.int32]
    normals: Array | None = None
    uvs: Array | None = None


def obj_texts(surfaces: Sequence[Surface], library: str, name: str) -> tuple[str, str]:
    """OBJ and MTL text; ``library`` is the MTL file's name. Raises `MeshWriteError`."""
    if not any(len(s.triangles) for s in surfaces):
        raise MeshWriteError(
            f"'{name}' has no face, so that its file would be empty; give it faces, or make it an empty"
        )
    lines = [f"mtllib {library}", f"o {_word(name)}"]
    counts = [1, 1, 1]
    written = [surface for surface in surfaces if len(surface.triangles)]
    words = _words([surface.paint.name for surface in written])
    for surface, word in zip(written, words, strict=True):
        lines += _surface_lines(surface, counts, name, word)
    paints = [_paint_lines(surface.paint, word) for surface, word in zip(written, words, strict=True)]
    return "\n".join(lines) + "\n", "\n".join(paints)


def _surface_lines(surface: Surface, counts: list[int], name: str, material: str) -> list[str]:
    vertices = np.asarray(surface.vertices, dtype=float)
    if not np.isfinite(vertices).all():
        raise MeshWriteError(f"'{name}' has a vertex that is not finite; check its modifiers and its transform")
    distinct, index = _distinct(vertices[surface.triangles].reshape(-1, 3))
    lines = [_table("v", distinct)]
    corners = [index + counts[0]]
    counts[0] += len(distinct)
    for values, letter, place in ((surface.uvs, "vt", 1), (surface.normals, "vn", 2)):
        if values is None:
            continue
        distinct, index = _distinct(np.asarray(values, dtype=float).reshape(len(surface.triangles) * 3, -1))
        lines.append(_table(letter, distinct))
        corners.append(index + counts[place])
        counts[place] += len(distinct)
    lines.append(f"usemtl {material}")
    separator = "//" if surface.uvs is None and surface.normals is not None else "/"
    corner = separator.join(["%d"] * len(corners))
    line = f"f {corner} {corner} {corner}\n"
    numbers = np.column_stack(corners).ravel().tolist()
    return [*lines, (line * len(surface.triangles) % tuple(numbers))[:-1]]


def _table(letter: str, rows: Array) -> str:
    """Lines of a letter and the row's numbers; one format for all, since there are tens of thousands."""
    line = " ".join([letter] + [f"%.{DIGITS}g"] * rows.shape[1]) + "\n"
    return (line * len(rows) % tuple(rows.ravel().tolist()))[:-1]


def _distinct(rows: Array) -> tuple[Array, NDArray[np.int64]]:
    """The different rows, as single precision has them, in order of first use, and the row of each."""
    with np.errstate(under="ignore"):
        single = np.ascontiguousarray(rows.astype(np.float32)) + np.float32(0.0)
    code = np.zeros(len(single), dtype=np.int64)
    for column in single.view(np.int32).T:  # equal numbers have equal bits, now that no zero is negative
        values, place = np.unique(column, return_inverse=True)
        _, code = np.unique(code * len(values) + place, return_inverse=True)
    _, first, inverse = np.unique(code, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return single[first[order]].astype(float), rank[inverse.reshape(-1)]


def _paint_lines(paint: Paint, material: str) -> str:
    lines = [f"newmtl {material}", "Ka 1 1 1"]
    lines += [
        f"{key} {' '.join(f'{v:.6g}' for v in values)}"
        for key, values in (("Kd", paint.diffuse), ("Ks", paint.specular))
    ]
    lines += [f"Ns {paint.shininess:.6g}", f"d {paint.alpha:.6g}"]
    lines += [f"{key} {file}" for key, file in (("map_Kd", paint.texture), ("map_Bump", paint.normal_map)) if file]
    return "\n".join(lines) + "\n"


def _words(names: Sequence[str]) -> list[str]:
    """Names of one word each; different names stay different."""
    found: dict[str, str] = {}
    for name in names:
        word, number = _word(name), 2
        while name not in found and word in found.values():
            word, number = f"{_word(name)}_{number}", number + 1
        found.setdefault(name, word)
    return [found[name] for name in names]


def _word(name: str) -> str:
    """A name of one word, since readers split lines at blanks."""
    return "_".join(name.split()) or "unnamed"
