"""Threads drawn over sharp edges, where contacts sink by more than a millimetre, stay on them. Metres, newtons, seconds."""

from __future__ import annotations

import numpy as np
import pytest
from ligature.model.shapes import Box, Hull, Shape
from ligature.suture.exclusions import Exclusions

from tests.suture.conftest import Bench, body, damped, from_material, line

TOP = 0.01
"""Height of the edges."""


class WithExclusions(Bench):
    """A bench whose rods leave out what they were put into, as those of a simulation do."""

    def laid(self, elements: int, thickness: float) -> None:
        """Lay a thread of 80 mm across the body, just over it, and hold its ends."""
        shape = line(elements, 0.08, start=(-0.039, 0.0, TOP + thickness))
        self.rod = self.add(damped(from_material(shape, thickness, 1e8, 1100.0), 0.999))
        self.exclusions = Exclusions(self.rod, self.rod.shapes)
        self.ends = (0, elements - 1)
        for end in self.ends:
            self.rod.hold_element(end)

    def drawn(self, tension: float, saw: float) -> float:
        """Lower the ends until the thread bears so much, saw to and fro, and return what it bears in the end."""
        nodes, first, middle = self.rod.nodes, self.rod.first, slice(self.ends[1] // 4, 3 * self.ends[1] // 4)
        for tick in range(1500):
            lowered = 0.05 if tick < 1000 and self.rod.tension[middle].max() < tension else 0.0
            for end, sign in zip(self.ends, (-1.0, 1.0), strict=True):
                aside = -2.0 * (self.rod.positions[end, 0] - 0.011 * sign) if tick < 1000 else 0.0
                nodes.v[first + end] = [aside, 0.0, sign * saw * np.cos(0.02 * tick) - lowered]
                nodes.w[first + end] = 0.0
            self.exclusions.step()
            self.step()
        return float(self.rod.tension[middle].max())


WEDGE = Hull(np.array([[x, y, z] for x, z in ((-5e-3, -TOP), (5e-3, -TOP), (0.0, TOP)) for y in (-0.03, 0.03)]))
PLATE = Box(np.array([4e-3, 0.06, 2 * TOP]))


@pytest.mark.parametrize("saw", [0.0, 0.05])
@pytest.mark.parametrize(
    ("shape", "elements", "thickness", "tension"),
    [(WEDGE, 80, 2e-4, 1.0), (WEDGE, 40, 2e-4, 0.1), (PLATE, 20, 5e-4, 1.0), (PLATE, 40, 2e-4, 0.3)],
)
def test_a_thread_drawn_over_an_edge_stays_on_it(
    shape: Shape, elements: int, thickness: float, tension: float, saw: float
) -> None:
    bench = WithExclusions([body(0, shape, friction=0.3)])
    bench.laid(elements, thickness)
    # One that had come through the edge would bear nothing. What sawing leaves varies: 0.4 to 3.5 of 0.07 to 0.2 N.
    assert bench.drawn(tension, saw) > (0.3 if saw else 0.5) * tension
    places = bench.rod.positions
    assert places[np.abs(places[:, 0]).argmin(), 2] > TOP - 6e-3
