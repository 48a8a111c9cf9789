"""What tissue is made of: elasticity, and how it resists needles and threads."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class TissueMaterial:
    """An isotropic material that a needle can puncture.

    Parameters
    ----------
    youngs
        Young's modulus, Pa.
    poisson
        Poisson's ratio, 0 … 0.499.
    density
        kg/m³.
    damping
        Time in seconds by which viscous stress lags elastic stress: stress = K (ε + damping ε̇).
    puncture_force
        Force of a needle's tip on the surface at which it enters, N.
    exit_force
        Force at which the tip leaves through the far surface from inside, over that of cutting, N.
    cutting_force
        Force at the tip while it cuts: toughness (J/m²) times the width of the needle (m), N.
    friction
        Friction along a needle or thread inside, for each metre of it, N/m.
    strength
        Load across a needle or thread inside at which the tissue tears, for each metre of it, N/m.
    least_angle
        Angle between tip and surface below which the tip slides over the surface, rad.
    """

    youngs: float
    poisson: float = 0.45
    density: float = 1000.0
    damping: float = 8e-3
    puncture_force: float = 0.5
    exit_force: float = 0.13
    cutting_force: float = 0.1
    friction: float = 8.0
    strength: float = 1000.0
    least_angle: float = float(np.deg2rad(15.0))

    def __post_init__(self) -> None:
        if not 0.0 <= self.poisson <= 0.499:
            raise ValueError(f"Poisson's ratio is {self.poisson}; it must be 0 … 0.499")
        for name in ("youngs", "density"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be above 0")
        for name in ("damping", "puncture_force", "exit_force", "cutting_force", "friction", "strength"):
            if not getattr(self, name) >= 0.0:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be 0 or more")
        if not 0.0 <= self.least_angle < np.pi / 2:
            raise ValueError(f"least_angle is {self.least_angle} rad; it must be 0 … π/2")

    @property
    def shear(self) -> float:
        """Shear modulus, Pa."""
        return self.youngs / (2.0 * (1.0 + self.poisson))
