"""Proxies of input devices (as in AMBF): models of their own whose root link a hand drives. World axes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ligature.adf import Element
from ligature.model.frames import inverse, pose_matrix
from ligature.model.lookup import find_by_text
from ligature.model.naming import topic_name
from ligature.model.parts import controller_of
from ligature.model.scene import Body

SPACE = "simulated_device/"
"""Put after the namespace of a root link."""


def placed(element: Element, bodies: list[Body], children: set[int], taken: set[str]) -> tuple[list[Body], int | None]:
    """The ``bodies`` of a proxy as the device ``element`` has them, and the index of the root link, None without one.

    ``children`` are bodies with a parent, ``taken`` topics of other root links. All but the root link are passive, and
    nothing falls while no hand holds it.
    """
    roots = [body for body in bodies if body.index not in children]
    named = find_by_text([body.identity.identifier for body in bodies], element.text("root link"))
    root = bodies[named] if element.text("root link") and named is not None else roots[-1] if roots else None
    if root is None:
        return bodies, None
    T = np.eye(4)
    if element.has("location"):
        T = pose_matrix(*element.pose("location")) @ inverse(root.T_world_body)
    found = []
    for body in bodies:
        identity = replace(body.identity, passive=body is not root)
        if body is root:
            space, _, name = identity.topic.rpartition("/")
            topics = (topic_name(f"{space}/{SPACE}", name + suffix) for suffix in ("", *map(str, range(1, 100))))
            identity = replace(identity, topic=next(topic for topic in topics if topic not in taken))
        controller = controller_of(element, "controller gain", body.controller) if body is root else body.controller
        found.append(
            replace(
                body, identity=identity, T_world_body=T @ body.T_world_body, gravity=np.zeros(3), controller=controller
            )
        )
    return found, root.index
