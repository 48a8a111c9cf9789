"""Visible sensors and actuators are drawn in the window, as large as the file states."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature.model.scene import Scene
from ligature.model.state import new_state
from ligature.render import overlay

MODEL = """
bodies: [BODY base]
sensors: [ray, touch]
actuators: [hold]
BODY base: {{name: base, mass: 0, location: {{position: {{x: 0.5, y: 0, z: 0}}}}}}
ray:
  {{name: ray, type: Proximity, parent: BODY base, range: 0.2, visible: {ray}, visible size: 0.01,
   array: [{{offset: {{x: 0, y: 0, z: 0.1}}, direction: {{x: 1, y: 0, z: 0}}}}]}}
touch: {{name: touch, type: Contact, parent: BODY base, visible: {touch}, visible size: 4, process contact details: {details}}}
hold: {{name: hold, type: Constraint, parent: BODY base, visible: {hold}, visible size: 0.03}}
"""


def scene_of(folder: Path, ray: bool = False, touch: bool = False, hold: bool = False, details: bool = True) -> Scene:
    file = folder / "model.yaml"
    file.write_text(MODEL.format(ray=ray, touch=touch, hold=hold, details=details))
    return ligature.load(file)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("senses")


@given(flags=st.tuples(st.booleans(), st.booleans(), st.booleans(), st.booleans()))
def test_what_is_visible_is_drawn_and_nothing_else(folder: Path, flags: tuple[bool, bool, bool, bool]) -> None:
    ray, touch, hold, details = flags
    scene = scene_of(folder, ray, touch, hold, details)
    state = new_state(scene)
    state["body_pose"][0, 0] = (0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    state["contact_count"], state["contact_sensor"][0, 0] = 1, 1
    state["contact_point"][0, 0] = (0.1, 0.2, 0.3)
    drawn = overlay.senses(scene, state, 0.001)
    assert len(drawn) == 4 * ray + 3 * (touch and details) + 3 * hold
    lengths = sorted({round(float(np.linalg.norm(b - a)), 6) for a, b, _ in drawn})
    wanted = {0.2, 0.02} if ray else set()
    wanted |= {0.008} if touch and details else set()
    wanted |= {0.06} if hold else set()
    assert lengths == sorted(wanted)


def test_a_ray_that_hits_ends_there_and_is_red(folder: Path) -> None:
    scene = scene_of(folder, ray=True, hold=True)
    state = new_state(scene)
    state["body_pose"][0, 0] = (0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    (start, end, colour), *_ = overlay.senses(scene, state, 0.001)
    assert start == pytest.approx([0.5, 0.0, 0.1]) and end == pytest.approx([0.7, 0.0, 0.1])
    assert colour == overlay.GREEN
    state["ray_body"][0, 0], state["ray_point"][0, 0] = 0, (0.6, 0.0, 0.1)
    state["actuator_active"][0, 0] = True
    drawn = overlay.senses(scene, state, 0.001)
    assert drawn[0][1] == pytest.approx([0.6, 0.0, 0.1]) and drawn[0][2] == overlay.RED
    assert drawn[-1][2] == overlay.GREEN
