"""Solids for the looks of scenes: turned, drawn and lofted shapes, and the OBJ and MTL text of several of them.

A solid is a pair of vertices (n, 3) and triangles (m, 3), counter-clockwise seen from outside. Metres.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

Array = np.ndarray
Solid = tuple[Array, Array]

CREASE = np.cos(np.radians(42.0))
"""Cosine of the angle between two faces from which the edge between them is drawn sharp."""

MATERIALS = {
    "steel": "Kd 0.66 0.66 0.68\nKs 0.5 0.5 0.5\nNs 300\nPm 1\nPr 0.28\n",
    "carbide": "Kd 0.34 0.31 0.26\nKs 0.4 0.4 0.4\nNs 80\nPm 1\nPr 0.45\n",
    "composite": "Kd 0.075 0.078 0.085\nKs 0.3 0.3 0.3\nNs 60\nPr 0.38\n",
    "housing": "Kd 0.82 0.84 0.86\nKs 0.2 0.2 0.2\nNs 30\nPr 0.5\n",
    "trim": "Kd 0.10 0.22 0.42\nKs 0.2 0.2 0.2\nNs 30\nPr 0.5\n",
    "glass": "Kd 0.02 0.03 0.05\nKs 0.8 0.8 0.8\nNs 400\nPr 0.08\nPc 1\nPcr 0.05\n",
    "drape": "Kd 0.13 0.34 0.38\nKs 0.05 0.05 0.05\nNs 8\nPr 0.9\n",
    "rubber": "Kd 0.16 0.17 0.18\nKs 0.1 0.1 0.1\nNs 12\nPr 0.8\n",
    "board": "Kd 0.20 0.24 0.30\nKs 0.15 0.15 0.15\nNs 20\nPr 0.6\n",
    "post": "Kd 0.80 0.80 0.78\nKs 0.2 0.2 0.2\nNs 30\nPr 0.5\n",
    "block": "Kd 0.85 0.45 0.08\nKs 0.15 0.15 0.15\nNs 20\nPr 0.6\n",
    "foam": "Kd 0.80 0.62 0.50\nKs 0.05 0.05 0.05\nNs 8\nPr 0.95\n",
    "flesh": "Kd 0.60 0.16 0.15\nKs 0.3 0.3 0.3\nNs 60\nPr 0.6\nPc 1\nPcr 0.2\n",
    "skin": "Kd 0.72 0.42 0.34\nKs 0.2 0.2 0.2\nNs 40\nPr 0.55\n",
}
"""What things are made of, as MTL states it."""


def moved(solid: Solid, T: Array) -> Solid:
    """A solid brought by the transform ``T`` (4, 4)."""
    points, faces = solid
    return points @ T[:3, :3].T + T[:3, 3], faces


def joined(solids: Iterable[Solid]) -> Solid:
    """Several solids as one."""
    points, faces, count = [], [], 0
    for p, f in solids:
        points.append(p)
        faces.append(f + count)
        count += len(p)
    return np.vstack(points), np.vstack(faces)


def loft(rings: Sequence[Array], closed: bool = True) -> Solid:
    """The skin between ``rings`` of k points each; ``closed`` puts lids on both ends, and turns it outward."""
    k, points = len(rings[0]), np.vstack(rings)
    here, there = np.arange(k), (np.arange(k) + 1) % k
    faces = []
    for i in range(len(rings) - 1):
        a, b, c, d = i * k + here, i * k + there, (i + 1) * k + there, (i + 1) * k + here
        faces += [np.column_stack([a, b, c]), np.column_stack([a, c, d])]
    if closed:
        last = len(points)
        points = np.vstack([points, np.mean(rings[0], axis=0), np.mean(rings[-1], axis=0)])
        end = (len(rings) - 1) * k
        faces += [np.column_stack([there, here, np.full(k, last)])]
        faces += [np.column_stack([end + here, end + there, np.full(k, last + 1)])]
    skin = np.vstack(faces)
    inward = closed and np.einsum("ij,ij", points[skin[:, 0]], np.cross(points[skin[:, 1]], points[skin[:, 2]])) < 0
    return points, skin[:, ::-1] if inward else skin


def turned(profile: Sequence[tuple[float, float]], sides: int = 24) -> Solid:
    """A solid of revolution about Z of ``profile``, points (radius, z) with growing z."""
    around = np.linspace(0.0, 2 * np.pi, sides, endpoint=False)
    circle = np.column_stack([np.cos(around), np.sin(around)])
    return loft([np.column_stack([radius * circle, np.full(sides, z)]) for radius, z in profile])


def drawn(outline: Array, low: float, high: float) -> Solid:
    """A straight prism: ``outline`` (k, 2), star-shaped and counter-clockwise, from z = ``low`` to ``high``."""
    return loft([np.column_stack([outline, np.full(len(outline), z)]) for z in (low, high)])


def box(low: Sequence[float], high: Sequence[float], bevel: float = 0.0) -> Solid:
    """A box between two corners, its edges bevelled all around."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    b = bevel
    if not b:
        return drawn(np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]), z0, z1)

    def ring(inset: float, z: float) -> Array:
        a, c, d, e = x0 + inset, x1 - inset, y0 + inset, y1 - inset
        corners = [(a + b, d), (c - b, d), (c, d + b), (c, e - b), (c - b, e), (a + b, e), (a, e - b), (a, d + b)]
        return np.array([(x, y, z) for x, y in corners])

    return loft([ring(b, z0), ring(0.0, z0 + b), ring(0.0, z1 - b), ring(b, z1)])


