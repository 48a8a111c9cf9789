"""Which name an object has on ROS (interface reference §2.10).

``ambf`` gives every object AMBF's own name. ``src`` gives the needle and the camera body the short
names that the suturing challenge's scripts look for, and leaves the ghosts of holes unadvertised,
so that every look-up by substring that those scripts make is unambiguous.
"""

from __future__ import annotations

import re

from ligature.model.scene import Identity

POLICIES = ("ambf", "src")
_SHORT = {"Needle": "/ambf/env/Needle", "CameraFrame": "/ambf/env/CameraFrame"}
_HOLE_GHOST = re.compile(r"(?i)(entry|exit|needle|cameraframe)")


def topic(identity: Identity, kind: str, policy: str) -> str | None:
    """The ROS name of an object under a policy; None when it is not advertised."""
    if policy == "ambf":
        return identity.topic
    if kind == "body":
        return _SHORT.get(identity.name, identity.topic)
    if kind == "ghost" and _HOLE_GHOST.search(identity.topic):
        return None
    return identity.topic
