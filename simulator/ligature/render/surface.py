"""What a drawn surface is made of: the colours, textures and reflectance that the shaders are fed with.

Colours are 0..1 as displayed (sRGB); roughness and metallic 0..1 as in the metallic-roughness model.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from ligature.mesh import Material
from ligature.model.shapes import Colour

METAL_SPECULAR, METAL_SHININESS, METAL_LIGHTNESS, METAL_CHROMA = 0.4, 250.0, 0.55, 0.03
"""An untextured grey at least this bright, with at most this chroma and a highlight at least this strong and sharp,
is bare metal: MTL has no word for metal, and steel of needles and instruments is exported so."""

WET_SPECULAR, WET_SHININESS, WET_REDNESS = 0.4, 250.0, 0.1
"""A reddish colour with a highlight at least this strong and sharp is tissue under a film of liquid."""


@dataclass(frozen=True)
class Physical:
    """Metallic-roughness reflectance with a clear coat (Burley 2012); ``coat`` 1 is a full film of liquid."""

    metallic: float = 0.0
    roughness: float = 0.5
    coat: float = 0.0
    coat_roughness: float = 0.1
    metallic_map: Path | None = None
    roughness_map: Path | None = None


@dataclass(frozen=True)
class Surface:
    """Colours, textures and, when the material asks for it, physically based reflectance.

    ``occlusion_map`` dims ambient light; ``sphere_map`` is for shaders of scene files.
    """

    colour: Colour = Colour()
    texture: Path | None = None
    normal_map: Path | None = None
    physical: Physical | None = None
    occlusion_map: Path | None = None
    sphere_map: Path | None = None

    @property
    def opaque(self) -> bool:
        """Whether nothing behind shines through."""
        return self.colour.alpha >= 1.0

    @cached_property
    def defines(self) -> frozenset[str]:
        """Names of the shader features that it needs."""
        look = self.physical
        present = {
            "TEXTURED": self.texture,
            "NORMAL_MAP": self.normal_map,
            "OCCLUSION_MAP": self.occlusion_map,
            "PHYSICAL": look,
            "METALLIC_MAP": look and look.metallic_map,
            "ROUGHNESS_MAP": look and look.roughness_map,
            "COAT": look and (look.coat or None),
            "CLEAR": None if self.opaque else self.colour,
        }
        return frozenset(name for name, value in present.items() if value is not None)


def surface_of(override: Colour | None, material: Material | None) -> Surface:
    """The surface of a mesh part: ADF colours replace the material's, textures stay."""
    if override is not None:
        own = material or Material("")
        look = evident(override, own.texture is not None)
        return Surface(override, own.texture, own.normal_map, look, own.occlusion_map, own.sphere_map)
    if material is None:
        return Surface()
    colour = Colour(
        diffuse=material.diffuse,
        ambient=material.ambient,
        specular=material.specular,
        emission=material.emission,
        shininess=int(material.shininess),
        alpha=material.alpha,
    )
    look = _asked(material) or evident(colour, material.texture is not None)
    return Surface(colour, material.texture, material.normal_map, look, material.occlusion_map, material.sphere_map)


def _asked(material: Material) -> Physical | None:
    """Reflectance that a mesh file's material asks for."""
    maps = material.metallic_map, material.roughness_map
    if all(value is None for value in (material.roughness, material.metallic, material.coat, *maps)):
        return None
    return Physical(
        min(_given(material.metallic, 1.0 if maps[0] else 0.0), 1.0),
        min(_given(material.roughness, 1.0 if maps[1] else 0.5), 1.0),
        min(material.coat or 0.0, 1.0),
        min(material.coat_roughness, 1.0),
        *maps,
    )


def evident(colour: Colour, textured: bool) -> Physical | None:
    """Reflectance of a colour that is evidently bare metal or wet tissue, for which neither ADF nor MTL has a word."""
    red, green, blue = colour.diffuse
    chroma = max(colour.diffuse) - min(colour.diffuse)
    strong, sharp = min(colour.specular), colour.shininess
    if not textured and chroma <= METAL_CHROMA and red >= METAL_LIGHTNESS:
        if strong >= METAL_SPECULAR and sharp >= METAL_SHININESS:
            return Physical(metallic=1.0, roughness=roughness_of(sharp))
    elif red - max(green, blue) >= WET_REDNESS and strong >= WET_SPECULAR and sharp >= WET_SHININESS:
        return Physical(roughness=0.6, coat=1.0, coat_roughness=0.15)
    return None


def roughness_of(shininess: float) -> float:
    """Roughness of the microfacet lobe that is as wide as a Blinn-Phong lobe (Karis 2013): alpha^2 = 2 / (n + 2)."""
    return float(np.clip((2.0 / (shininess + 2.0)) ** 0.25, 0.05, 1.0))


def _given(value: float | None, default: float) -> float:
    return default if value is None else value
