"""The looks of bodies as glTF: what the renderer would draw of a body, packed once for browsers. Metres."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh
from numpy.typing import NDArray
from PIL import Image
from trimesh.visual.material import PBRMaterial

from ligature.model.scene import Scene
from ligature.render.picture_files import read_picture
from ligature.render.surface import Physical, Surface, roughness_of
from ligature.render.visuals import Piece, VisualLoader

Array = NDArray[np.float64]

MOST_FACES = 30_000
"""Triangles of a piece above which its low-resolution mesh is shown, where it has one."""

LARGEST_PICTURE = 1024
"""Pixels of a texture's longer side."""

GROUND = 20.0
"""Metres from end to end beyond which a piece is an endless plane, which a page shows by its grid alone."""

METAL_SHEEN = 0.6
"""Metallic part of bare metal in a browser: the rest stays diffuse, so that it is seen against any surroundings."""


def body_looks(scene: Scene) -> dict[int, bytes]:
    """Binary glTF of every drawn rigid body and ghost by owner: bodies, then ghosts, counted through."""
    loader = VisualLoader()
    owners: dict[int, list[Piece]] = {}
    soft = {tissue.body for tissue in scene.tissues}
    for piece in loader.of_scene(scene):
        if piece.owner not in soft and np.ptp(piece.triangles.positions, axis=0).max() < GROUND:
            owners.setdefault(piece.owner, []).append(piece)
    materials: dict[Surface, PBRMaterial] = {}
    return {owner: _packed(_chosen(pieces), materials) for owner, pieces in owners.items()}


def thread_colour(scene: Scene, body: int) -> tuple[int, int, int]:
    """Colour of a thread, from its first element ``body``, 0..255."""
    from ligature.render.surface import surface_of

    visual = scene.bodies[body].visual
    r, g, b = surface_of(visual.colour, VisualLoader().material(visual)).colour.diffuse
    return round(255 * r), round(255 * g), round(255 * b)


def mean_colour(surface: Surface) -> tuple[int, int, int]:
    """Colour of a surface without its texture's details, 0..255."""
    picture, colour = _picture(surface), np.asarray(surface.colour.diffuse)
    if picture is not None:
        colour = colour * np.asarray(picture, dtype=float).mean(axis=(0, 1)) / 255.0
    r, g, b = np.round(255.0 * np.clip(colour, 0.0, 1.0)).astype(int).tolist()
    return r, g, b


def _chosen(pieces: Sequence[Piece]) -> list[Piece]:
    """The fine pieces, or the coarse ones where the fine have too many triangles."""
    fine = [piece for piece in pieces if piece.coarse is not True]
    coarse = [piece for piece in pieces if piece.coarse is True]
    return coarse if coarse and sum(len(p.triangles.faces) for p in fine) > MOST_FACES else fine


def _packed(pieces: Sequence[Piece], materials: dict[Surface, PBRMaterial]) -> bytes:
    shown = trimesh.Scene()
    for piece in pieces:
        if piece.surface not in materials:
            materials[piece.surface] = _material(piece.surface)
        triangles = piece.triangles
        visual = trimesh.visual.TextureVisuals(uv=triangles.uvs, material=materials[piece.surface])
        mesh = trimesh.Trimesh(
            triangles.positions, triangles.faces, vertex_normals=triangles.normals, visual=visual, process=False
        )
        shown.add_geometry(mesh, transform=piece.T_owner_piece)
    data: bytes = trimesh.exchange.gltf.export_glb(shown, include_normals=True)
    return data


def _material(surface: Surface) -> PBRMaterial:
    look = surface.physical or Physical(roughness=max(roughness_of(surface.colour.shininess), 0.35))
    colour = np.array([*_linear(surface.colour.diffuse), surface.colour.alpha])
    return PBRMaterial(
        baseColorFactor=np.round(255 * np.clip(colour, 0.0, 1.0)).astype(np.uint8),
        metallicFactor=METAL_SHEEN * look.metallic,
        roughnessFactor=look.roughness,
        emissiveFactor=_linear(surface.colour.emission),
        baseColorTexture=_picture(surface),
        alphaMode=None if surface.opaque else "BLEND",
        doubleSided=True,
    )


def _linear(colour: tuple[float, float, float]) -> list[float]:
    """Linear values of an sRGB colour, which glTF wants (IEC 61966-2-1)."""
    c = np.clip(np.asarray(colour, dtype=float), 0.0, 1.0)
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4).tolist()  # type: ignore[no-any-return]


def _picture(surface: Surface) -> Image.Image | None:
    """The texture in a size for browsers; None for none, or one that cannot be read."""
    if surface.texture is None:
        return None
    try:
        picture = read_picture(surface.texture).convert("RGB")
    except (OSError, ValueError):
        return None
    picture.thumbnail((LARGEST_PICTURE, LARGEST_PICTURE))
    return picture
