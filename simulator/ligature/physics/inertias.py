"""Moments of inertia as Bullet can bear them. Kilograms, kg m²."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.adf import Diagnostic, Severity
from ligature.model.scene import Body, Scene

Array = NDArray[np.float64]

LEAST_INERTIA = 1e-15
"""Smallest principal moment of a moving body, in kg m²: that of a steel needle of 0.03 mm wire, 1 mm long.

Bullet (`btMultiBody::solveImatrix` and its joints) lets nothing turn whose moment is below the rounding of 1,
2.2e-16: torques on it are lost. Measured by `tests/physics/test_inertias.py`.
"""

LEAST_MASS = 1e-15
"""Smallest mass of a moving body, in kg. Bullet lets nothing fall below the rounding of 1, 2.2e-16, either."""

MOST_RATIO = 1e7
"""Largest principal moment of a moving body, over its smallest: of a wire of 1 m and 0.6 mm that is 2e6.

Measured with the mechanism of `tests/physics/test_inertias.py`: from 1e9 on trees diverge in Bullet, with 1e8 none of
40 did.
"""

MOST_EXCESS = 10.0
"""Largest principal moment over the sum of the other two, which no body exceeds: of a disc it is 1.

With more, the gyroscopic moment, (I₁ - I₂) ω₁ ω₂, changes ω₃ by more than ω₁ in a tick of 1 ms, at the 100 rad/s that
a link may reach.
"""

BALL = 0.01
"""Radius in metres of the ball whose moments a body gets that has none."""


def inertia_of(body: Body) -> Array:
    """Principal moments (3,) that Bullet can invert: its own, at least `LEAST_INERTIA`, or a ball's.

    None is more than `MOST_RATIO` times another, or `MOST_EXCESS` times the sum of the two others.
    """
    if body.mass <= 0.0:
        return np.zeros(3)
    ball = 0.4 * max(body.mass, 1e-6) * BALL**2
    moments = np.where(body.inertia > 0.0, np.maximum(body.inertia, LEAST_INERTIA), ball)
    moments = np.minimum(moments, MOST_RATIO * moments.min())
    return np.minimum(moments, MOST_EXCESS * (moments.sum() - moments.max()))


def findings(scene: Scene) -> list[Diagnostic]:
    """Moving bodies outside rods whose mass is too small to move, or whose moments are replaced.

    Moments that are too small or too different are a warning. A body without any, which has neither shape nor
    ``inertia``, is a detail: the simulator has to choose some.
    """
    found = []
    for body in scene.bodies:
        if 0.0 < body.mass < LEAST_MASS:
            message = f"body '{body.identity.key}' has a mass of {body.mass:g} kg, too little to move"
            hint = f"give at least {LEAST_MASS:g} kg, or 0 for a body that stands still"
            found.append(Diagnostic(Severity.WARNING, message, body.identity.mark, hint, "inertia"))
        used = inertia_of(body)
        if body.index in scene.rod_bodies or body.mass <= 0.0 or (used == body.inertia).all():
            continue
        none = not body.inertia.any()
        message = (
            f"the principal moments of body '{body.identity.key}' are {_listed(body.inertia)} kg m²; "
            f"{_listed(used)} kg m² are simulated"
        )
        if (body.inertia <= 0.0).any():
            hint = f"give 'inertia'; these are a ball's of {BALL * 100:g} cm radius"
        elif (used < body.inertia).sum() > 1:
            hint = f"moments above {MOST_RATIO:g} times the smallest cannot be simulated"
        elif (used < body.inertia).any():
            hint = f"no body has a moment above the sum of the others; at most {MOST_EXCESS:g} times that is simulated"
        else:
            hint = f"moments below {LEAST_INERTIA:g} kg m² cannot be simulated"
        severity = Severity.DEBUG if none else Severity.WARNING
        found.append(Diagnostic(severity, message, body.identity.mark, hint, "inertia"))
    return found


def _listed(moments: Array) -> str:
    return ", ".join(f"{moment:.3g}" for moment in moments)
