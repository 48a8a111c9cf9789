"""The same triangles as different programs write them: OBJ and STL files of every legal form.

Dialect N of a format is the same in every run. Vertices are numbers of few digits, so that both forms of STL hold them.
"""

from __future__ import annotations

import random
import struct
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MATERIALS = ("red", "Material.001", "größe #2", "blue steel")


class Soup:
    """Polygons of some materials: ``vertices`` (n, 3), ``polygons`` of vertex numbers, ``materials`` of each."""

    def __init__(self, number: int) -> None:
        rng = random.Random(number)
        self.vertices = np.array([[rng.randint(-99, 99) / 16 for _ in range(3)] for _ in range(rng.randint(3, 12))])
        count = rng.randint(1, 8)
        corners = range(len(self.vertices))
        self.polygons = [
            rng.sample(corners, min(rng.choice((3, 3, 3, 4, 6)), len(self.vertices))) for _ in range(count)
        ]
        self.names = rng.sample(MATERIALS, rng.randint(1, len(MATERIALS)))
        self.materials = [rng.randrange(len(self.names)) for _ in self.polygons]

    def triangles(self, material: int | None = None) -> Array:
        """Corners (m, 3, 3) of the fans of the polygons, of one material or of all, in order."""
        found = [
            (polygon[0], b, c)
            for polygon, own in zip(self.polygons, self.materials, strict=True)
            if material is None or own == material
            for b, c in zip(polygon[1:], polygon[2:], strict=False)
        ]
        return np.array([self.vertices[list(corners)] for corners in found]).reshape(-1, 3, 3)


def obj(soup: Soup, number: int) -> tuple[bytes, bytes]:
    """An OBJ file that names the library ``part.mtl``, and that library."""
    rng = random.Random(1000 + number)
    newline = rng.choice(("\n", "\n", "\r\n", "\r"))
    relative, remarks = rng.random() < 0.4, rng.random() < 0.4
    textured, normals = rng.random() < 0.5, rng.random() < 0.5
    colours, weights = rng.random() < 0.2, rng.random() < 0.2
    interleaved = rng.random() < 0.5

    def line(words: list[str]) -> str:
        gap = rng.choice((" ", "  ", "\t"))
        text = rng.choice(("", "", " ")) + gap.join(words)
        if rng.random() < 0.1 and len(words) > 2:
            text = gap.join(words[:2]) + " \\" + newline + gap.join(words[2:])
        return text + (rng.choice(("", " ", " # from a program", "#")) if remarks else "")

    def vertex(place: Array) -> str:
        more = ["0.5", "0.25", "1"] if colours else ["1.0"] if weights else []
        return line(["v", *(rng.choice((f"{x!r}", f"{x:.6f}", f"{x:e}")) for x in place.tolist()), *more])

    lines = [rng.choice(("# exported", "", "o part", "g a b")), "mtllib part.mtl"]
    if textured:
        lines.append(line(["vt", "0.5", *rng.choice(([], ["0.5"], ["0.5", "0"]))]))
    if normals:
        lines.append(line(["vn", "0", "0", "1"]))
    written: dict[int, int] = {}
    if not interleaved:
        written = {index: index for index in range(len(soup.vertices))}
        lines += [vertex(place) for place in soup.vertices]
    selected = None
    for polygon, material in zip(soup.polygons, soup.materials, strict=True):
        for index in polygon:
            if index not in written:
                written[index] = len(written)
                lines.append(vertex(soup.vertices[index]))
        if material != selected:
            selected = material
            lines.append(f"usemtl {soup.names[material]}{rng.choice(('', ' '))}")
        ends = [written[index] - len(written) if relative else written[index] + 1 for index in polygon]
        vt = "-1" if relative and rng.random() < 0.5 else "1"
        form = {(False, False): "", (True, False): f"/{vt}", (False, True): "//1", (True, True): f"/{vt}/1"}
        lines.append(line(["f", *(f"{end}{form[textured, normals]}" for end in ends)]))
        if rng.random() < 0.2:
            lines.append(rng.choice(("s off", "s 1", "g more", "", "# remark", "l 1 2")))
    text = rng.choice(("", "\ufeff")) + newline.join(lines) + rng.choice(("", newline))
    keys = ("Kd 0.5 0.5 0.5", "d 1.0", "illum 2", "Ni 1.45")
    library = newline.join(f"newmtl {name}{newline}{newline.join(keys)}" for name in soup.names)
    return text.encode(), (rng.choice(("", "\ufeff")) + library + newline).encode()


def stl(soup: Soup, number: int) -> bytes:
    """An STL file of all triangles, binary or ASCII."""
    rng = random.Random(2000 + number)
    triangles = soup.triangles()
    if rng.random() < 0.5:
        header = rng.choice(
            (b"", b"solid part", b"solid exported by a program", b"SOLID", b"\xff" * 80, b"COLOR=\1\2\3\4")
        )
        padding = rng.choice((b"\0", b" "))
        data = header[:80].ljust(80, padding) + struct.pack("<I", len(triangles))
        for corners in triangles:
            data += struct.pack("<12fH", 0.0, 0.0, 0.0, *corners.ravel(), rng.choice((0, 0xFFFF)))
        return data + rng.choice((b"", b"\0", b"\n", b"written by a program" * 5))
    upper = rng.random() < 0.3
    newline = rng.choice(("\n", "\r\n", "\r", " "))
    pad = rng.choice(("", "  ", "\t")) if newline != " " else ""
    name = rng.choice(("part", "", "vertex group 1", "größe"))
    words = [f"solid {name}".rstrip(), *_facets(triangles, rng), f"endsolid {name}".rstrip()]
    text = newline.join(pad * (0 < i < len(words) - 1) + word for i, word in enumerate(words))
    text = rng.choice(("", "\ufeff", "\n", " ")) + (text.upper() if upper else text) + rng.choice(("", newline))
    return text.encode()


def _facets(triangles: Array, rng: random.Random) -> Iterator[str]:
    for corners in triangles:
        yield from ("facet normal 0 0 1", "outer loop")
        for place in corners.tolist():
            yield "vertex " + " ".join(rng.choice((f"{x!r}", f"{x:.6f}", f"{x:e}")) for x in place)
        yield from ("endloop", "endfacet")
