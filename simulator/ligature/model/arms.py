"""Finds the manipulators of a scene: by base body, joint chain and tool id, or as the launch file declares them.

An unmodified scene of the suturing challenge has a base body ``base link…`` in a namespace such as ``…/psm1/``, the
joints of a PSM below it, and a body ``tool id`` whose topic ends in the instrument's number, as in the
scenes of the suturing challenge. The launch key ``ligature arms``, which AMBF ignores, lists arms instead::

    ligature arms:
      - {name: PSM1, kind: psm, base: psm1/BODY base link, tool: LARGE_NEEDLE_DRIVER:420006}
      - {name: ECM, kind: ecm, tip: BODY CameraFrame}
      - {name: MTML, kind: mtm}
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ligature.adf import Diagnostic, Mark, Severity
from ligature.model.lookup import find_by_text
from ligature.model.scene import ArmDescription, ArmKind, Body, Joint, JointType

_R, _P = JointType.REVOLUTE, JointType.PRISMATIC
CHAINS = {ArmKind.PSM: (_R, _R, _P, _R, _R, _R), ArmKind.ECM: (_R, _R, _P, _R)}
"""Joint types from the base outwards."""

PSM_JOINTS = ("yaw", "pitch", "insertion", "roll", "wrist pitch", "wrist yaw")
CAMERA_BODY = "CameraFrame"
MASTERS = ("MTML", "MTMR")
KEYS = ("name", "kind", "base", "tip", "tool")

_BASE = re.compile(r"base_?link", re.IGNORECASE)
_SPACE = re.compile(r"(?P<kind>psm|ecm)\d*\Z", re.IGNORECASE)
_TOOL = re.compile(r"tool_?id\D*(?P<model>\d+)\Z", re.IGNORECASE)


class Chains:
    """The joints below each body, and the chains of an arm that start there."""

    def __init__(self, bodies: Sequence[Body], joints: Sequence[Joint]) -> None:
        self._bodies = bodies
        self._below: dict[int, list[Joint]] = {}
        for joint in joints:
            self._below.setdefault(joint.parent, []).append(joint)

    def longest(self, body: int, types: Sequence[JointType]) -> tuple[Joint, ...]:
        """The longest chain below ``body`` whose joints are of ``types``, in their order."""
        best: tuple[Joint, ...] = ()
        for joint in self._below.get(body, ()) if types else ():
            if joint.type is types[0]:
                chain = (joint, *self.longest(joint.child, types[1:]))
                best = max(best, chain, key=len)
        return best

    def jaw(self, tip: int) -> tuple[int, ...]:
        """The two finger joints below the tip."""
        fingers = [joint.index for joint in self._below.get(tip, ()) if joint.type is _R]
        return tuple(fingers[:2])

    def arm(self, name: str, kind: ArmKind, base: int, tool: str) -> ArmDescription | str:
        """The arm on ``base``, or the name of the first joint that it lacks and the body where it should hang."""
        types = CHAINS[kind]
        chain = self.longest(base, types)
        if len(chain) < len(types):
            last = self._bodies[chain[-1].child if chain else base].identity.identifier
            return f"no {types[len(chain)].value} joint '{PSM_JOINTS[len(chain)]}' is attached to '{last}'"
        tip = chain[-1].child
        jaw = self.jaw(tip) if kind is ArmKind.PSM else ()
        return ArmDescription(name, kind, base, tuple(joint.index for joint in chain), jaw, tip, tool)


def find_arms(
    bodies: Sequence[Body], joints: Sequence[Joint], declared: Any = None, mark: Mark | None = None
) -> tuple[tuple[ArmDescription, ...], list[Diagnostic]]:
    """The arms of a scene and what was found about them.

    ``declared`` is the value of the launch key ``ligature arms``, None when there is none.
    """
    chains = Chains(bodies, joints)
    if declared is not None:
        return _declared(bodies, chains, declared, mark)
    arms: list[ArmDescription] = []
    found: list[Diagnostic] = []
    for body in bodies:
        space = body.identity.topic.rpartition("/")[0].rpartition("/")[2]
        match = _SPACE.match(space)
        if match is None or not _BASE.match(body.identity.name.replace(" ", "")):
            continue
        kind, name = ArmKind(match["kind"].lower()), space.upper()
        arm = chains.arm(name, kind, body.index, _tool(bodies, body))
        if isinstance(arm, str):
            found.append(_incomplete(name, arm, body.identity.mark))
        elif all(other.name != name for other in arms):
            arms.append(arm)
    arms.sort(key=lambda arm: (arm.kind is ArmKind.ECM, arm.name))
    if all(arm.kind is not ArmKind.ECM for arm in arms):
        arms += _camera_arm(bodies)
    if any(arm.kind is ArmKind.PSM for arm in arms):
        arms += [ArmDescription(name, ArmKind.MTM) for name in MASTERS]
    return tuple(arms), found


def _camera_arm(bodies: Iterable[Body]) -> list[ArmDescription]:
    """The ECM of scenes that have no such arm, only a body that carries the cameras."""
    frames = [body.index for body in bodies if body.identity.name == CAMERA_BODY and body.static]
    return [ArmDescription("ECM", ArmKind.ECM, tip=index) for index in frames[:1]]


def _tool(bodies: Iterable[Body], base: Body) -> str:
    """Model number in the name of the tool id body of the base's namespace, or an empty text."""
    space = base.identity.topic.rpartition("/")[0] + "/"
    for body in bodies:
        match = _TOOL.search(body.identity.topic)
        if match is not None and body.identity.topic.startswith(space):
            return match["model"]
    return ""


