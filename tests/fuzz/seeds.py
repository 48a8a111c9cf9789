"""Small valid files of every kind, the starting points of mutation."""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass
from pathlib import Path

SCENE = Path(__file__).resolve().parent / "scene"
SMALL_SCENE = Path(__file__).resolve().parents[2] / "scenes" / "suturing_small"

ENTRIES = {
    "world.yaml": "launch.yaml", "environment.yaml": "launch.yaml", "colours.yaml": "launch.yaml",
    "devices.yaml": "launch.yaml", "part.mtl": "part.obj",
}  # fmt: skip
"""The file to load for those that are not loaded by themselves."""

OBJ = """mtllib part.mtl
o cube
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 0 0 1
v 1 0 1
v 1 1 1
v 0 1 1
vt 0 0
vt 1 1
vn 0 0 1
usemtl red
f 1/1/1 2/2/1 3/1/1 4/2/1
f 5//1 6//1 7//1 8//1
usemtl blue
f 1 2 6 5
f 2 3 7 6
"""
MTL = "newmtl red\nKa 1 1 1\nKd 0.8 0.1 0.1\nKs 0.5 0.5 0.5\nNs 32\nd 1.0\nmap_Kd red.png\nnewmtl blue\nKd 0 0 1\n"
ASCII_STL = (
    "solid s\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n"
)


def binary_stl() -> bytes:
    """A binary STL of two triangles."""
    triangle = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0)
    return b"\0" * 80 + struct.pack("<I", 2) + 2 * triangle


def chunk(kind: int, content: bytes) -> bytes:
    """One 3DS chunk."""
    return struct.pack("<HI", kind, 6 + len(content)) + content


def tds() -> bytes:
    """A 3DS file of one triangle with a material."""
    colour = chunk(0x0011, bytes((255, 0, 0)))
    look = chunk(0xA000, b"red\0") + chunk(0xA020, colour) + chunk(0xA050, chunk(0x0030, struct.pack("<H", 25)))
    look += chunk(0xA040, chunk(0x0031, struct.pack("<f", 50.0))) + chunk(0xA200, chunk(0xA300, b"red.png\0"))
    vertices = struct.pack("<H9f", 3, 0, 0, 0, 1, 0, 0, 0, 1, 0)
    group = chunk(0x4130, b"red\0" + struct.pack("<HH", 1, 0))
    faces = chunk(0x4120, struct.pack("<H4H", 1, 0, 1, 2, 0) + group)
    uvs = chunk(0x4140, struct.pack("<H6f", 3, 0, 0, 1, 0, 0, 1))
    mesh = chunk(0x4100, chunk(0x4110, vertices) + uvs + faces)
    return chunk(0x4D4D, chunk(0x3D3D, chunk(0xAFFF, look) + chunk(0x4000, b"cube\0" + mesh)))


@dataclass(frozen=True)
class Seed:
    """A valid file of the scene that is mutated; ``entry`` is the file that a user would load with it."""

    name: str
    data: bytes
    entry: str

    @property
    def binary(self) -> bool:
        """Whether the file is no text."""
        return self.name in ("binary.stl", "part.3ds")

    @property
    def yaml(self) -> bool:
        """Whether the file is a scene file."""
        return self.name.endswith(".yaml")


def seeds() -> list[Seed]:
    """All files of one valid scene: every kind of scene file, object and mesh."""
    found = [(path.name, path.read_bytes()) for path in sorted(SCENE.glob("*.yaml"))]
    arm = (SMALL_SCENE / "psm1.yaml").read_bytes().replace(b"high resolution path: high_res/\n", b"")
    found += [("arm.yaml", re.sub(rb"psm_\w+\.obj", b"part.obj", arm))]
    found += [("part.obj", OBJ.encode()), ("part.mtl", MTL.encode()), ("ascii.stl", ASCII_STL.encode())]
    found += [("binary.stl", binary_stl()), ("part.3ds", tds())]
    return [Seed(name, data, ENTRIES.get(name, name)) for name, data in found]


def write_scene(folder: Path) -> None:
    """Write all seeds, and the picture that a material names, to ``folder``."""
    for seed in seeds():
        (folder / seed.name).write_bytes(seed.data)
    (folder / "red.png").touch()
