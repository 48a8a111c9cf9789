"""What tissue is made of: elasticity, and how it resists needles and threads; materials by name."""

from __future__ import annotations

from dataclasses import dataclass, fields

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


MATERIALS = {
    "silicone pad": TissueMaterial(69e3, density=1070.0, strength=6655.0),
    "skin": TissueMaterial(101e3, density=1100.0, puncture_force=0.8, cutting_force=0.2, exit_force=0.3),
    "fat": TissueMaterial(3.25e3, density=950.0, puncture_force=0.1, cutting_force=0.03, exit_force=0.05, friction=3.0,
                          strength=200.0),
    "stomach": TissueMaterial(1.91e3, density=1058.0, puncture_force=0.3, cutting_force=0.08, exit_force=0.1,
                              friction=5.0, strength=600.0),
    "liver": TissueMaterial(5.94e3, density=1060.0, puncture_force=0.15, cutting_force=0.065, exit_force=0.05,
                            friction=5.0, strength=300.0),
}  # fmt: skip
"""Materials by name; Poisson's ratio is 0.45 in all of them: at 0.49 cells tremble under loads on few nodes.

Young's moduli: silicone pad, the stress at 100 % strain of Ecoflex 00-30 (Smooth-On, technical bulletin), and its
strength the tear strength there, 38 pounds an inch; skin, Liang and Boppart 2010; fat, Samani and others 2007; stomach
and liver, Lim and others 2009. Densities of stomach and liver: Duck 2013; of the others, ICRP 110. The cutting force of
liver is its toughness of 164 J/m² (Gokgol and others 2012) times a needle of 0.4 mm. All other forces are chosen:
within the 0.2 to 0.6 N at which a suture needle punctures hydrogel for silicone, and lower or higher in the order of
the materials' toughness. They are starting points, no measurements.
"""

KEYS = {
    "youngs": "youngs modulus", "poisson": "poisson ratio", "density": "density", "damping": "damping time",
    "puncture_force": "puncture force", "exit_force": "exit force", "cutting_force": "cutting force",
    "friction": "friction", "strength": "strength", "least_angle": "least angle",
}  # fmt: skip
"""Key of the format by the field of `TissueMaterial`."""

assert list(KEYS) == [field.name for field in fields(TissueMaterial)]
