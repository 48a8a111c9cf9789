"""Names, namespaces and identifiers of objects (ADF specification §4.1 to §4.3, §4.7)."""

from __future__ import annotations

import re

from ligature.adf import Element
from ligature.adf.references import merged
from ligature.model.scene import Identity

_SLASHES = re.compile(r"/+")
MAX_REMAP = 100


def topic_name(namespace: str, name: str) -> str:
    """Absolute ROS name of an object, without repeated slashes."""
    return _SLASHES.sub("/", f"/{namespace}/{name}")


class Names:
    """Hands out identities of one kind of object; repeated identifiers get the suffixes 1, 2, …"""

    def __init__(self, prefix: str) -> None:
        self._prefix = prefix
        self.identifiers: list[str] = []

    def identity(self, element: Element, namespace: str, model: int, passive: bool | None = None) -> Identity:
        """The identity of ``element`` in a file with ``namespace``; it is registered as taken."""
        space = self._prefix + merged(namespace, element.text("namespace"))
        base = space + element.key
        taken = set(self.identifiers)
        suffix = next(s for s in ("", *map(str, range(1, MAX_REMAP + 1)), "?") if base + s not in taken)
        self.identifiers.append(base + suffix)
        name = element.text("name").replace(" ", "")
        parent = element.text("parent") if element.kind != "suture" else ""
        return Identity(
            key=element.key,
            name=name + suffix,
            identifier=base + suffix,
            topic=topic_name(space, name + suffix),
            model=model,
            passive=element.flag("passive") if passive is None else passive,
            publish_low=element.integer("publish frequency.low"),
            publish_high=element.integer("publish frequency.high"),
            parent_text=parent,
            mark=element.mark,
        )


__all__ = ["Names", "merged", "topic_name"]
