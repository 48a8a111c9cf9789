"""Scenes with bodies of tissue, a needle with or without a thread, and what presses the tissue."""

from __future__ import annotations

from types import SimpleNamespace

import ligature
import numpy as np
import pytest
from ligature import Simulation
from scipy.spatial.transform import Rotation

RADIUS, WIRE = 0.01, 0.00025


def pad(extra="", mass="0.0", size=(0.06, 0.04, 0.01), at=(0.0, 0.0, 0.1), cell=0.005, material="silicone pad"):
    """A pad whose top is at the height ``at[2] + size[2] / 2``."""
    return f"""
BODY Pad:
  name: Pad
  mass: {mass}
  shape: BOX
  geometry: {{x: {size[0]}, y: {size[1]}, z: {size[2]}}}
  location: {{position: {{x: {at[0]}, y: {at[1]}, z: {at[2]}}}, orientation: {{r: 0, p: 0, y: 0}}}}
  ligature tissue:
    material: {material}
    cell size: {cell}
{extra}"""


def needle(mass=0.0005):
    """A half circle in its xz plane, whose tip is at (-RADIUS, 0, 0)."""
    parts = []
    for k in range(10):
        middle, length = np.pi * (k + 0.5) / 10, 2 * RADIUS * np.sin(np.pi / 20) + 2 * WIRE
        parts.append(
            f"    - {{shape: CAPSULE, geometry: {{radius: {WIRE}, height: {length}, axis: Z}}, offset: {{position: "
            f"{{x: {RADIUS * np.cos(middle)}, y: 0, z: {RADIUS * np.sin(middle)}}}, orientation: "
            f"{{r: 0, p: {-middle}, y: 0}}}}}}"
        )
    return (
        f"\nBODY Needle:\n  name: Needle\n  mass: {mass}\n  compound collision shape:\n"
        + "\n".join(parts)
        + "\n  location: {position: {x: 0, y: 0, z: 0.2}, orientation: {r: 0, p: 0, y: 0}}\n"
    )


THREAD = f"""
SUTURE Thread:
  name: Thread
  length: 0.1
  USP size: 2-0
  elements: 50
  parent: BODY Needle
  location: {{position: {{x: {RADIUS}, y: 0, z: 0}}, orientation: {{r: 3.14159265, p: 0, y: 0}}}}
"""


def body(name, shape, at, mass, friction=0.5):
    """A rigid body without a visual."""
    return f"""
BODY {name}:
  name: {name}
  mass: {mass}
  collision {shape.replace(", geometry:", chr(10) + "  collision geometry:")}
  friction: {{static: {friction}, rolling: 0.01}}
  location: {{position: {{x: {at[0]}, y: {at[1]}, z: {at[2]}}}, orientation: {{r: 0, p: 0, y: 0}}}}
"""


class Bite:
    """A needle that a command turns about the centre of its arc through the pad's top at ``top``."""

    def __init__(self, simulation, top=0.105, depth=0.004, speed=0.04, yaw=0.0):
        self.simulation = simulation
        self.needle = simulation.bodies["BODY Needle"]
        self.arc = simulation.scene.needles[0].arc
        self.piece = simulation.tissues.pieces[0]
        centre = np.array([0.0, 0.0, top + RADIUS - depth])
        for angle in np.linspace(0.0, 2.0 * np.pi, 1441):
            turn = Rotation.from_euler("z", yaw) * Rotation.from_euler("y", angle)
            tip, ahead = turn.apply(self.arc.point(0.0)), turn.apply(self.arc.point(0.0) - self.arc.point(1e-4))
            if abs((centre + tip)[2] - top - 5e-4) < 1e-4 and ahead[2] < 0.0:
                break
        self.needle.set_pose([*centre, *turn.as_quat()])
        self.axis = np.cross(tip, ahead)
        self.axis /= np.linalg.norm(self.axis)
        self.turn(speed)

    def turn(self, speed):
        self.needle.command_twist([0.0, 0.0, 0.0, *(speed / RADIUS * self.axis)])

    @property
    def inside(self):
        return self.piece.piercers[0].inside


def load(folder, *blocks):
    """The scene of body and suture blocks."""
    text = "".join(blocks)
    bodies = [line[:-1] for line in text.splitlines() if line.startswith("BODY ")]
    sutures = [line[:-1] for line in text.splitlines() if line.startswith("SUTURE ")]
    (folder / "m.yaml").write_text(
        f"bodies: [{', '.join(bodies)}]\njoints: []\nsutures: [{', '.join(sutures)}]\n{text}"
    )
    scene = ligature.load(folder / "m.yaml")
    assert not [d for d in scene.diagnostics if d.severity.name == "ERROR"], scene.diagnostics
    return scene


@pytest.fixture
def kit(tmp_path):
    """The builders above; ``run`` starts a simulation of blocks."""
    return SimpleNamespace(
        pad=pad, needle=needle, body=body, THREAD=THREAD, Bite=Bite, Simulation=Simulation,
        load=lambda *blocks: load(tmp_path, *blocks), run=lambda *blocks: Simulation(load(tmp_path, *blocks)),
    )  # fmt: skip
