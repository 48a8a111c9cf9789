"""Reads launch, world, model and input-device files into documents.

Nothing is skipped in silence: what is not usable, unknown or without effect is a finding with its
place. Files are opened through a `Resolver` only.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from ligature.adf.diagnostics import AdfError, Diagnostic, Mark, Severity
from ligature.adf.document import Document, Element, problems
from ligature.adf.nodes import Mapping, Node, Scalar, Sequence, parse
from ligature.adf.resolver import ResolutionError, Resolver
from ligature.adf.schema import BY_PATH, LISTS, NOT_SIMULATED

MAX_TEXT = 64 * 1024 * 1024
"""Largest scene file in bytes; the largest real one has 300 kB."""

_DEFAULTED = ("body", "camera", "light")
"""Kinds of which AMBF makes a default object when one is listed but not defined."""


@dataclass(frozen=True)
class Reference:
    """A path named by a file: the text, the path it means, and why it cannot be used, if so."""

    text: str
    path: Path | None
    mark: Mark
    diagnostic: Diagnostic | None = None


@dataclass
class LaunchDocument(Document):
    """A launch file with its references resolved; ``models`` has one entry per list index."""

    world: Reference | None = None
    devices: Reference | None = None
    colours: Reference | None = None
    models: tuple[Reference, ...] = ()


def read_launch(path: Path, resolver: Resolver, strict: bool = False) -> LaunchDocument:
    """Read a launch file; raises `AdfError` when it is not readable at all."""
    document = _read(path, "launch", resolver, strict)
    launch = LaunchDocument(**vars(document))
    launch.world = _reference(document, "world config", resolver)
    launch.devices = _reference(document, "input devices config", resolver)
    launch.colours = _reference(document, "color config", resolver)
    node = document.top.node.get("multibody configs")
    if isinstance(node, Sequence):
        launch.models = tuple(_resolved(item, document.path.parent, resolver) for item in node.items)
    return launch


def read_world(path: Path, resolver: Resolver, strict: bool = False) -> Document:
    """Read a world file; raises `AdfError` when it is not readable at all."""
    return _read(path, "world", resolver, strict)


def read_model(path: Path, resolver: Resolver, strict: bool = False) -> Document:
    """Read a model file; raises `AdfError` when it is not readable at all."""
    return _read(path, "model", resolver, strict)


def read_devices(path: Path, resolver: Resolver, strict: bool = False) -> Document:
    """Read an input-devices file; raises `AdfError` when it is not readable at all."""
    return _read(path, "input devices", resolver, strict)


def kind_of(root: Mapping) -> str:
    """Which of the four kinds of file the top-level keys make it; colours files are ``colors``."""
    keys = set(root.entries)
    if "multibody configs" in keys or "world config" in keys:
        return "launch"
    if "input devices" in keys:
        return "input devices"
    if keys & {"environment", "enclosure size", "max iterations", "skybox"} and "bodies" not in keys:
        return "world"
    values = [value for _, value in root.entries.values()]
    if values and all(isinstance(v, Mapping) and {"r", "g", "b"} <= set(v.entries) for v in values):
        return "colors"
    return "model"


def read_any(path: Path, resolver: Resolver, strict: bool = False) -> Document:
    """Read a file of any of the four kinds, told apart by its keys."""
    real = resolver.allow(Path(path))
    text = resolver.read_text(real, MAX_TEXT)
    kind = kind_of(parse(text, real))
    if kind == "launch":
        return read_launch(real, resolver, strict)
    if kind == "colors":
        return Document(real, kind, text, Element("model", real.name, parse(text, real)))
    return _read(real, kind, resolver, strict)


def _read(path: Path, kind: str, resolver: Resolver, strict: bool) -> Document:
    real = resolver.allow(Path(path))
    text = resolver.read_text(real, MAX_TEXT)
    root = parse(text, real)
    own = _own_keys(root, kind)
    found = problems(Element(kind, real.name, own))
    top = Element(kind, real.name, _usable(own, found))
    document = Document(real, kind, text, top)
    document.diagnostics += found
    document.diagnostics += _version(top)
    for name, object_kind in LISTS.items():
        if name in BY_PATH[kind]:
            document.lists[name] = _elements(root, name, object_kind, document, strict)
    document.diagnostics += _unlisted(root, document)
    if strict and not document.ok:
        document.lists = {}
    return document


def _own_keys(root: Mapping, kind: str) -> Mapping:
    """The root with the keys of the schema only; all others define objects or hold anchors."""
    known = BY_PATH[kind]
    return replace(root, entries={name: entry for name, entry in root.entries.items() if name in known})


def _usable(own: Mapping, found: list[Diagnostic]) -> Mapping:
    """The file's own keys without those that hold an error: their defaults are taken."""
    errors = [d.mark for d in found if d.severity >= Severity.ERROR and d.mark is not None and d.mark != own.mark]

    def sound(value: Node) -> bool:
        start = (value.mark.line, value.mark.column)
        return not any(start <= (mark.line, mark.column) <= value.end for mark in errors)

    return replace(own, entries={name: entry for name, entry in own.entries.items() if sound(entry[1])})


