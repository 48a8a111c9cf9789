"""Reads launch, world, model and input-device files into documents.

Nothing is skipped in silence: what is not usable, unknown or without effect is a finding with its
place. A bad value costs the object that holds it; in strict mode, the file, as with AMBF. Files are
opened through a `Resolver` only.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from ligature.adf.checker import (
    MAX_FINDINGS,
    errors,
    key_problems,
    missing_keys,
    problems,
    repeated_keys,
    suggestion,
)
from ligature.adf.contents import content_of
from ligature.adf.diagnostics import AdfError, Diagnostic, Mark, Severity
from ligature.adf.document import Document, Element
from ligature.adf.lacking import lack_of
from ligature.adf.nodes import Mapping, Node, Scalar, Sequence, parse
from ligature.adf.resolver import ResolutionError, Resolver
from ligature.adf.rules import rule_findings
from ligature.adf.schema import BY_PATH, LISTS, NOT_SIMULATED, SCHEMA, Key, Type

MAX_TEXT = 64 * 1024 * 1024
"""Largest scene file in bytes; the largest real one has 300 kB."""

REFUSING = ("value", "missing", "version")
"""Codes of the findings for which AMBF refuses a whole file."""

MODELS = "multibody configs"
"""Key of the list of model files of a launch file."""

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
    top, found = _top(source, kind)
    document = Document(source.path, kind, source.text, source.root, top, diagnostics=found)
    document.diagnostics += _other_keys(source.root, kind)
    for name in LISTS:
        if name in BY_PATH[kind]:
            document.lists[name] = _elements(document, name, strict)
    if strict:
        _refuse_as_ambf(document)
    return document


def _top(source: _Source, kind: str) -> tuple[Element, list[Diagnostic]]:
    """The file's own keys, without those that hold an error, and the findings about them."""
    own = {name: entry for name, entry in source.root.entries.items() if name in BY_PATH[kind]}
    element = Element(kind, source.path.name, replace(source.root, entries=own, duplicates=[]))
    found = [*repeated_keys(source.root), *missing_keys(element)]
    sound = {}
    for name, entry in own.items():
        listing = isinstance(entry[1], Sequence) and (name in LISTS or name == MODELS)
        of_key = _unnamed(element, name, entry[1]) if listing else key_problems(element, name)
        found += of_key
        if listing or not errors(of_key):
            sound[name] = entry
    top = Element(kind, source.path.name, replace(source.root, entries=sound, duplicates=[]))
    return top, [*found, *rule_findings(top)]


def _unnamed(element: Element, name: str, listing: Node) -> list[Diagnostic]:
    """Errors about the items of a list of names that are none; the others are used."""
    assert isinstance(listing, Sequence)
    others = [item for item in listing.items if not isinstance(item, Scalar) or item.null]
    return [_no_name(name, item) for item in others[:MAX_FINDINGS]]


def _no_name(name: str, item: Node) -> Diagnostic:
    what = "a path" if name == MODELS else "the name of an object"
    message = f"an item of '{name}' is not {what}"
    return Diagnostic(Severity.ERROR, message, item.mark, f"write {what} or remove the item", "value")


def _listed(root: Mapping, kind: str) -> set[str]:
    names: set[str] = set()
    for list_name in LISTS:
        node = root.get(list_name)
        if list_name in BY_PATH[kind] and isinstance(node, Sequence):
            names |= {item.text for item in node.items if isinstance(item, Scalar)}
    return names


def _other_keys(root: Mapping, kind: str) -> list[Diagnostic]:
    """Findings about top-level keys that are neither the file's own nor listed objects, such as typing errors."""
    listed = _listed(root, kind)
    found: list[Diagnostic] = []
    for name, (key, node) in root.entries.items():
        if name in BY_PATH[kind] or name in listed or len(found) > MAX_FINDINGS:
            continue
        found.append(_other_key(name, key, node, kind))
    return found


def _other_key(name: str, key: Scalar, node: Node, kind: str) -> Diagnostic:
    meant = suggestion(name, [key.name for key in SCHEMA[kind] if _may_hold(key, node)])
    if _holds_anchor(node):
        return Diagnostic(Severity.DEBUG, f"'{name}' only holds values for aliases", key.mark, "", "unlisted")
    if isinstance(node, Mapping) and not meant:
        message = f"'{name}' is defined but not listed, so it does not exist"
        return Diagnostic(Severity.DEBUG, message, key.mark, "", "unlisted")
    message = f"unknown key '{name}' in {kind} file"
    return Diagnostic(Severity.WARNING, message, key.mark, meant or "it has no effect", "unknown")


def _may_hold(key: Key, node: Node) -> bool:
    """Whether the value is of a form that the key takes: a block of an unlisted object is not a misspelled list."""
    return isinstance(node, Mapping) == (key.type in (Type.MAP, Type.VECTOR, Type.POSE))


