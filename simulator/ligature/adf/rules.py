"""What single keys cannot show about an element: keys that need each other, and values without effect.

Each rule takes an element whose keys are sound and returns findings. Codes are those of `checker`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator

from ligature.adf.diagnostics import Diagnostic, Severity
from ligature.adf.document import Element
from ligature.adf.nodes import Mapping, Node, Scalar, Sequence
from ligature.adf.schema import CLIPPING, SHAPE_KEYS
from ligature.adf.schema.keys import FARTHEST

Rule = Callable[[Element], Iterator[Diagnostic]]

_ROS_NAME = re.compile(r"[A-Za-z0-9_/]*\Z")
_SPRINGS = ("linear spring", "torsion spring")
_SIX_DOF = ("six dof", "six dof spring")
_LIMITED = ("revolute", "prismatic", *_SPRINGS)
_RAYS = ("PROXIMITY", "RESISTANCE")

PLUGIN_OWNERS = ("launch", "world", "model", "body")
"""Kinds of files and objects whose plug-ins are run."""

LIBRARIES = (".so", ".dll", ".dylib")
"""Ends of the file names of AMBF's plug-ins, which are compiled."""


def _finding(
    element: Element, severity: Severity, path: str, message: str, hint: str = "", code: str = "effect"
) -> Diagnostic:
    text = f"{element.kind} '{element.key}' {message}"
    return Diagnostic(severity, text, element.mark_of(path), hint, code)


def names(element: Element) -> Iterator[Diagnostic]:
    """Objects with topics need a name that ROS takes."""
    name = element.text("name").replace(" ", "")
    if not name:
        yield _finding(element, Severity.WARNING, "name", "has no name, so its topic has none", "add name: …", "name")
    elif not _ROS_NAME.match(name) and not element.flag("passive"):
        hint = "letters, digits and '_' make a topic"
        yield _finding(element, Severity.WARNING, "name", f"is called '{name}'", hint, "name")
    yield from namespaces(element)


def namespaces(element: Element) -> Iterator[Diagnostic]:
    """Namespace and name are concatenated as they are."""
    namespace = element.text("namespace")
    if namespace and not namespace.endswith("/"):
        hint = f"write '{namespace}/'"
        yield _finding(element, Severity.INFO, "namespace", "has a namespace without '/' at its end", hint, "name")


def version(element: Element) -> Iterator[Diagnostic]:
    """Files of another version than 1.0 are none of this format."""
    if element.has("adf version") and element.text("adf version") != "1.0":
        message = "'adf version' is not 1.0"
        yield Diagnostic(Severity.ERROR, message, element.mark_of("adf version"), "write 1.0", "version")


def frequencies(element: Element) -> Iterator[Diagnostic]:
    """Rates of publishing."""
    low, high = element.integer("publish frequency.low"), element.integer("publish frequency.high")
    if low > high:
        message = f"has a low publish frequency of {low} Hz, above the high one of {high} Hz"
        yield _finding(element, Severity.WARNING, "publish frequency", message, "set low to at most high")


def plugins(element: Element) -> Iterator[Diagnostic]:
    """Plug-in entries need a name and a file; compiled ones are reported where the others are looked for."""
    node = element.node.get("plugins")
    if node is None or (isinstance(node, Scalar) and node.null):
        return
    entries = node.items if isinstance(node, Sequence) else [node]
    for entry in entries:
        if not isinstance(entry, Mapping) or not {"name", "filename"} <= set(entry.entries):
            message = f"a plug-in of {element.kind} '{element.key}' lacks name or filename"
            yield Diagnostic(Severity.WARNING, message, entry.mark, "it is left out", "plugin")
    if entries and element.kind not in PLUGIN_OWNERS:
        hint = "those of launch, world and model files and of bodies are"
        yield _finding(element, Severity.INFO, "plugins", "has plug-ins, which are not run", hint, "plugin")
    elif not all(_is_compiled(entry) for entry in entries):
        hint = "--allow-plugins runs those in Python"
        yield _finding(element, Severity.INFO, "plugins", "has plug-ins", hint, "plugin")


def _is_compiled(entry: Node) -> bool:
    file = entry.get("filename") if isinstance(entry, Mapping) else None
    return isinstance(file, Scalar) and file.text.endswith(LIBRARIES)


def colours(element: Element) -> Iterator[Diagnostic]:
    """Components of colours are 0 to 1; those of old colour files were 0 to 255."""
    paths = [f"color rgba.{c}" for c in "rgba"]
    paths += [f"color components.{part}.{c}" for part in ("diffuse", "specular", "emission") for c in "rgb"]
    beyond = [path for path in paths if element.has(path) and not 0.0 <= element.number(path) <= 1.0]
    if beyond:
        message = f"has {element.number(beyond[0]):g} as '{beyond[0]}'"
        yield _finding(element, Severity.WARNING, beyond[0], message, "colours are 0 to 1; divide those of 255 by 255")