def _incomplete(name: str, why: str, mark: Mark | None) -> Diagnostic:
    return Diagnostic(
        Severity.WARNING, f"'{name}' is not an arm: {why}", mark, "its bodies stay ordinary bodies", "arm"
    )


def _declared(
    bodies: Sequence[Body], chains: Chains, declared: Any, mark: Mark | None
) -> tuple[tuple[ArmDescription, ...], list[Diagnostic]]:
    arms: list[ArmDescription] = []
    found: list[Diagnostic] = []
    entries = declared if isinstance(declared, list) else [declared]
    for entry in entries:
        try:
            arm = _entry(bodies, chains, entry)
            if any(other.name == arm.name for other in arms):
                raise ValueError(f"another arm is already called '{arm.name}'")
            arms.append(arm)
        except ValueError as error:
            message = f"'ligature arms': {error}"
            found.append(Diagnostic(Severity.ERROR, message, mark, f"an arm has the keys {', '.join(KEYS)}", "arm"))
    return tuple(arms), found


def _entry(bodies: Sequence[Body], chains: Chains, entry: Any) -> ArmDescription:
    """One declared arm; raises ValueError with what is wrong with it."""
    if not isinstance(entry, Mapping):
        raise ValueError(f"'{entry}' is not a mapping")
    unknown = [str(key) for key in entry if key not in KEYS]
    if unknown:
        raise ValueError(f"unknown key '{unknown[0]}'")
    name, word = str(entry.get("name", "")), str(entry.get("kind", "")).lower()
    if not re.fullmatch(r"[A-Za-z]\w*", name):
        raise ValueError(f"'{name}' is not a valid name; write letters, digits and '_'")
    if word not in {kind.value for kind in ArmKind}:
        raise ValueError(f"{name}: kind '{word}' must be one of {', '.join(kind.value for kind in ArmKind)}")
    kind, tool = ArmKind(word), str(entry.get("tool", ""))
    if kind is ArmKind.MTM:
        return ArmDescription(name, kind)
    if kind is ArmKind.ECM and "base" not in entry:
        return ArmDescription(name, kind, tip=_body(bodies, name, "tip", entry))
    base = _body(bodies, name, "base", entry)
    arm = chains.arm(name, kind, base, tool or _tool(bodies, bodies[base]))
    if isinstance(arm, str):
        raise ValueError(f"{name}: {arm}")
    return arm


def _body(bodies: Sequence[Body], name: str, key: str, entry: Mapping[Any, Any]) -> int:
    text = str(entry.get(key, ""))
    index = find_by_text([body.identity.identifier for body in bodies], text) if text else None
    if index is None:
        raise ValueError(f"{name}: {key} '{text}' names no body, or several; give the identifier of one")
    return index
