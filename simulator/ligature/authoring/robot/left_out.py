"""Lists what of a model no robot of URDF and SDF holds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from ligature.adf import Document, Element
from ligature.adf.schema import BY_PATH, LISTS
from ligature.adf.schema.keys import Status, Type

_SHAPES = ("shape", "geometry", "compound shape", "mesh", "collision shape", "collision geometry")
_COLLISION = ("compound collision shape", "collision mesh", "collision mesh type", "collision offset")
_LOOKS = ("scale", "color", "color rgba", "color components", "use material")
_FOLDERS = ("high resolution path", "low resolution path", "namespace", "name", "adf version")
_PIVOTS = ("parent", "child", "type", "parent pivot", "child pivot", "parent axis", "child axis", "joint limits")
WRITTEN = {
    "body": {*_SHAPES, *_COLLISION, *_LOOKS, *_FOLDERS, "mass", "inertia", "inertial offset", "location"},
    "joint": {*_FOLDERS, *_PIVOTS, "offset", "child offset", "joint offset"},
    "model": {*_FOLDERS, *LISTS},
}
"""Keys of objects and of the file that a robot holds."""

WITHOUT_EFFECT = (Status.IGNORED, Status.UNUSED)


def left_out(document: Document) -> Iterator[str]:
    """A note for each kind of object, body of tissue, and for all keys, that are not written."""
    for section in LISTS:
        count = len(document.elements(section))
        if count and section not in ("bodies", "joints"):
            yield f"1 {LISTS[section]} is left out" if count == 1 else f"{count} {section} are left out"
    for body in document.elements("bodies"):
        if body.has("ligature tissue"):
            yield f"body '{body.key}' is soft tissue, which neither format supports; its link is rigid"
    keys = [f"'{name}' of {owner}" for owner, names in _unwritten(document) for name in names]
    if keys:
        yield f"not written: {', '.join(keys)}"


def _unwritten(document: Document) -> Iterator[tuple[str, list[str]]]:
    """The keys that are left out, by their owners: so many bodies or joints, or the file."""
    for section, one in (("bodies", "body"), ("joints", "joint")):
        counts = Counter(name for element in document.elements(section) for name in _lost_keys(element, element.kind))
        for name, count in counts.items():
            yield f"{count} {one if count == 1 else section}", [name]
    yield "the file", list(_lost_keys(document.top, document.kind))


def _lost_keys(element: Element, kind: str) -> Iterator[str]:
    """The keys with an effect, other than their default's, that no robot holds; tissue has its own note."""
    for name, key in BY_PATH[kind].items():
        if "." in name or name in WRITTEN[kind] or name == "ligature tissue" or key.status in WITHOUT_EFFECT:
            continue
        if element.has(name) and (key.type is Type.MAP or element.value(name) != key.default):
            yield name
