"""How a scene is to look beside what its files state: brighter or darker lights, tinted bodies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from ligature.model.shapes import Colour
from ligature.render.lights import LightSettings
from ligature.render.surface import Surface

Tint = tuple[float, float, float]


@dataclass(frozen=True)
class Look:
    """Changes of the looks of a scene.

    Attributes
    ----------
    brightness
        Factor of each light, in the order of the scene; lights beyond these stay as they are.
    tints
        Factors of red, green and blue by body: of its colours, and so of its textures. Bodies that share a mesh and a
        material are drawn in one call, with the tint of the first.
    """

    brightness: tuple[float, ...] = ()
    tints: Mapping[int, Tint] = field(default_factory=dict)


def brighter(settings: LightSettings, factor: float) -> LightSettings:
    """A light that is ``factor`` times as bright everywhere."""
    constant, linear, quadratic = settings.attenuation
    return replace(settings, attenuation=(constant / factor, linear / factor, quadratic / factor))


def tinted(surface: Surface, tint: Tint) -> Surface:
    """A surface whose colours are multiplied, and stay within 0 to 1."""
    colour: Colour = surface.colour

    def times(rgb: Tint) -> Tint:
        red, green, blue = (min(max(value * factor, 0.0), 1.0) for value, factor in zip(rgb, tint, strict=True))
        return red, green, blue

    return replace(surface, colour=replace(colour, diffuse=times(colour.diffuse), ambient=times(colour.ambient)))
