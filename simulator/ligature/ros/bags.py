"""Bags as data: opened with clear errors, read as states of a scene and as reports of a task. SI units, world axes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import rosbag
from numpy.typing import NDArray

from ligature.model.frames import pose7_matrix
from ligature.model.scene import Scene
from ligature.model.state import new_state
from ligature.ros import conversion, names
from ligature.tasks.attempt import TASKS, Attempt, Score

Array = NDArray[np.float64]

REPORTS = "/surgical_robotics_challenge/completion_report"
"""Root of the topics on which teams of the challenge report (interface reference §4.5)."""


class BagError(ValueError):
    """A bag that cannot be used; the message gives the reason."""


@contextmanager
def opened(path: Path) -> Iterator[rosbag.Bag]:
    """The bag ``path`` to read; raises `BagError` for a file that is none, cut off or damaged, also while reading."""
    try:
        with rosbag.Bag(str(path)) as bag:
            yield bag
    except rosbag.ROSBagUnindexedException:
        raise BagError(
            f"{path}: the bag is truncated: its recorder did not finish; 'rosbag reindex' may repair it"
        ) from None
    except rosbag.ROSBagException as error:
        raise BagError(f"{path}: not a bag, or a damaged one: {error}") from None
    except OSError as error:
        raise BagError(f"{path}: {error.strerror or error}") from None


def messages(bag: rosbag.Bag, topics: list[str]) -> Iterator[tuple[str, Any, float]]:
    """Topic, message and time (s) of all messages on ``topics``, in their order."""
    for topic, message, stamp in bag.read_messages(topics=topics):
        yield topic, message, stamp.to_sec()


def reported_pose(message: Any) -> Array:
    """The pose (4, 4) of a PoseStamped; raises ValueError for numbers that are no pose."""
    pose = np.array(conversion.pose7(message.pose))
    if not np.isfinite(pose).all() or abs(np.linalg.norm(pose[3:]) - 1.0) > 1e-2:
        raise ValueError("a reported pose must have finite numbers and a quaternion of length 1")
    return pose7_matrix(pose)


def judge(path: Path, scene: Scene, task: str) -> tuple[Score, Attempt]:
    """Score and measures of the ``task`` in a bag of AMBF topics: at its last report, or at its end.

    Only what the topics report is measured: passages, ways and time. Raises `BagError` when the bag lacks what the task
    needs, `ligature.tasks.MissingBodies` when the scene does.
    """
    attempt, state = Attempt(scene, task), new_state(scene)
    with opened(path) as bag:
        found = set(bag.get_type_and_topic_info().topics)
        bodies, clock = _body_topics(scene, attempt, found, path)
        reports = [t for t in found if t.startswith(REPORTS) and t.rstrip("/").endswith(f"/task{TASKS[task]}")]
        score: Score | None = None
        seen: set[str] = set()
        begin: float | None = None
        for topic, message, stamp in messages(bag, [*bodies, *reports]):
            if topic in bodies:
                state["body_pose"][0, bodies[topic]] = conversion.pose7(message.pose)
                seen.add(topic)
                begin = stamp if begin is None else begin
                if topic == clock and len(seen) == len(bodies):
                    state["sim_time"] = message.sim_time
                    attempt.observe(state[0])
            elif len(seen) == len(bodies):
                score = _judged(attempt, message) or score
    if score is None and task == "pose_estimation":
        raise BagError(f"{path}: no pose is reported on {REPORTS}/TEAM/task1")
    if len(seen) < len(bodies):
        raise BagError(f"{path}: has no topics of {', '.join(sorted(set(bodies) - seen))}")
    return score or attempt.judge(), attempt


def _judged(attempt: Attempt, message: Any) -> Score | None:
    if attempt.task == "pose_estimation":
        return attempt.judge(reported_pose(message))
    return attempt.judge() if message.data else None


def _body_topics(scene: Scene, attempt: Attempt, found: set[str], path: Path) -> tuple[dict[str, int], str]:
    """The State topics of a bag with the bodies they are of, and the needle's; all that the task needs are there."""
    named = {}
    objects = [("body", body.identity) for body in scene.bodies]
    for policy in reversed(names.POLICIES):
        topics = names.topics(objects, policy, scene.world.topic)
        for body, topic in zip(scene.bodies, topics, strict=True):
            if f"{topic}/State" in found:
                named[body.index] = f"{topic}/State"
    lacking = [scene.bodies[body].identity.topic for body in attempt.needed if body not in named]
    if lacking:
        raise BagError(f"{path}: has no State topics of {', '.join(lacking)}, which '{attempt.task}' needs")
    wanted = {*attempt.needed, *attempt.monitor.scenery.tips} & set(named)
    return {named[body]: body for body in wanted}, named[attempt.monitor.scenery.needle]
