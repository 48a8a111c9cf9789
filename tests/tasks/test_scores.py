"""What counts as done, by made-up ways of a needle."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature.model.frames import axis_rotation, frame, matrix_pose7, pose7_matrix
from ligature.tasks import MissingBodies, Scenery, judge_estimate, judge_insertion, judge_suture
from ligature.tasks.passages import PassageWatch
from ligature.tasks.scores import SutureScore

from tests.tasks.conftest import drive, hole_poses

SMALL = Path(__file__).resolve().parents[2] / "scenes" / "suturing_small" / "launch.yaml"


def watched(scenery: Scenery, pairs: list[int]) -> tuple[PassageWatch, np.ndarray]:
    """A needle that goes through ``pairs`` one after the other, and where all bodies are at the end."""
    watch, time, poses = PassageWatch(scenery), 0.0, hole_poses()
    for pair in pairs:
        for poses in drive(pair):
            time += 0.01
            watch.observe(time, poses)
    return watch, poses


def test_a_needle_turned_through_a_pair_passes_entry_then_exit(scenery: Scenery) -> None:
    watch, _ = watched(scenery, [1])
    assert [(p.pair, p.exit) for p in watch.passages] == [(1, False), (1, True)]
    assert max(p.miss for p in watch.passages) < 1e-4
    assert watch.passages[0].time < watch.passages[1].time


def test_going_backwards_counts_for_nothing(scenery: Scenery) -> None:
    watch = PassageWatch(scenery)
    for k, poses in enumerate(reversed(list(drive(1)))):
        watch.observe(0.01 * k, poses)
    assert watch.passages == []


def test_a_crossing_beside_the_hole_counts_for_nothing(scenery: Scenery) -> None:
    watch = PassageWatch(scenery)
    for k, poses in enumerate(drive(1)):
        poses[scenery.needle, 1] += 0.008
        watch.observe(0.01 * k, poses)
    assert watch.passages == []


def test_an_insertion_is_judged_with_its_figures(scenery: Scenery) -> None:
    watch, poses = watched(scenery, [2])
    score = judge_insertion(scenery, poses, watch.passages, 12.5)
    assert score.success and score.pair == 2
    assert score.completion_time == 12.5
    assert score.axial > 0.0
    assert any("pair 2 in 12.5 s" in line for line in score.lines())


def test_an_insertion_that_is_not_done_states_why(scenery: Scenery) -> None:
    poses = hole_poses()
    poses[scenery.needle, :3] = poses[scenery.exits[0], :3] - scenery.points[2]
    assert judge_insertion(scenery, poses, [], 1.0).why == "the tip went through 0 holes; two are needed"
    watch, _ = watched(scenery, [2])
    assert judge_insertion(scenery, poses, watch.passages, 1.0).why == "the last hole was not exit 1"
    poses[scenery.needle, :3] = poses[scenery.entries[0], :3] - scenery.points[2]
    assert judge_insertion(scenery, poses, watch.passages, 1.0).lines() == [
        "not done: the hole closest to the tip is not an exit"
    ]


def test_a_suture_is_four_throws_in_order(scenery: Scenery) -> None:
    watch, poses = watched(scenery, [1, 2, 3, 4])
    score = judge_suture(scenery, poses, watch.passages, 60.0)
    assert score.success
    assert len(score.misses) == 8
    watch, poses = watched(scenery, [1, 3, 2, 4])
    score = judge_suture(scenery, poses, watch.passages, 60.0)
    assert not score.success
    assert "entry 1, exit 1, entry 3, exit 3" in score.why
    watch, poses = watched(scenery, [1, 2])
    assert judge_suture(scenery, poses, watch.passages, 20.0, pairs=2).success


def test_an_exact_estimate_has_no_error_and_a_turned_one_the_way_of_its_points(scenery: Scenery) -> None:
    poses = hole_poses()
    poses[scenery.needle] = matrix_pose7(frame(axis_rotation((0, 0, 1), 0.4), (0.1, 0.2, 0.3)))
    T_camera = frame(axis_rotation((1, 0, 0), 2.5), (0.0, 0.0, 0.2))
    exact = np.linalg.inv(T_camera) @ pose7_matrix(poses[scenery.needle])
    assert judge_estimate(scenery, poses, T_camera, exact, 3.0).total == pytest.approx(0.0, abs=1e-12)
    off = exact @ frame(axis_rotation((0, 1, 0), 0.1), (0, 0, 0))
    score = judge_estimate(scenery, poses, T_camera, off, 3.0)
    assert score.E_tip == pytest.approx(2 * 0.01 * np.sin(0.05))


def test_a_scene_without_holes_is_reported() -> None:
    scene = ligature.load(SMALL)
    with pytest.raises(MissingBodies, match=r"has 0 pairs of holes Entry1, Exit1, …; the task needs 1"):
        Scenery.of(scene)
    scenery = Scenery.of(scene, pairs=0)
    assert len(scenery.thread) == 40
    assert len(scenery.tips) == 2


@pytest.mark.corpus
def test_the_points_of_the_challenges_needle_are_where_its_evaluation_has_them(corpus: Path) -> None:
    """As in the challenge's evaluation: base, middle and tip in the needle's mesh frame, which is its body frame."""
    scene = ligature.load(corpus / "suturing_scene" / "launch.yaml", models=[10, 11])
    scenery = Scenery.of(scene, pairs=4)
    wanted = [(-0.009513319, 0.001026297, 0), (-0.004098702, 0.008965075, 0), (0.006617809, 0.006973457, 0)]
    assert scenery.points == pytest.approx(np.array(wanted), abs=1.5e-3)
    names = [[scene.bodies[b].identity.name for b in side] for side in (scenery.entries, scenery.exits)]
    assert names == [[f"Entry{i}" for i in range(1, 5)], [f"Exit{i}" for i in range(1, 5)]]


def test_one_throw_is_counted_as_one() -> None:
    def first(pairs: int) -> str:
        return SutureScore(True, 20.9, 0.0, (1e-4,) * (2 * pairs)).lines()[0]

    assert (first(1), first(2)) == ("1 throw in 20.9 s", "2 throws in 20.9 s")