def followed(element: Element) -> Iterator[Diagnostic]:
    """AMBF of October 2024 and later places bodies in the frame of a parent; files for it would fall apart."""
    if element.text("parent"):
        message = f"has the parent '{element.text('parent')}', which only AMBF since October 2024 follows"
        hint = "its location is read in the world frame; join it by a fixed joint"
        yield _finding(element, Severity.WARNING, "parent", message, hint)


def shapes(element: Element) -> Iterator[Diagnostic]:
    """A primitive needs the dimensions of its kind."""
    for shape, geometry in (("shape", "geometry"), ("collision shape", "collision geometry")):
        if element.has(shape):
            yield from _dimensions(element, shape, geometry)
    for block in ("compound shape", "compound collision shape"):
        items = element.children(block)
        if element.has(block) and not items:
            message = f"has an empty '{block}'"
            yield _finding(element, Severity.ERROR, block, message, "list primitives or remove it", "left out")
        for item in items:
            yield from _dimensions(item, "shape", "geometry")


def _dimensions(element: Element, shape: str, geometry: str) -> Iterator[Diagnostic]:
    kind = element.text(shape)
    lacking = [key for key in SHAPE_KEYS[kind] if not element.has(f"{geometry}.{key}")]
    if lacking:
        message = f"is a {kind} without '{', '.join(lacking)}' in '{geometry}'"
        path = geometry if element.has(geometry) else shape
        yield _finding(element, Severity.ERROR, path, message, f"a {kind} has {', '.join(SHAPE_KEYS[kind])}", "missing")


def joint_limits(element: Element) -> Iterator[Diagnostic]:
    """Limits count when both ends are given; those of a cone twist have three angles."""
    kind = element.value("type")
    has_low, has_high = element.has("joint limits.low"), element.has("joint limits.high")
    if kind in _LIMITED and has_low != has_high:
        message = f"has only '{'low' if has_low else 'high'}' of its limits, so it is unlimited"
        yield _finding(element, Severity.WARNING, "joint limits", message, "set low and high")
    if kind in _LIMITED and has_low and has_high:
        low, high = element.number("joint limits.low"), element.number("joint limits.high")
        if low > high:
            message = f"has the limits {low:g} to {high:g}, so it is unlimited"
            yield _finding(element, Severity.WARNING, "joint limits", message, "set low to at most high")
        elif low > FARTHEST or high < -FARTHEST:
            message = f"has the limits {low:g} to {high:g}, where it cannot be; they are left out"
            yield _finding(element, Severity.WARNING, "joint limits", message, f"set them within {FARTHEST:g}")
    if kind in _SPRINGS and not (has_low and has_high):
        hint = "set joint limits: {low, high}"
        yield _finding(element, Severity.WARNING, "type", f"is a {kind} without limits, which locks it", hint)
    lacking = [axis for axis in "xyz" if not element.has(f"joint limits.{axis}")]
    if kind == "cone twist" and element.has("joint limits") and lacking:
        message = f"is a cone twist without '{', '.join(lacking)}' in 'joint limits'"
        yield _finding(element, Severity.ERROR, "joint limits", message, "set half angles x, y, z", "missing")


def joint_springs(element: Element) -> Iterator[Diagnostic]:
    """A six-DOF joint has blocks of stiffness and damping, all others have numbers."""
    kind = element.value("type")
    for path in ("damping", "stiffness", "equilibrium point"):
        if not element.has(path):
            continue
        block = isinstance(element.node.get(path), Mapping)
        if kind in _SIX_DOF and not block:
            hint = f"write {path}: {{linear: {{x, y, z}}, angular: {{x, y, z}}}}"
            yield _finding(element, Severity.WARNING, path, f"is a {kind} joint with one number as '{path}'", hint)
        elif kind not in _SIX_DOF and block:
            message = f"is a {kind or 'revolute'} joint with a block as '{path}'"
            yield _finding(element, Severity.ERROR, path, message, "give one number", "value")
        elif kind not in _SIX_DOF and kind not in _SPRINGS:
            message = f"is a {kind or 'revolute'} joint, so '{path}' has no effect"
            yield _finding(element, Severity.DEBUG, path, message)
    if kind in _SPRINGS and not element.has("stiffness"):
        yield _finding(element, Severity.INFO, "type", f"is a {kind} without 'stiffness'; it is 0")


