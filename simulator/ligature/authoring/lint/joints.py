"""Checks of joints: their ends, limits, springs, axes, and whether they hold where the bodies stand."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ligature.adf import Element, Severity
from ligature.adf.diagnostics import length
from ligature.adf.frames import Array, inverse, joint_frames
from ligature.authoring.lint.subject import Finding, Subject, rule
from ligature.authoring.placement import matrix_of

MASS_RATIO = 100.0
LEAST_ELEMENTS = 4
"""Bodies from which a chain is a thread."""

RESIDUAL_M, RESIDUAL_RAD = 1e-3, 5e-3
"""Allowed error of a joint at rest: real files have the rounding errors of single precision and of old exporters."""

_SPRINGS = ("linear spring", "torsion spring")


def _ends(subject: Subject) -> Iterator[tuple[Element, Element, Element]]:
    for joint in subject.joints:
        parent, child = subject.body(joint.text("parent")), subject.body(joint.text("child"))
        if parent is not None and child is not None:
            yield joint, parent, child


@rule("reference-unresolved")
def reference_unresolved(subject: Subject) -> Iterator[Finding]:
    """A reference without a namespace must be found in the file; one with a namespace may lie in another."""
    for element in subject.objects:
        names = ("parent", "child") if element.kind == "joint" else ("parent",)
        if element.kind not in ("joint", "sensor", "actuator", "ghost object", "suture"):
            continue
        for name in names:
            text = element.text(name)
            if not text or subject.body(text) is not None:
                continue
            if "/" in text:
                message = f"its {name} '{text}' is expected in another file"
                hint = "that file must come earlier in the launch file, under that namespace"
                yield Finding("reference-elsewhere", Severity.INFO, element.key, message, hint)
            else:
                message = f"its {name} '{text}' does not name exactly one body of this file"
                yield Finding("reference-unresolved", Severity.ERROR, element.key, message, "give a body's identifier")


@rule("static-child")
def static_child(subject: Subject) -> Iterator[Finding]:
    """A joint cannot move a body without mass."""
    for joint, _, child in _ends(subject):
        if joint.value("type") != "fixed" and not subject.moves(child):
            message = f"its child '{child.key}' has no mass, so nothing can move it"
            yield Finding("static-child", Severity.ERROR, joint.key, message, "give the child a mass, or fix the joint")


def thread_elements(subject: Subject) -> set[str]:
    """Keys of the bodies that a scene will simulate as elements of threads: see `ligature.model.rods`."""
    if not subject.document.top.flag("ligature rod"):
        return set()
    ends = list(_ends(subject))
    out = {body.key for joint, *bodies in ends if not joint.flag("ligature rod") for body in bodies}
    fit = {key for key, body in subject.bodies.items() if body.flag("ligature rod") and _round(subject, body)} - out
    neighbours: dict[str, list[str]] = {}
    for joint, parent, child in ends:
        if {parent.key, child.key} <= fit and _bends(joint):
            neighbours.setdefault(parent.key, []).append(child.key)
            neighbours.setdefault(child.key, []).append(parent.key)
    elements: set[str] = set()
    for start, beside in neighbours.items():
        chain, ahead = [start], beside if len(beside) == 1 else []
        while len(ahead) == 1:
            chain += ahead
            beside = neighbours[chain[-1]]
            ahead = [key for key in beside if key not in chain] if len(beside) <= 2 else []
        if len(chain) >= LEAST_ELEMENTS:
            elements |= set(chain)
    return elements


def _round(subject: Subject, body: Element) -> bool:
    shapes = subject.shapes(body)
    return subject.moves(body) and [shape.kind for shape, _ in shapes] in (["CAPSULE"], ["CYLINDER"], ["SPHERE"])


def _bends(joint: Element) -> bool:
    """Whether a joint is a spring that bends and does not stretch."""
    pairs = _limit_pairs(joint)[:3]
    return joint.value("type") == "six dof spring" and all(joint.number(a) == joint.number(b) for a, b in pairs)


@rule("mass-ratio")
def mass_ratio(subject: Subject) -> Iterator[Finding]:
    """Solvers that iterate do not converge across large ratios; that of a thread solves its joints directly."""
    threads = thread_elements(subject)
    for joint, parent, child in _ends(subject):
        if threads & {parent.key, child.key}:
            continue
        a, b = parent.number("mass"), child.number("mass")
        if min(a, b) > 0.0 and max(a, b) > MASS_RATIO * min(a, b):
            message = f"it connects {a:g} kg and {b:g} kg, a ratio of {max(a, b) / min(a, b):.3g}"
            yield Finding("mass-ratio", Severity.WARNING, joint.key, message, "keep masses within a factor of 100")


@rule("limits-reversed")
def limits_reversed(subject: Subject) -> Iterator[Finding]:
    """Low above high: a revolute joint is then free, a six-DOF axis too."""
    for joint in subject.joints:
        for low, high in _limit_pairs(joint):
            a, b = joint.number(low), joint.number(high)
            if joint.has(low) and joint.has(high) and a > b:
                message = f"'{low}' is {a:g} and '{high}' is {b:g}, so the axis is free"
                yield Finding("limits-reversed", Severity.ERROR, joint.key, message, "swap them", {low: b, high: a})


def _limit_pairs(joint: Element) -> list[tuple[str, str]]:
    if str(joint.value("type")).startswith("six dof"):
        return [
            (f"joint limits.{h}.low.{a}", f"joint limits.{h}.high.{a}") for h in ("linear", "angular") for a in "xyz"
        ]
    return [("joint limits.low", "joint limits.high")] if joint.value("joint limits.low") is not None else []


@rule("spring-without-stiffness")
def spring_without_stiffness(subject: Subject) -> Iterator[Finding]:
    """A spring joint has a stiffness."""
    for joint in subject.joints:
        if joint.value("type") in ("six dof spring", *_SPRINGS) and not joint.has("stiffness"):
            hint = "add 'stiffness', or take the joint without spring"
            yield Finding(
                "spring-without-stiffness", Severity.ERROR, joint.key, "it is a spring without stiffness", hint
            )


@rule("equilibrium-outside")
def equilibrium_outside(subject: Subject) -> Iterator[Finding]:
    """A spring at rest outside its limits pushes against them for ever."""
    for joint in subject.joints:
        low, high = joint.value("joint limits.low"), joint.value("joint limits.high")
        if joint.value("type") not in _SPRINGS or low is None or high is None or not joint.has("equilibrium point"):
            continue
        rest = joint.value("equilibrium point")
        if isinstance(rest, float) and not low <= rest <= high:
            message = f"its equilibrium {rest:g} lies outside its limits {low:g} to {high:g}"
            yield Finding(
                "equilibrium-outside", Severity.WARNING, joint.key, message, "linear springs take metres, not degrees"
            )


@rule("travel-too-long")
def travel_too_long(subject: Subject) -> Iterator[Finding]:
    """A slider much longer than the model has its limits in another unit."""
    places = np.array([b.pose("location")[0] for b in subject.bodies.values()])
    size = float(np.ptp(places, axis=0).max()) if len(places) > 1 else 0.0
    for joint in subject.joints:
        low, high = joint.value("joint limits.low"), joint.value("joint limits.high")
        if joint.value("type") == "prismatic" and low is not None and high is not None and size > 0.0:
            longest = max(abs(low), abs(high))
            if longest > 10.0 * size:
                message = f"it moves by {longest:g} m in a model of {size:.3g} m"
                yield Finding("travel-too-long", Severity.WARNING, joint.key, message, "limits of sliders are metres")


@rule("axes-nearly-antiparallel")
def axes_nearly_antiparallel(subject: Subject) -> Iterator[Finding]:
    """Between 3.13 and π loaders choose different turns."""
    for joint, parent, child in _ends(subject):
        a = _turn(parent).T @ np.asarray(joint.vector("parent axis"))
        b = _turn(child).T @ np.asarray(joint.vector("child axis"))
        product = np.linalg.norm(a) * np.linalg.norm(b)
        if product == 0.0:
            yield Finding(
                "axis-zero", Severity.ERROR, joint.key, "an axis is zero", "set a direction of non-zero length"
            )
            continue
        angle = float(np.arccos(np.clip(a @ b / product, -1.0, 1.0)))
        if 3.13 < angle < np.pi - 1e-6:
            message = f"its axes are {angle:.5f} rad apart, where simulators disagree about the rotation of the child"
            yield Finding(
                "axes-nearly-antiparallel", Severity.WARNING, joint.key, message, "make them exactly antiparallel"
            )


def _turn(body: Element) -> Array:
    return matrix_of(body.value("inertial offset"))[:3, :3]


@rule("joint-residual")
def joint_residual(subject: Subject) -> Iterator[Finding]:
    """A joint that does not meet at rest tears its bodies into place."""
    for joint, parent, child in _ends(subject):
        kind = joint.value("type") or "revolute"
        if not any(joint.vector("parent axis")) or not any(joint.vector("child axis")):
            continue
        metres, radians = residual(joint, kind, parent, child)
        if metres > RESIDUAL_M or radians > RESIDUAL_RAD:
            message = f"it is off by {length(metres)} and {radians:.3g} rad at the poses of its bodies"
            hint = "move the child to where the joint holds it, or solve the joint again"
            yield Finding("joint-residual", Severity.ERROR, joint.key, message, hint)


def residual(joint: Element, kind: str, parent: Element, child: Element) -> tuple[float, float]:
    """Metres and radians by which the bodies' places violate a joint, its free axes aside."""
    T_pi, T_ci = matrix_of(parent.value("inertial offset")), matrix_of(child.value("inertial offset"))
    offset = joint.value("offset")
    frames = joint_frames(
        T_pi, T_ci,
        np.asarray(joint.vector("parent pivot")) * parent.number("scale"),
        np.asarray(joint.vector("child pivot")) * child.number("scale"),
        joint.vector("parent axis"), joint.vector("child axis"),
        joint.number("child offset") if offset is None else offset, joint.number("joint offset"), kind == "prismatic",
    )  # fmt: skip
    T_world_a = matrix_of(parent.pose("location")) @ T_pi @ frames.T_parent_a
    T_world_b = matrix_of(child.pose("location")) @ T_ci @ frames.T_child_b
    D = inverse(T_world_a) @ T_world_b
    shift, turn = D[:3, 3], D[:3, :3]
    angle = float(np.arccos(np.clip((np.trace(turn) - 1.0) / 2.0, -1.0, 1.0)))
    tilt = float(np.arccos(np.clip(turn[2, 2], -1.0, 1.0)))
    if kind in ("revolute", "torsion spring"):
        return float(np.linalg.norm(shift)), tilt
    if kind == "prismatic":
        return float(np.hypot(shift[1], shift[2])), angle
    if kind == "linear spring":
        return float(np.hypot(shift[0], shift[1])), angle
    if kind == "fixed":
        return float(np.linalg.norm(shift)), angle
    if kind in ("p2p", "cone twist"):
        return float(np.linalg.norm(shift)), 0.0
    return 0.0, 0.0
