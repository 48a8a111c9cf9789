"""How browsers turn light into colours, and which surface looks there as the renderer shows it.

three.js maps tones by a fit of ACES (Hill 2017); the renderer lights surfaces without reflectance figures in displayed
colours, without any. Colours 0..1.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

Array = NDArray[np.float64]

EXPOSURE = 1.0 / 0.6
"""Of three.js, whose fit takes it for granted."""

INTO = np.array([[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]])
OUT = np.array([[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]])
"""From linear sRGB to the fit's colours, and back."""


def linear(shown: ArrayLike) -> Array:
    """Linear values of displayed ones (IEC 61966-2-1)."""
    c = np.clip(np.asarray(shown, dtype=float), 0.0, 1.0)
    return np.asarray(np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4))


def displayed(light: ArrayLike) -> Array:
    """Displayed values of linear ones."""
    c = np.clip(np.asarray(light, dtype=float), 0.0, 1.0)
    return np.asarray(np.where(c <= 0.0031308, 12.92 * c, 1.055 * c ** (1.0 / 2.4) - 0.055))


def mapped(light: ArrayLike) -> Array:
    """What a browser makes of light (..., 3), linear before and after."""
    v = EXPOSURE * np.asarray(light, dtype=float) @ INTO.T
    fit = (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.4329510) + 0.238081)
    return np.clip(fit @ OUT.T, 0.0, 1.0)


def rendered(light: ArrayLike) -> Array:
    """What the renderer shows of linear light (..., 3) where it maps tones (`physical.glsl`)."""
    c = 0.8 * np.asarray(light, dtype=float)
    return displayed(c * (2.51 * c + 0.03) / (c * (2.43 * c + 0.59) + 0.14))


def reflecting(shown: ArrayLike, light: float) -> Array:
    """The linear colour (3,), 0..1, of a matt surface that a browser shows as ``shown`` (3,) under ``light``."""
    wanted = np.clip(np.asarray(shown, dtype=float), 0.0, 1.0)
    begin = np.clip(linear(wanted), 0.01, 0.99)
    found = least_squares(lambda colour: displayed(mapped(colour * light)) - wanted, begin, bounds=(0.0, 1.0))
    return np.asarray(found.x)