def rounded_bar(half_width: float, length: float, points: int = 9) -> Array:
    """Outline (k, 2) of a bar from (-length, ·) to a round end about the origin, which ends at x = half_width."""
    turn = np.linspace(-np.pi / 2, np.pi / 2, points)
    arc = half_width * np.column_stack([np.cos(turn), np.sin(turn)])
    return np.vstack([[-length, -half_width], arc, [-length, half_width]])


def normals(solid: Solid) -> Array:
    """Unit normals (m, 3, 3) of the corners of each triangle: smooth, but for edges sharper than `CREASE`."""
    points, faces = solid
    a, b, c = (points[faces[:, i]] for i in range(3))
    weighted = np.cross(b - a, c - a)
    size = np.linalg.norm(weighted, axis=1, keepdims=True)
    flat = weighted / np.maximum(size, 1e-18)
    _, same = np.unique(np.round(points, 8), axis=0, return_inverse=True)
    meeting: dict[int, list[int]] = {}
    for face, corners in enumerate(same[faces]):
        for corner in corners:
            meeting.setdefault(int(corner), []).append(face)
    out = np.empty((len(faces), 3, 3))
    for face, corners in enumerate(same[faces]):
        for i, corner in enumerate(corners):
            others = np.array(meeting[int(corner)])
            near = others[flat[others] @ flat[face] >= CREASE]
            n = weighted[near].sum(axis=0)
            out[face, i] = n / max(np.linalg.norm(n), 1e-18) if len(near) else flat[face]
    return out


def obj(parts: dict[str, Solid]) -> str:
    """OBJ text of solids by the material they are made of; triangles without area are left out."""
    lines, vertices, directions = [], 0, 0
    for material, (points, faces) in parts.items():
        corners = points[faces]
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        faces = faces[area > 1e-14]
        unique, index = np.unique(
            np.round(normals((points, faces)).reshape(-1, 3), 4) + 0.0, axis=0, return_inverse=True
        )
        lines += [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in np.round(points, 6) + 0.0]
        lines += [f"vn {x:.4f} {y:.4f} {z:.4f}" for x, y, z in unique]
        lines.append(f"usemtl {material}")
        for face, normal in zip(faces, index.reshape(-1, 3), strict=True):
            pairs = zip(face + vertices + 1, normal + directions + 1, strict=True)
            lines.append("f " + " ".join(f"{v}//{n}" for v, n in pairs))
        vertices, directions = vertices + len(points), directions + len(unique)
    return "\n".join(lines) + "\n"


def files(meshes: dict[str, dict[str, Solid]], script: str) -> dict[str, str]:
    """Text of the OBJ and MTL file of each of ``meshes``, given as solids by material."""
    note = f"# Written by scenes/{script}\n"
    written = {}
    for name, parts in meshes.items():
        written[f"{name}.obj"] = f"{note}mtllib {name}.mtl\n{obj(parts)}"
        written[f"{name}.mtl"] = note + "".join(f"newmtl {material}\n{MATERIALS[material]}" for material in parts)
    return written
