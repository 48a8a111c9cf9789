"""The 3D view has the colours of the camera's picture."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature.cockpit.tone import displayed, linear, mapped, reflecting, rendered

from tests.bench.looks import compare
from tests.cockpit.conftest import Person

channels = st.floats(0.05, 0.8)


@pytest.mark.timeout(600)
@pytest.mark.parametrize("name", ["suturing_small", "suturing"])
def test_the_3d_view_is_as_bright_and_coloured_as_the_picture(person: Person, name: str) -> None:
    pair = compare(name, person)
    assert pair.difference < 0.1, pair.means
    small = [
        np.asarray(picture).reshape(6, 40, 8, 40, 3).mean(axis=(1, 3)).ravel() for picture in (pair.camera, pair.page)
    ]
    assert np.corrcoef(*small)[0, 1] > 0.9, "and it shows the same"


@given(st.tuples(channels, channels, channels), st.floats(0.8, 1.3))
def test_a_surface_is_given_the_colour_that_a_browser_shows_as_wanted(wanted: tuple[float, ...], light: float) -> None:
    found = reflecting(wanted, light)
    assert ((found >= 0.0) & (found <= 1.0)).all()
    if (found > 2e-3).all() and (found < 0.99).all():  # what a browser can show at all
        assert displayed(mapped(found * light)) == pytest.approx(wanted, abs=0.02)


@given(st.floats(0.0, 1.0))
def test_linear_and_displayed_are_inverse(value: float) -> None:
    assert displayed(linear(value)) == pytest.approx(value, abs=1e-6)


def test_more_light_is_brighter() -> None:
    light = np.linspace(0.0, 3.0, 100)[:, None] * np.ones(3)
    for curve in (mapped, rendered):
        assert np.all(np.diff(curve(light)[:, 0]) >= 0.0)
