"""The thread of a real scene beside the reference simulator's recordings of it."""

from __future__ import annotations

import csv
import gzip

import ligature
import numpy as np
import pytest
from ligature.model.frames import matrix_pose7
from ligature.suture.description import from_chain
from ligature.suture.partners import Partner
from ligature.suture.rod import Rod

pytestmark = pytest.mark.corpus


@pytest.fixture(scope="module")
def scene(corpus):
    return ligature.load(corpus / "suturing_scene" / "launch.yaml", models=[10])


def _thread(scene, held):
    """The scene's thread on its needle, far from anything else."""
    description = from_chain(scene, scene.rods[0])
    needle = scene.bodies[description.attachments[0].body]
    partner = Partner(needle.index, needle.mass, needle.inertia, needle.T_body_inertial, needle.gravity, fixed=held)
    return Rod(description, [partner]), needle


def _recorded(golden, name):
    """Times and positions (samples, elements, 3) of the thread's bodies, elements in order."""
    tracks = {}
    with gzip.open(golden / "traces" / f"{name}.csv.gz", "rt") as lines:
        for row in csv.DictReader(lines):
            if "Thread" in row["topic"]:
                at = [float(row[k]) for k in ("sim_time", "px", "py", "pz")]
                tracks.setdefault(row["topic"], []).append(at)
    every = np.array([tracks[topic] for topic in sorted(tracks)])
    return every[0, :, 0], np.swapaxes(every[:, :, 1:], 0, 1)


def test_chain_of_the_scene_becomes_a_rod_of_forty_elements_on_its_needle(scene):
    description = from_chain(scene, scene.rods[0])
    assert len(description.mass) == 40
    assert description.mass == pytest.approx(np.full(40, 0.03))
    assert description.joint_stiffness == pytest.approx(np.full((39, 3), 0.2))
    assert [attachment.element for attachment in description.attachments] == [0]
    lengths = np.linalg.norm(description.ends[:, 1] - description.ends[:, 0], axis=1)
    assert lengths == pytest.approx(np.full(40, 0.00244), abs=0.05e-3)


def test_thread_hanging_from_a_held_needle_moves_as_the_reference(scene, golden):
    rod, needle = _thread(scene, held=True)
    rod.place(needle.index, matrix_pose7(needle.T_world_body @ needle.T_body_inertial), np.zeros(6))
    times, recorded = _recorded(golden, "hang_thread_p1000_dt1ms")
    tick = 0
    for time, expected in zip(times, recorded, strict=True):
        while tick < round(time * 1000):
            rod.step()
            tick += 1
        # The reference's thread stretches by up to a tenth; this one does not.
        stretch = np.linalg.norm(np.diff(expected, axis=0), axis=1).sum() - 39 * 0.00244
        assert np.abs(rod.body_poses[:, :3] - expected).max() < stretch + 4e-3
    assert rod.body_poses[:, :2] == pytest.approx(expected[:, :2], abs=0.5e-3)
    assert np.abs(rod.body_poses[:, 2] - expected[:, 2]).max() < stretch + 0.5e-3
    lengths = np.linalg.norm(np.diff(rod.body_poses[:, :3], axis=0), axis=1)
    assert lengths.max() < 0.00244 + 0.01e-3


def test_thread_heavier_than_its_needle_falls_with_it(scene, golden):
    """1.2 kg of thread on 0.5 kg of needle, nothing below."""
    rod, needle = _thread(scene, held=False)
    pose = matrix_pose7(needle.T_world_body @ needle.T_body_inertial)
    twist = np.zeros(6)
    keep = (1.0 - needle.linear_damping) ** 1e-3
    for _ in range(1500):
        rod.place(needle.index, pose, twist)
        rod.step()
        impulse = rod.impulse_on(needle.index)
        twist[:3] = twist[:3] * keep + impulse[:3] / needle.mass + 1e-3 * needle.gravity
        pose[:3] += 1e-3 * twist[:3]
    times, recorded = _recorded(golden, "drop_needle_thread_p200_dt5ms")
    expected = recorded[np.searchsorted(times, 1.4999)]
    assert np.abs(rod.body_poses[:, 2] - expected[:, 2]).max() < 0.01 * 3.0
    assert np.abs(rod.twists[:, 2] - twist[2]).max() < 1e-3
