"""Bodies put anywhere at once; `python -m tests.fuzz.placing` does so in hundreds of trials."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature.model.frames import inverse, pose7_matrix

from tests.fuzz.placing import STAGES, Trial, scene_of
from tests.physics.test_light_links import falling


@pytest.mark.parametrize("number", range(len(STAGES)))
def test_bodies_put_anywhere_leave_the_scene_finite_and_a_reset_whole(number: int) -> None:
    verdict = Trial(STAGES[number], number).run()
    assert not verdict.faults, str(verdict)


def test_what_cannot_be_put_is_refused_by_name() -> None:
    scene = scene_of("suturing_small")
    simulation = ligature.Simulation(scene)
    element = next(iter(sorted(scene.rod_bodies)))
    with pytest.raises(ValueError, match="is an element of a thread; set the pose of a body at an end of it"):
        simulation.set_pose(element, [0, 0, 0, 0, 0, 0, 1])
    links = [tree.links[-1].body for tree in scene.articulations if len(tree.links) > 1]
    with pytest.raises(ValueError, match="is held by joints; set its joints, or the pose of its root"):
        simulation.set_pose(links[0], [0, 0, 0, 0, 0, 0, 1])
    simulation.close()


@pytest.mark.parametrize("seed", range(8))
def test_any_body_of_a_free_mechanism_can_be_put_anywhere(seed: int, tmp_path: Path) -> None:
    """The others go with it, whichever of them is the root."""
    rng = np.random.default_rng((17, seed))
    file = tmp_path / "m.yaml"
    file.write_text(falling(rng))
    simulation = ligature.Simulation(ligature.load(file))
    simulation.step(700)  # it swings, on the floor
    moving = [body.index for body in simulation.scene.bodies if not body.static]
    before = [pose7_matrix(simulation.state["body_pose"][0, i]) for i in moving]
    joints = simulation.state["joint_position"].copy()
    body = int(rng.choice(moving))
    q = rng.normal(size=4)
    simulation.set_pose(body, [*rng.uniform(1.0, 2.0, 3), *(q / np.linalg.norm(q))])
    after = [pose7_matrix(simulation.state["body_pose"][0, i]) for i in moving]
    at = moving.index(body)
    for old, new in zip(before, after, strict=True):
        assert inverse(after[at]) @ new == pytest.approx(inverse(before[at]) @ old, abs=1e-9)
    assert simulation.state["joint_position"] == pytest.approx(joints, abs=1e-9)
    assert np.abs(simulation.state["body_twist"][0, moving]).max() < 1e-9
    simulation.close()
