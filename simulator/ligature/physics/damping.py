"""Damping of bodies that move alone, exact: Bullet's of multibodies has a quadratic part besides the linear one."""

from __future__ import annotations

import numpy as np

from ligature.physics.articulation import is_alone
from ligature.physics.engine import Engine


class Damping:
    """The damping of lone bodies of an engine in a tick: (1 − damping)^dt (Bullet's `btRigidBody`).

    Attributes
    ----------
    trees, factors
        (n,) trees that are damped, and (n, 2) what their linear and angular velocities are multiplied by.
    """

    def __init__(self, engine: Engine) -> None:
        bodies, dt = engine.scene.bodies, engine.dt
        alone = [k for k, tree in enumerate(engine.trees) if is_alone(tree, bodies)]
        roots = [bodies[engine.trees[k].root] for k in alone]
        factors = np.array([((1 - b.linear_damping) ** dt, (1 - b.angular_damping) ** dt) for b in roots])
        factors = factors.reshape(-1, 2)
        damped = (factors < 1.0).any(axis=1)
        self.trees, self.factors = np.array(alone, dtype=np.int64)[damped], factors[damped]
        self._places = [engine.place_of[engine.trees[k].root] for k in self.trees]

    def step(self) -> None:
        """Slow them down by a tick's part, where compiled code cannot."""
        for place, (linear, angular) in zip(self._places, self.factors.tolist(), strict=True):
            place.slow_down(linear, angular)
