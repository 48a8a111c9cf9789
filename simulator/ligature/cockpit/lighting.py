"""The lights of a scene in 3D, so that the page shows the colours of the camera's picture. World axes, metres, radians.

A browser draws in linear light and tone maps what it draws (three.js, ACES); the figures here make a lit surface as
bright there as the renderer makes it. `python -m tests.bench.looks` compares the two.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from viser import ViserServer

from ligature.model.poses import pose7_matrices
from ligature.model.scene import Light, Scene

BRIGHT = 2.5
"""Intensity of a light at attenuation 1: 0.8, which the renderer's tone mapping begins with, times pi."""

SKY, GROUND, AROUND = (191, 190, 192), (112, 98, 95), 2.5
"""What matt surfaces gather from above and below, as in the renderer's `physical.glsl`: colours, and intensity."""

MIRRORED = 0.1
"""Intensity of what metal mirrors, which is a picture of viser's."""

WIDEST = np.radians(75.0)
"""Half opening of a light's cone at most: the shadow map of a wider one has no texels left for what is before it."""

SOFT = 0.3
"""Share of the cone at its edge over which light fades."""

MOVED = 1e-5


class LightStage:
    """All lights of a scene on the page; a scene without has viser's, from above."""

    def __init__(self, server: ViserServer, scene: Scene, distance: float) -> None:
        """``distance`` is that of the work, in metres, for which lights that attenuate get their intensity."""
        server.scene.configure_default_lights(enabled=not scene.lights, cast_shadow=False)
        server.scene.configure_environment_map("warehouse", environment_intensity=MIRRORED)
        server.scene.add_light_hemisphere("/lights/around", sky_color=SKY, ground_color=GROUND, intensity=AROUND)
        self._lights = [
            server.scene.add_light_spot(
                f"/lights/{light.index}", intensity=_intensity(light, distance), angle=min(light.cutoff, WIDEST),
                penumbra=SOFT, decay=0.0, cast_shadow=light.shadow_quality > 0, direction=(1.0, 0.0, 0.0),
            )
            for light in scene.lights
        ]  # fmt: skip
        self._shown = np.full((len(self._lights), 7), np.inf)

    def update(self, state: NDArray[np.void]) -> int:
        """Move the lights that moved in ``state`` (1,); returns how many."""
        poses = state["light_world"][0]
        moved = np.flatnonzero(np.abs(poses - self._shown).max(axis=1, initial=0.0) > MOVED)
        for row in moved:
            x, y, z, qx, qy, qz, qw = poses[row].tolist()
            self._lights[row].position, self._lights[row].wxyz = (x, y, z), (qw, qx, qy, qz)
            self._shown[row] = poses[row]
        return len(moved)


def distance_of_work(scene: Scene, state: NDArray[np.void], work: NDArray[np.float64]) -> float:
    """Metres from the first light to ``work`` (3,), 1 without lights."""
    if not scene.lights:
        return 1.0
    place = pose7_matrices(state["light_world"][0])[0, :3, 3]
    return float(np.linalg.norm(work - place))


def _intensity(light: Light, distance: float) -> float:
    constant, linear, quadratic = light.attenuation
    return BRIGHT / max(constant + linear * distance + quadratic * distance**2, 1e-3)
