"""Reads launch, world, model and input-device files into documents.

Nothing is skipped in silence: what is not usable, unknown or without effect is a finding with its
place. A bad value costs the object that holds it; in strict mode, the file, as with AMBF. Files are
opened through a `Resolver` only.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ligature.adf.contents import content_of
from ligature.adf.diagnostics import AdfError, Diagnostic, Mark, Severity
from ligature.adf.document import Document, Element, listed_items, own_element
from ligature.adf.findings import MODELS, findings_of, no_path, refused
from ligature.adf.lacking import lack_of
from ligature.adf.nodes import Mapping, Node, Scalar, Sequence, parse
from ligature.adf.resolver import ResolutionError, Resolver

MAX_TEXT = 64 * 1024 * 1024
"""Largest scene file in bytes; the largest real one has 300 kB."""


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
    """Read a launch file; parameters and errors are those of `read_any`: ``path``, ``resolver``, ``strict``."""
    return _launch(_opened(path, resolver), resolver, strict)


def read_world(path: Path, resolver: Resolver, strict: bool = False) -> Document:
    """Read a world file; parameters and errors are those of `read_any`: ``path``, ``resolver``, ``strict``."""
    return _document(_opened(path, resolver), "world", strict)


def read_model(path: Path, resolver: Resolver, strict: bool = False) -> Document:
    """Read a model file; parameters and errors are those of `read_any`: ``path``, ``resolver``, ``strict``."""
    return _document(_opened(path, resolver), "model", strict)


def read_devices(path: Path, resolver: Resolver, strict: bool = False) -> Document:
    """Read an input-devices file; parameters and errors are those of `read_any`: ``path``, ``resolver``, ``strict``."""
    return _document(_opened(path, resolver), "input devices", strict)


def read_any(path: Path, resolver: Resolver, strict: bool = False) -> Document:
    """Read a file of any kind, distinguished by its keys.

    Parameters
    ----------
    path
        The file.
    resolver
        Opens it and the files that it names, below its roots alone.
    strict
        Reject what AMBF rejects, instead of the sane reading with a warning.

    Returns
    -------
    Document
        Of the class of its kind, such as `LaunchDocument`; what is wrong in it is in ``diagnostics``.

    Raises
    ------
    AdfError
        When the file is not readable at all.
    """
    source = _opened(path, resolver)
    kind = kind_of(source.root)
    if kind == "launch":
        return _launch(source, resolver, strict)
    if kind == "colors":
        return Document(source.path, kind, source.text, source.root, Element("model", source.path.name, source.root))
    return _document(source, kind, strict)


def kind_of(root: Mapping) -> str:
    """Which of the four kinds of file the top-level keys make it; colours files are ``colors``."""
    keys = set(root.entries)
    if "multibody configs" in keys or "world config" in keys:
        return "launch"
    if "input devices" in keys:
        return "input devices"
    if keys & {"environment", "enclosure", "enclosure size", "max iterations", "skybox"} and "bodies" not in keys:
        return "world"
    values = [value for _, value in root.entries.values()]
    if values and all(isinstance(v, Mapping) and {"r", "g", "b"} <= set(v.entries) for v in values):
        return "colors"
    return "model"


def read_text(text: str, path: Path, kind: str) -> Document:
    """A world, model or input-devices file of ``kind`` from its text; ``path`` is where it would be."""
    return _document(_Source(path, text, parse(text, path)), kind, strict=False)


@dataclass(frozen=True)
class _Source:
    """A file that was read and parsed."""

    path: Path
    text: str
    root: Mapping


def _opened(path: Path, resolver: Resolver) -> _Source:
    real = resolver.allow(Path(path))
    try:
        text = resolver.read_text(real, MAX_TEXT)
        return _Source(real, text, parse(text, real))
    except AdfError:
        content = _content(real, resolver)
        if content is None:
            raise
        message = f"'{path}' is {content[0]}, not a scene file"
        raise AdfError(Diagnostic(Severity.ERROR, message, Mark(real, 1, 1), content[1], "yaml")) from None


def _content(path: Path, resolver: Resolver) -> tuple[str, str] | None:
    """What a file is that cannot be read as YAML, and what to do with it; None for what is not known."""
    try:
        return content_of(resolver.read_bytes(path, MAX_TEXT))
    except ResolutionError:
        return None


def _launch(source: _Source, resolver: Resolver, strict: bool) -> LaunchDocument:
    launch = LaunchDocument(**vars(_document(source, "launch", strict)))
    launch.world = _reference(launch, "world config", resolver)
    launch.devices = _reference(launch, "input devices config", resolver)
    launch.colours = _reference(launch, "color config", resolver)
    node = launch.top.node.get(MODELS)
    if isinstance(node, Sequence):
        launch.models = tuple(_resolved(item, launch.path.parent, resolver) for item in node.items)
    return launch


def _document(source: _Source, kind: str, strict: bool) -> Document:
    """Gather the file's own keys and the objects that it lists, check all, and keep what is sound."""
    own = own_element(kind, source.root, source.path.name)
    items = listed_items(kind, source.root)
    top, found = findings_of(own, items, source.root, strict)
    document = Document(source.path, kind, source.text, source.root, top, diagnostics=found)
    if strict and (refusal := refused(found)):
        document.diagnostics.append(refusal)
        document.refused = True
        return document
    for name in dict.fromkeys(item.list_name for item in items):
        sound = (item.first.element for item in items if item.list_name == name and item.first is not None)
        document.lists[name] = tuple(element for element in sound if element is not None)
    return document


def _reference(document: Document, name: str, resolver: Resolver) -> Reference | None:
    node = document.top.node.get(name)
    return None if node is None else _resolved(node, document.path.parent, resolver)


def _resolved(node: Node, base: Path, resolver: Resolver) -> Reference:
    if not isinstance(node, Scalar) or node.null:
        return Reference("", None, node.mark, no_path(node))
    try:
        path = resolver.resolve(node.text, base, node.mark)
    except ResolutionError as error:
        return Reference(node.text, None, node.mark, error.diagnostic)
    lack = lack_of(path)
    if lack is not None:
        message = f"'{node.text}' {lack.fault}"
        diagnostic = Diagnostic(Severity.ERROR, message, node.mark, lack.hint or f"looked for {path}", "path")
        return Reference(node.text, None, node.mark, diagnostic)
    return Reference(node.text, path, node.mark)
