"""Loops of any joint: they assemble, they hold, they move, and nothing is thrown."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature import Simulation
from ligature.adf import Severity
from ligature.model.assembly import joint_coordinates
from ligature.model.frames import inverse, pose7_matrix
from numpy.typing import NDArray

from tests.physics.linkages import CLOSING, KINDS, linkage

GAP, WORST = 1e-4, 3e-3
"""What a loop may open by in nine ticks of ten, in metres, and while it passes a flat configuration at speed."""

RATIO, GAP_BEYOND = 300.0, 5e-4
"""Ratio of masses from which on Bullet's solver holds a loop less well, and what it may open by then."""

FASTEST = 20.0
"""Speed in m/s that no linkage of a metre reaches that falls from rest."""


def gaps(sim: Simulation) -> NDArray[np.float64]:
    """Metres by which each joint of a scene is open, its free axes aside."""
    scene, poses = sim.scene, sim.state["body_pose"][0]
    found = []
    for joint in scene.joints:
        parent, child = scene.bodies[joint.parent], scene.bodies[joint.child]
        T_a = pose7_matrix(poses[joint.parent]) @ parent.T_body_inertial @ joint.T_parent_a
        T_b = pose7_matrix(poses[joint.child]) @ child.T_body_inertial @ joint.T_child_b
        found.append(joint_coordinates(joint, inverse(T_a) @ T_b)[1])
    return np.array(found)


def run(sim: Simulation, ticks: int) -> tuple[NDArray[np.float64], float]:
    """The widest gap (m) of each of ``ticks``, and the largest speed (m/s) within them."""
    widest, fastest = np.zeros(ticks), 0.0
    for k in range(ticks):
        sim.step()
        widest[k] = gaps(sim).max()
        fastest = max(fastest, float(np.linalg.norm(sim.state["body_twist"][0, :, :3], axis=1).max()))
    return widest, fastest


def check(text: str, folder: Path, ticks: int) -> None:
    (folder / "model.yaml").write_text("namespace: /ambf/env/\n" + text, encoding="utf-8")
    scene = ligature.load(folder / "model.yaml")
    assert not [d for d in scene.diagnostics if d.severity >= Severity.WARNING], [str(d) for d in scene.diagnostics]
    assert scene.closures
    sim = Simulation(scene)
    assert gaps(sim).max() < 1e-6
    for body in scene.bodies:
        moved = np.linalg.norm(sim.state["body_pose"][0, body.index, :3] - body.T_world_body[:3, 3])
        assert moved < 0.02, body.identity.key
    widest, fastest = run(sim, ticks)
    sim.close()
    assert not sim.problems
    masses = [body.mass for body in scene.bodies if not body.static]
    assert np.quantile(widest, 0.9) < (GAP if max(masses) < RATIO * min(masses) else GAP_BEYOND)
    assert widest.max() < WORST
    assert fastest < FASTEST


CASES = [(kind, closing) for kind in KINDS for closing in (CLOSING if kind != "spatial" else ("p2p",))]


@pytest.mark.parametrize(("kind", "closing"), CASES)
def test_any_rounded_linkage_assembles_and_holds(kind: str, closing: str, tmp_path: Path) -> None:
    rng = np.random.default_rng([KINDS.index(kind), CLOSING.index(closing)])
    check(linkage(rng, kind, closing), tmp_path, 300)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize(("kind", "closing"), CASES)
def test_many_rounded_linkages_assemble_and_hold(kind: str, closing: str, seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng([KINDS.index(kind), CLOSING.index(closing), seed])
    check(linkage(rng, kind, closing), tmp_path, 1000)