def _holds_anchor(node: Node) -> bool:
    if node.anchor:
        return True
    inner: list[Node] = []
    if isinstance(node, Mapping):
        inner = [value for name, (_, value) in node.entries.items() if not node.aliased(name)]
    elif isinstance(node, Sequence):
        inner = [item for item, use in zip(node.items, node.uses, strict=True) if use == item.span]
    return any(map(_holds_anchor, inner))


def _elements(document: Document, list_name: str, strict: bool) -> tuple[Element, ...]:
    """The usable objects of one list; an object that is listed twice is checked once and returned twice."""
    node = document.top.node.get(list_name)
    checked: dict[str, Element | None] = {}
    elements = []
    for item in node.items if isinstance(node, Sequence) else []:
        if not isinstance(item, Scalar) or item.null:
            continue
        if len(document.diagnostics) > MAX_FINDINGS:
            message = f"more than {MAX_FINDINGS} findings; the rest of the file is not read"
            document.diagnostics.append(Diagnostic(Severity.ERROR, message, item.mark, "", "too many"))
            break
        if item.text in checked:
            message = f"'{item.text}' is listed twice in '{list_name}', so it exists twice"
            document.diagnostics.append(Diagnostic(Severity.INFO, message, item.mark, "", "repeated"))
        else:
            checked[item.text] = _element(document, item, LISTS[list_name], strict)
        element = checked[item.text]
        if element is not None:
            elements.append(element)
    return tuple(elements)


def _element(document: Document, item: Scalar, kind: str, strict: bool) -> Element | None:
    node = document.root.get(item.text)
    if not isinstance(node, Mapping):
        document.diagnostics.append(_undefined(document, item, node, kind))
        return None
    element = Element(kind, item.text, node)
    found = problems(element)
    if kind == "joint":
        found = [*found, *_lone_motor(element)] if strict else _typeless_is_revolute(element, found)
    if not errors(found):
        found = [*found, *rule_findings(element)]
    document.diagnostics += found
    if errors(found):
        return None
    if kind in NOT_SIMULATED:
        message = f"{kind} '{item.text}' is read and checked, but not simulated"
        document.diagnostics.append(Diagnostic(Severity.WARNING, message, node.mark, "", "not simulated"))
    return element


def _undefined(document: Document, item: Scalar, node: Node | None, kind: str) -> Diagnostic:
    """AMBF makes a default body, camera or light, and refuses the file for a joint."""
    severity = Severity.WARNING if kind in _DEFAULTED or (isinstance(node, Scalar) and node.null) else Severity.ERROR
    if node is not None:
        message, hint = f"{kind} '{item.text}' is listed, but its definition is not a block of keys", "it is left out"
        return Diagnostic(severity, message, node.mark, hint, "undefined")
    others = {name for name in document.root.entries if name not in BY_PATH[document.kind]}
    hint = suggestion(item.text, others - _listed(document.root, document.kind)) or "define it or take it from the list"
    message = f"{kind} '{item.text}' is listed but not defined"
    return Diagnostic(severity, message, item.mark, hint, "missing" if kind == "joint" else "undefined")


def _lone_motor(element: Element) -> list[Diagnostic]:
    """AMBF evaluates 'enable feedback' when 'enable motor' is there, and fails without it."""
    if not element.has("enable motor") or element.has("enable feedback"):
        return []
    message = f"joint '{element.key}' has 'enable motor' without 'enable feedback'"
    return [Diagnostic(Severity.ERROR, message, element.mark_of("enable motor"), "remove 'enable motor'", "missing")]


def _typeless_is_revolute(element: Element, found: list[Diagnostic]) -> list[Diagnostic]:
    """A joint without type is an old revolute one."""
    if element.has("type"):
        return found
    others = [d for d in found if not (d.code == "missing" and "the key 'type'" in d.message)]
    message = f"joint '{element.key}' has no 'type'; using revolute"
    return [*others, Diagnostic(Severity.WARNING, message, element.mark, "add type: revolute", "type")]


def _refuse_as_ambf(document: Document) -> None:
    """Drop everything when one finding makes AMBF refuse the file, and state which."""
    causes = [d for d in document.diagnostics if d.severity >= Severity.ERROR and d.code in REFUSING]
    if causes:
        message = f"AMBF refuses the whole file for {len(causes)} of these errors"
        document.diagnostics.append(Diagnostic(Severity.ERROR, message, causes[0].mark, causes[0].message, "refused"))
        document.refused = True
        document.lists = {}


def _reference(document: Document, name: str, resolver: Resolver) -> Reference | None:
    node = document.top.node.get(name)
    return None if node is None else _resolved(node, document.path.parent, resolver)


def _resolved(node: Node, base: Path, resolver: Resolver) -> Reference:
    if not isinstance(node, Scalar) or node.null:
        return Reference("", None, node.mark, _no_name(MODELS, node))
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
