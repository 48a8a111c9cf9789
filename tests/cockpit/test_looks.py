"""The 3D view has the colours of the camera's picture."""

from __future__ import annotations

import ligature
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature.cockpit.address import Address
from ligature.cockpit.gate import Gate
from ligature.cockpit.page import serve
from ligature.cockpit.stage import Stage, endoscope
from ligature.cockpit.tone import displayed, linear, mapped, reflecting, rendered

from tests.bench.looks import compare
from tests.cockpit.conftest import Person

channels = st.floats(0.05, 0.8)


@pytest.mark.timeout(600)
@pytest.mark.parametrize("name", [pytest.param("suturing_small", marks=pytest.mark.slow), "suturing"])
def test_the_3d_view_is_as_bright_and_coloured_as_the_picture(person: Person, name: str) -> None:
    pair = compare(name, person)
    assert pair.difference < 0.1, pair.means
    small = [
        np.asarray(picture).reshape(6, 40, 8, 40, 3).mean(axis=(1, 3)).ravel() for picture in (pair.camera, pair.page)
    ]
    assert np.corrcoef(*small)[0, 1] > 0.9, "and it shows the same"


@given(st.tuples(channels, channels, channels), st.floats(0.8, 1.3))
def test_a_surface_is_given_the_colour_that_a_browser_shows_as_wanted(colour: tuple[float, ...], light: float) -> None:
    wanted = displayed(mapped(np.array(colour) * light))  # what a browser can show
    found = reflecting(wanted, light)
    assert ((found >= 0.0) & (found <= 1.0)).all()
    assert displayed(mapped(found * light)) == pytest.approx(wanted, abs=0.01)


@given(st.floats(0.0, 1.0))
def test_linear_and_displayed_are_inverse(value: float) -> None:
    assert displayed(linear(value)) == pytest.approx(value, abs=1e-6)


def test_more_light_is_brighter() -> None:
    light = np.linspace(0.0, 3.0, 100)[:, None] * np.ones(3)
    for curve in (mapped, rendered):
        assert np.all(np.diff(curve(light)[:, 0]) >= 0.0)


def test_what_carries_cameras_is_the_endoscope_and_can_be_hidden() -> None:
    scene = ligature.load("suturing")
    assert [scene.bodies[body].identity.name for body in endoscope(scene)] == ["CameraFrame"]
    server = serve(Address("127.0.0.1", 0), Gate(Address("127.0.0.1", 0), ""))
    try:
        stage = Stage(server, scene)
        (tube,) = endoscope(scene)
        for shown in (False, True):
            stage.show_endoscope(shown)
            assert stage._nodes[tube].visible is shown
            assert all(node.visible for owner, node in stage._nodes.items() if owner != tube)
    finally:
        server.stop()
