"""Bags as data: opened with clear errors, read as states of a scene and as reports of a task. SI units, world axes."""

from __future__ import annotations

import bz2
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import rosbag
from numpy.typing import NDArray

from ligature import definitions
from ligature.adf.contents import mistaken
from ligature.model.frames import pose7_matrix
from ligature.model.scene import Scene
from ligature.model.state import new_state
from ligature.paths import reason
from ligature.ros import conversion, names
from ligature.tasks.attempt import TASKS, Attempt, Score

Array = NDArray[np.float64]

REPORTS = "/surgical_robotics_challenge/completion_report"
"""Root of the topics on which teams of the challenge report."""


BAG = "a ROS bag"

MOST_CHUNK_BYTES = 256 << 20
"""Most bytes of a chunk when it is decompressed; recorders begin a new one after 0.75 MiB, or after one message."""


class BagError(ValueError):
    """A bag that cannot be used; the message gives the reason."""


@contextmanager
def opened(path: Path) -> Iterator[rosbag.Bag]:
    """The bag ``path`` to read; raises `BagError` for a file that is none, cut off or damaged.

    What is in it comes from `topics` and `messages`, which do the same.
    """
    with _blamed(path):
        other = mistaken(path, BAG)
    if other:
        raise BagError(f"{other}, not {BAG}; give a bag, or a record of 'ligature run --record'")
    with _blamed(path):
        bag = rosbag.Bag(str(path))
    with bag:
        yield bag


def topics(bag: rosbag.Bag) -> set[str]:
    """Names of all topics of a bag."""
    with _blamed(bag.filename, bag):
        return {connection.topic for connection in bag._get_connections()}


def messages(bag: rosbag.Bag, topics: list[str]) -> Iterator[tuple[str, Any, float]]:
    """Topic, message and time (s) of all messages on ``topics``, in their order."""
    with _blamed(bag.filename, bag):
        rows = bag.read_messages(topics=topics)
    while True:
        with _blamed(bag.filename, bag):
            row = next(rows, None)
        if row is None:
            return
        yield row.topic, row.message, row.timestamp.to_sec()


@contextmanager
def _blamed(path: Path | str, bag: rosbag.Bag | None = None) -> Iterator[None]:
    """Whatever rosbag raises becomes a `BagError` with the place in the file: it trusts the numbers that it reads."""
    try:
        yield
    except rosbag.ROSBagUnindexedException:
        raise BagError(
            f"{path}: the bag is truncated: its recorder did not finish; 'rosbag reindex' may repair it"
        ) from None
    except rosbag.ROSBagException as error:
        raise BagError(f"{path}{_place(bag)}: not a valid bag: {error}") from None
    except BagError as error:
        raise BagError(f"{path}{_place(bag)}: {error}") from None
    except OSError as error:
        raise BagError(f"{path}{_place(bag)}: {reason(error)}") from None
    except Exception as error:
        raise BagError(f"{path}{_place(bag)}: a damaged bag: {type(error).__name__}: {str(error)[:200]}") from None


def _place(bag: rosbag.Bag | None) -> str:
    file = getattr(bag, "_file", None)
    return "" if file is None or file.closed else f": near byte {file.tell()}"


def _message_type(info: Any) -> Any:
    """Message class of a connection, in place of rosbag's function, which executes code made of the definition."""
    if info.md5sum not in _classes:
        try:
            _classes[info.md5sum] = definitions.message_class(info.datatype, info.md5sum, info.msg_def)
        except definitions.DefinitionError as error:
            raise BagError(f"topic {info.topic}: {error}") from None
    return _classes[info.md5sum]


class _BoundedBz2(ModuleType):
    """``bz2`` for rosbag, whose chunks of a few bytes may otherwise become gigabytes."""

    def decompress(self, data: bytes) -> bytes:
        """The content of a chunk."""
        reader = bz2.BZ2Decompressor()
        content = reader.decompress(data, MOST_CHUNK_BYTES)
        if not reader.eof and len(content) >= MOST_CHUNK_BYTES:
            raise BagError(f"a chunk holds more than {MOST_CHUNK_BYTES >> 20} MiB")
        return content

    def __getattr__(self, name: str) -> Any:
        return getattr(bz2, name)


_classes: dict[str, Any] = {}
rosbag.bag._get_message_type = _message_type
rosbag.bag.bz2 = _BoundedBz2("bz2")


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
        found = topics(bag)
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
