"""Which name an object has on ROS.

``ambf`` gives every object AMBF's own name. ``src`` is for the suturing challenge's scripts, which look objects up
by a part of their name and give up when several match: the needle and the camera body stand directly below the
world's namespace, the holes keep their names, and nothing else whose name contains one of these words is advertised.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from ligature.model.scene import Identity, WorldSettings

POLICIES = ("ambf", "src")

WORLD_FRAME = "world"
"""The frame that world poses are in, after the prefix of the scene."""

_AT_THE_TOP = ("Needle", "CameraFrame")
_HOLE = re.compile(r"(Entry|Exit)\d+\Z")
_LOOKED_UP = ("Needle", "CameraFrame", "Entry", "Exit")


def topics(objects: Iterable[tuple[str, Identity]], policy: str, world: str) -> list[str | None]:
    """The ROS name of each of ``objects`` (kind, identity); None for one that is not advertised.

    ``world`` is the ROS name of the world, such as ``/ambf/env/World``.
    """
    if policy == "ambf":
        return [identity.topic for _, identity in objects]
    base = world.rpartition("/")[0]
    taken: set[str] = set()
    return [_for_the_challenge(kind, identity, base, taken) for kind, identity in objects]


def tf_topics(world: WorldSettings, name: str) -> list[str]:
    """Where frames are published: on ``name``, such as ``tf``, of all programs, and on that below the prefix.

    Frames of a prefix have it in their names, so that both are right for any number of simulators; a program that
    was moved into a namespace as a whole hears ``/left/tf`` only.
    """
    return [f"/{name}"] if world.root == "/" else [f"/{name}", f"{world.root}{name}"]


def _for_the_challenge(kind: str, identity: Identity, base: str, taken: set[str]) -> str | None:
    """The name of a body under ``src``; ``taken`` are the words that already name another body."""
    word = identity.topic.rpartition("/")[2]
    wanted = word in _AT_THE_TOP or _HOLE.match(word) is not None
    if kind == "body" and wanted and word not in taken:
        taken.add(word)
        return f"{base}/{word}" if word in _AT_THE_TOP else identity.topic
    return None if any(part in identity.topic for part in _LOOKED_UP) else identity.topic
