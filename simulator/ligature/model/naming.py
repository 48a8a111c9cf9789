"""Names, namespaces and identifiers of objects, as AMBF forms them.

Files refer to each other's objects without the prefix of the command line (``--ns``): it is put before all names
when every reference is settled, so that it cannot change what a text means.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Container, Iterable
from dataclasses import dataclass, field, replace
from typing import Any

from ligature.adf import Element
from ligature.adf.references import merged
from ligature.model.scene import Identity, Scene

_SLASHES = re.compile(r"/+")


def topic_name(namespace: str, name: str) -> str:
    """Absolute ROS name of an object, without repeated slashes."""
    return _SLASHES.sub("/", f"/{namespace}/{name}")


def free_suffix(base: str, taken: Container[str]) -> str:
    """What makes a new identifier of ``base``: nothing, or the first of 1, 2 and so on that gives one not ``taken``."""
    return next(s for s in itertools.chain(("",), map(str, itertools.count(1))) if base + s not in taken)


@dataclass
class Names:
    """Hands out identities of one kind of object; repeated ``identifiers`` get the suffixes 1, 2 and so on.

    So do names whose topic is one of ``topics`` already, which all kinds that have topics share.
    """

    identifiers: list[str] = field(default_factory=list)
    topics: set[str] | None = None
    _topic_of: dict[str, str] = field(default_factory=dict)
    """The topic that each identifier took of ``topics``."""

    def identity(self, element: Element, namespace: str, model: int, passive: bool | None = None) -> Identity:
        """The identity of ``element`` in a file with ``namespace``; it is registered as taken."""
        space = merged(namespace, element.text("namespace"))
        base = space + element.key
        suffix = free_suffix(base, set(self.identifiers))
        self.identifiers.append(base + suffix)
        passive = element.flag("passive") if passive is None else passive
        name = element.text("name").replace(" ", "")
        if name:
            name += suffix
            if self.topics is not None and not passive:
                name += free_suffix(topic_name(space, name), self.topics)
                self.topics.add(topic_name(space, name))
                self._topic_of[base + suffix] = topic_name(space, name)
        else:
            name = suffix
        parent = element.text("parent") if element.kind != "suture" else ""
        return Identity(
            key=element.key,
            name=name,
            identifier=base + suffix,
            topic=topic_name(space, name),
            model=model,
            passive=passive,
            publish_low=element.integer("publish frequency.low"),
            publish_high=element.integer("publish frequency.high"),
            parent_text=parent,
            mark=element.mark,
            namespace=space,
        )

    def free(self, identity: Identity) -> None:
        """Take back the ``identity`` of an object that is left out, so that a later one may have its names."""
        self.identifiers.remove(identity.identifier)
        topic = self._topic_of.pop(identity.identifier, None)
        if self.topics is not None and topic is not None:
            self.topics.remove(topic)


def prefixed(scene: Scene, prefix: str) -> Scene:
    """``scene`` with ``prefix`` before every namespace, without a separator, as ``--ns`` has it."""
    if not prefix:
        return scene
    world = replace(scene.world, prefix=prefix, topic=topic_name(prefix + scene.world.namespace, "World"))
    kinds = ("bodies", "joints", "ghosts", "sensors", "actuators", "cameras", "lights")
    renamed: dict[str, Any] = {kind: _renamed(getattr(scene, kind), prefix) for kind in kinds}
    arms = {arm.name for arm in scene.arms}
    return replace(
        scene,
        world=world,
        rods=tuple(replace(rod, name=prefix + rod.name) for rod in scene.rods),
        holes=tuple(replace(hole, name=prefix + hole.name) for hole in scene.holes),
        jaws=tuple(jaw if jaw.name in arms else replace(jaw, name=prefix + jaw.name) for jaw in scene.jaws),
        **renamed,
    )


def _renamed(things: Iterable[Any], prefix: str) -> tuple[Any, ...]:
    return tuple(replace(thing, identity=_prefixed(thing.identity, prefix)) for thing in things)


def _prefixed(identity: Identity, prefix: str) -> Identity:
    leaf = identity.topic.removeprefix(topic_name(identity.namespace, ""))
    topic = topic_name(prefix + identity.namespace, leaf)
    return replace(identity, identifier=prefix + identity.identifier, topic=topic)


__all__ = ["Names", "free_suffix", "merged", "prefixed", "topic_name"]
