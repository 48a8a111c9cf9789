"""Small valid files of every kind, the starting points of mutation."""

from __future__ import annotations

import struct
from pathlib import Path

SCENES = Path(__file__).resolve().parents[2] / "scenes" / "suturing_small"

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
ADF = """bodies: [BODY a, BODY b]
joints: [J]
ghost objects: [G]
sensors: [S]
actuators: [A]
namespace: /ambf/env/
gravity: {x: 0, y: 0, z: -9.8}
BODY a: &a
  name: a
  mass: 1.0
  inertia: {ix: 0.1, iy: 0.1, iz: 0.1}
  inertial offset: {position: {x: 0, y: 0, z: 0.1}, orientation: {r: 0, p: 0, y: 0}}
  collision shape: CAPSULE
  collision geometry: {radius: 0.1, height: 0.5, axis: y}
  collision groups: [1, 2]
  location: {position: {x: 0, y: 0, z: 1}, orientation: {r: 0.1, p: 0.2, y: 0.3}}
BODY b:
  name: b
  mass: 0.5
  compound collision shape:
  - {shape: BOX, geometry: {x: 1, y: 1, z: 1}, offset: {position: {x: 0, y: 0, z: 0}, orientation: {r: 0, p: 0, y: 0}}}
  - {shape: SPHERE, geometry: {radius: 0.2}}
J:
  name: a-b
  type: six dof spring
  parent: BODY a
  child: BODY b
  parent pivot: {x: 0, y: 0, z: 0}
  child pivot: {x: 0, y: 0, z: 1}
  parent axis: {x: 0, y: 0, z: 1}
  child axis: {x: 0, y: 0, z: 1}
  offset: 0.3
  joint limits: {linear: {low: {x: 0, y: 0, z: 0}, high: {x: 0, y: 0, z: 0.1}}, angular: {low: {x: 0, y: 0, z: -1}, high: {x: 0, y: 0, z: 1}}}
  stiffness: {linear: {x: 1, y: 1, z: 1}, angular: {x: 1, y: 1, z: 1}}
G: {name: g, parent: BODY a, collision shape: SPHERE, collision geometry: {radius: 0.1}}
S: {name: s, type: Proximity, parent: BODY a, array: [{offset: {x: 0, y: 0, z: 0}, direction: {x: 1, y: 0, z: 0}}]}
A: {name: act, type: Constraint, parent: BODY b}
"""


def binary_stl() -> bytes:
    """A binary STL of two triangles."""
    triangle = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0)
    return b"\0" * 80 + struct.pack("<I", 2) + 2 * triangle


def chunk(kind: int, content: bytes) -> bytes:
    """One 3DS chunk."""
    return struct.pack("<HI", kind, 6 + len(content)) + content


def tds() -> bytes:
    """A 3DS file of one triangle with a material."""
    vertices = struct.pack("<H9f", 3, 0, 0, 0, 1, 0, 0, 0, 1, 0)
    group = chunk(0x4130, b"red\0" + struct.pack("<HH", 1, 0))
    faces = chunk(0x4120, struct.pack("<H4H", 1, 0, 1, 2, 0) + group)
    mesh = chunk(0x4100, chunk(0x4110, vertices) + faces)
    return chunk(0x4D4D, chunk(0x3D3D, chunk(0x4000, b"cube\0" + mesh)))


def seeds() -> list[tuple[str, bytes]]:
    """File name and content of every seed."""
    launch = [(path.name, path.read_bytes()) for path in sorted(SCENES.glob("*.yaml")) if path.stat().st_size < 20_000]
    return [
        ("model.yaml", ADF.encode()),
        *launch,
        ("part.obj", OBJ.encode()),
        ("part.mtl", MTL.encode()),
        ("ascii.stl", ASCII_STL.encode()),
        ("binary.stl", binary_stl()),
        ("part.3ds", tds()),
    ]
