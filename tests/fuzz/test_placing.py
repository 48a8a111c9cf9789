"""Bodies put anywhere at once; `python -m tests.fuzz.placing` does so in hundreds of trials."""

from __future__ import annotations

import ligature
import pytest

from tests.fuzz.placing import STAGES, Trial, scene_of


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