def _listed_names(root: Mapping, kind: str) -> set[str]:
    names: set[str] = set()
    for list_name in LISTS:
        node = root.get(list_name)
        if list_name in BY_PATH[kind] and isinstance(node, Sequence):
            names |= {item.text for item in node.items if isinstance(item, Scalar)}
    return names


def _version(top: Element) -> list[Diagnostic]:
    if not top.has("adf version"):
        return []
    node = top.node.get("adf version")
    if isinstance(node, Scalar) and node.text == "1.0":
        return []
    message = "'adf version' is not 1.0"
    return [Diagnostic(Severity.ERROR, message, top.mark_of("adf version"), "write 1.0", "version")]


def _elements(root: Mapping, list_name: str, kind: str, document: Document, strict: bool) -> tuple[Element, ...]:
    node = root.get(list_name)
    if not isinstance(node, Sequence):
        return ()
    checked: dict[str, Element | None] = {}
    elements = []
    for item in node.items:
        if not isinstance(item, Scalar):
            continue
        if item.text not in checked:
            checked[item.text] = _element(root, item, kind, document, strict)
        element = checked[item.text]
        if element is not None:
            elements.append(element)
    return tuple(elements)


def _element(root: Mapping, item: Scalar, kind: str, document: Document, strict: bool) -> Element | None:
    node = root.get(item.text)
    if not isinstance(node, Mapping):
        severity = Severity.WARNING if kind in _DEFAULTED else Severity.ERROR
        message = f"{kind} '{item.text}' is listed but not defined"
        document.diagnostics.append(
            Diagnostic(severity, message, item.mark, "define it or take it from the list", "undefined")
        )
        return None
    element = Element(kind, item.text, node)
    found = problems(element)
    if kind == "joint":
        found = _joint_policy(element, found, strict)
    document.diagnostics += found
    if any(d.severity >= Severity.ERROR for d in found):
        return None
    if kind in NOT_SIMULATED:
        message = f"{kind} '{item.text}' is read and checked, but not simulated"
        document.diagnostics.append(Diagnostic(Severity.WARNING, message, node.mark, "", "not simulated"))
    return element


def _joint_policy(element: Element, found: list[Diagnostic], strict: bool) -> list[Diagnostic]:
    """AMBF's refusals of old joints become warnings, unless strict (ADF specification §14, §30)."""
    motor_alone = element.has("enable motor") and not element.has("enable feedback")
    if strict:
        if motor_alone:
            message = f"joint '{element.key}' has 'enable motor' without 'enable feedback'"
            found = [
                *found,
                Diagnostic(Severity.ERROR, message, element.mark_of("enable motor"), "AMBF refuses the file", "motor"),
            ]
        return found
    softened = []
    for diagnostic in found:
        if diagnostic.code == "missing" and diagnostic.message.endswith("lacks the key 'type'"):
            message = f"joint '{element.key}' has no 'type'; it is taken as revolute"
            diagnostic = Diagnostic(Severity.WARNING, message, diagnostic.mark, "add type: revolute", "type")
        softened.append(diagnostic)
    return softened


def _unlisted(root: Mapping, document: Document) -> list[Diagnostic]:
    """Objects that are defined but not listed, told by keys that only objects have."""
    listed = _listed_names(root, document.kind)
    found = []
    for name, (key, node) in root.entries.items():
        if isinstance(node, Mapping) and name not in listed and name not in BY_PATH[document.kind] and node.get("name"):
            message = f"'{name}' is defined but not listed, so it does not exist"
            found.append(Diagnostic(Severity.DEBUG, message, key.mark, "", "unlisted"))
    return found


def _reference(document: Document, name: str, resolver: Resolver) -> Reference | None:
    node = document.top.node.get(name)
    return None if node is None else _resolved(node, document.path.parent, resolver)


def _resolved(node: Node, base: Path, resolver: Resolver) -> Reference:
    if not isinstance(node, Scalar) or node.null:
        diagnostic = Diagnostic(Severity.ERROR, "a path was expected", node.mark, "", "path")
        return Reference("", None, node.mark, diagnostic)
    try:
        path = resolver.resolve(node.text, base, node.mark)
    except ResolutionError as error:
        return Reference(node.text, None, node.mark, error.diagnostic)
    if not path.is_file():
        diagnostic = Diagnostic(
            Severity.ERROR, f"'{node.text}' does not exist", node.mark, f"looked for {path}", "path"
        )
        return Reference(node.text, None, node.mark, diagnostic)
    return Reference(node.text, path, node.mark)


__all__ = [
    "AdfError",
    "LaunchDocument",
    "Reference",
    "kind_of",
    "read_any",
    "read_devices",
    "read_launch",
    "read_model",
    "read_world",
]
