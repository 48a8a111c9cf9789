"""The looks of bodies as glTF: what the renderer would draw of a body, packed once for browsers. Metres."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh
from numpy.typing import NDArray
from PIL import Image
from trimesh.visual.material import PBRMaterial

from ligature.cockpit.tone import displayed, linear, reflecting, rendered
from ligature.model.pictures import read_picture
from ligature.model.scene import Scene
from ligature.render.surface import Physical, Surface, roughness_of
from ligature.render.visuals import Piece, VisualLoader

Array = NDArray[np.float64]

MOST_FACES = 30_000
"""Triangles of a piece above which its low-resolution mesh is shown, where it has one."""

LARGEST_PICTURE = 1024
"""Pixels of a texture's longer side."""

GROUND = 20.0
"""Metres from end to end beyond which a piece is an endless plane, which a page shows by its grid alone."""

FACING, AMBIENT, GATHERED = 0.85, 0.35, 0.5
"""How a surface stands to the light for which its colours are matched, and the renderer's light from everywhere: for
surfaces without reflectance figures, and what those with them gather."""

GLOSS = 0.018
"""Light that a dielectric surface mirrors beside that, whatever its colour."""

LIT = 1.05
"""Light on such a surface on the page: of the lamp and of what is around."""

METAL_SHEEN = 0.6
"""Metallic part of bare metal in a browser: the rest stays diffuse, so that it is seen against any surroundings."""


def body_looks(scene: Scene) -> dict[int, bytes]:
    """Binary glTF of every drawn rigid body and ghost by owner: bodies, then ghosts, counted through."""
    loader = VisualLoader(scene.roots)
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
    return mean_colour(surface_of(visual.colour, VisualLoader(scene.roots).material(visual)))


def mean_colour(surface: Surface) -> tuple[int, int, int]:
    """Colour of a surface without its texture's details, 0..255."""
    r, g, b = np.round(255.0 * displayed(_base(surface) * linear(_texel(surface)))).astype(int).tolist()
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
    base, picture = _base(surface), _picture(surface)
    if picture is not None and base.max() > 1.0:  # glTF's factors end at 1
        picture = Image.fromarray(
            np.round(255.0 * displayed(linear(np.asarray(picture) / 255.0) * base)).astype(np.uint8)
        )
        base = np.ones(3)
    colour = np.array([*base, surface.colour.alpha])
    return PBRMaterial(
        baseColorFactor=np.round(255 * np.clip(colour, 0.0, 1.0)).astype(np.uint8),
        metallicFactor=METAL_SHEEN * look.metallic,
        roughnessFactor=look.roughness,
        emissiveFactor=linear(surface.colour.emission).tolist(),
        baseColorTexture=picture,
        alphaMode=None if surface.opaque else "BLEND",
        doubleSided=True,
    )


def _base(surface: Surface) -> Array:
    """Linear colour (3,) by which a browser is to multiply the texture; above 1 where the texture is too dark."""
    diffuse, texel = np.asarray(surface.colour.diffuse), _texel(surface)
    if surface.physical is not None and surface.physical.metallic > 0.5:
        return linear(diffuse)
    if surface.physical is not None:
        lit = rendered(linear(diffuse * texel) * (FACING + GATHERED) + GLOSS)
    else:
        lit = texel * (FACING * diffuse + AMBIENT * np.asarray(surface.colour.ambient))
    return reflecting(np.clip(lit, 0.0, 1.0), LIT) / np.maximum(linear(texel), 1e-3)


def _texel(surface: Surface) -> Array:
    """Mean displayed colour (3,) of the texture, white without one."""
    picture = _picture(surface)
    return np.ones(3) if picture is None else np.asarray(picture, dtype=float).mean(axis=(0, 1)) / 255.0


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