def joint_without_effect(element: Element) -> Iterator[Diagnostic]:
    """Keys that a fixed joint reads and does not use."""
    if element.value("type") == "fixed":
        for path in ("joint limits", "controller", "max motor impulse", "controller output type"):
            if element.has(path):
                yield _finding(element, Severity.DEBUG, path, f"is fixed, so '{path}' has no effect")
    if element.has("offset") and element.has("child offset"):
        yield _finding(
            element, Severity.WARNING, "child offset", "also has 'offset', which takes precedence", "remove one"
        )


def sensor_rays(element: Element) -> Iterator[Diagnostic]:
    """A ray sensor needs rays, a contact sensor a distance."""
    if element.text("type") in _RAYS:
        if not any(element.has(path) for path in ("array", "mesh", "parametric")):
            hint = "add 'array', 'mesh' or 'parametric'"
            yield _finding(element, Severity.WARNING, "type", "has no rays and is left out", hint)
    elif element.number("distance threshold") < 0.0:
        yield _finding(
            element,
            Severity.WARNING,
            "distance threshold",
            "has a negative 'distance threshold'",
            "use 0 to detect contact",
        )


def camera_view(element: Element) -> Iterator[Diagnostic]:
    """A camera needs a viewing direction, clipping planes in order, and publish intervals from 1."""
    ahead = [a - b for a, b in zip(element.vector("look at"), element.vector("location"), strict=True)]
    up = element.vector("up")
    across = (
        ahead[1] * up[2] - ahead[2] * up[1],
        ahead[2] * up[0] - ahead[0] * up[2],
        ahead[0] * up[1] - ahead[1] * up[0],
    )
    if math.hypot(*across) <= 1e-12 * max(math.hypot(*ahead) * math.hypot(*up), 1e-12):
        hint = "'look at' must differ from 'location', and 'up' must not be parallel to the line of sight"
        yield _finding(element, Severity.WARNING, "look at", "has no viewing direction, so it has no orientation", hint)
    near, far = element.number("clipping plane.near"), element.number("clipping plane.far")
    if not 0.0 < near < far:
        message = f"has its near clipping plane at {near:g} m and its far one at {far:g} m"
        hint = f"give 0 < near < far; {CLIPPING[0]:g} m and {CLIPPING[1]:g} m are taken"
        yield _finding(element, Severity.WARNING, "clipping plane", message, hint)
    for path in ("publish image interval", "publish depth interval"):
        if element.integer(path) == 0:
            yield _finding(element, Severity.WARNING, path, f"has 0 as '{path}'; using 1", "count from 1")


def wheels(element: Element) -> Iterator[Diagnostic]:
    """A wheel needs something that shows it."""
    for wheel in element.children("wheels"):
        if not wheel.text("body") and not wheel.text("mesh"):
            yield _finding(wheel, Severity.WARNING, "body", "has neither body nor mesh", "it is left out")


def device_target(element: Element) -> Iterator[Diagnostic]:
    """A device needs something to drive."""
    if not element.text("simulated multibody") and not element.text("root link"):
        hint = "give 'root link' or 'simulated multibody'"
        yield _finding(element, Severity.ERROR, "hardware name", "has nothing to drive", hint, "left out")
    if element.number("deadband") < 0.0:
        yield _finding(element, Severity.WARNING, "deadband", "has a negative deadband", "0 is taken")


def world_surroundings(element: Element) -> Iterator[Diagnostic]:
    """What a world file should name."""
    if not element.text("environment"):
        hint = "AMBF cannot run without one"
        yield _finding(element, Severity.WARNING, "environment", "names no environment", hint)
    faces = ("right", "left", "top", "bottom", "front", "back")
    lacking = [face for face in faces if not element.text(f"skybox.{face}")]
    if element.has("skybox") and lacking:
        message = f"has a skybox without {', '.join(lacking)}"
        yield _finding(element, Severity.WARNING, "skybox", message, "ignoring it; set all six")


_COMMON: tuple[Rule, ...] = (names, frequencies, plugins)
RULES: dict[str, tuple[Rule, ...]] = {
    "launch": (plugins, version),
    "world": (namespaces, world_surroundings, plugins, version),
    "model": (namespaces, plugins, version),
    "input devices": (version,),
    "body": (*_COMMON, shapes, colours, followed),
    "joint": (plugins, joint_limits, joint_springs, joint_without_effect),
    "ghost object": (*_COMMON, shapes, colours),
    "sensor": (*_COMMON, sensor_rays),
    "actuator": _COMMON,
    "camera": (*_COMMON, camera_view),
    "light": _COMMON,
    "soft body": (namespaces, plugins, shapes, colours),
    "vehicle": (*_COMMON, wheels),
    "volume": (namespaces, plugins, colours),
    "input device": (device_target,),
}
"""Rules of each kind of file and object."""


def rule_findings(element: Element) -> list[Diagnostic]:
    """What the rules of its kind state about an element whose keys are sound."""
    return [finding for rule in RULES.get(element.kind, ()) for finding in rule(element)]
