"""Builds a scene file by file, in the order in which AMBF creates objects.

A file comes converted (`ligature.model.conversion`); here its parts get their names, find the bodies that they name
and are joined. Parents of mounted objects are settled when they arrive. An object that cannot be built is reported and
left out; the rest goes on. What needs all objects of the scene comes afterwards (`ligature.model.completion`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ligature.adf import Diagnostic, Document, Element, Severity
from ligature.adf.nodes import Scalar, Sequence
from ligature.model import proxies
from ligature.model.conversion import ModelParts, Mounts, Part
from ligature.model.files import ModelFile, SceneFiles
from ligature.model.frames import Array
from ligature.model.geometry import GeometryError
from ligature.model.joints import fixed_joint, joint_of
from ligature.model.lookup import candidates
from ligature.model.lost import LostBodies
from ligature.model.mounted import actuator_of
from ligature.model.naming import Names, free_suffix, merged, topic_name
from ligature.model.parenting import Arrivals
from ligature.model.scene import (
    Actuator,
    Body,
    Camera,
    Ghost,
    Identity,
    InputDevice,
    Joint,
    Light,
    Model,
    Sensor,
    SensorType,
)
from ligature.model.sutures import thread

LEFT_OUT = "is left out"
KINDS = ("body", "joint", "ghost", "sensor", "actuator", "camera", "light")


class SceneBuilder:
    """Collects the objects of a scene.

    Attributes
    ----------
    bodies, joints, …
        The objects so far, by index.
    diagnostics
        Findings about the files and their objects.
    arrivals, lost
        Mounted objects and their parents, and bodies that could not be built.
    groups
        Collision groups of each body.
    silent_files
        Bodies of each file whose bodies do not collide with each other.
    linked
        Pairs of bodies, joined by a joint, that do not collide.
    no_rod
        Bodies that are part of no rod, though they might look like one.
    """

    def __init__(self, files: SceneFiles) -> None:
        self.files = files
        self.diagnostics = list(files.findings)
        self.models: list[Model] = []
        self.bodies: list[Body] = []
        self.joints: list[Joint] = []
        self.ghosts: list[Ghost] = []
        self.sensors: list[Sensor] = []
        self.actuators: list[Actuator] = []
        self.cameras: list[Camera] = []
        self.lights: list[Light] = []
        self.devices = [_device(element) for element in files.devices]
        self.arrivals = Arrivals()
        self.lost = LostBodies()
        self.groups: list[tuple[int, ...]] = []
        self.silent_files: list[list[int]] = []
        self.linked: list[tuple[int, int]] = []
        self.no_rod: set[int] = set()
        topics = {files.world.topic}
        self._names = {kind: Names(topics=None if kind == "joint" else topics) for kind in KINDS} | {"suture": Names()}
        self._scales: list[float] = []
        self._in_file: dict[int, str] = {}
        """Identifiers of bodies within their file: without the suffix that they have where it is loaded twice."""
        self._earlier: dict[str, frozenset[str]] = {}
        """Identifiers of each kind in the files before this one."""

    def report(self, diagnostic: Diagnostic) -> None:
        """Note a finding."""
        self.diagnostics.append(diagnostic)

    def add(self, file: ModelFile, parts: ModelParts) -> None:
        """Create the objects of one file from its converted parts; of the world file, the cameras and lights."""
        before = {kind: len(self._list(kind)) for kind in KINDS}
        if file.document.kind == "world":
            self._add_mounts(parts.mounts, Model(-1, file.document.path, file.document.top.text("namespace")))
        else:
            self._add_model(file.document, parts)
        self._enter(before)
        if file.device is not None:
            self._place_proxy(file.device, before)

    def _add_model(self, document: Document, parts: ModelParts) -> None:
        top = document.top
        model = Model(len(self.models), document.path, top.text("namespace"))
        self.models.append(model)
        self._earlier = {kind: frozenset(names.identifiers) for kind, names in self._names.items()}
        self._note_unusable(document, model)
        local = self._add_bodies(parts, model)
        if not top.flag("ligature rod"):
            self.no_rod.update(local)
        self._add_soft_bodies(parts, model)
        self._add_volumes(parts, model, local)
        self._add_sutures(document, parts.gravity, model, local)
        self._add_ghosts(parts, model)
        self._add_sensors(parts, model, local)
        self._add_actuators(document, model, local)
        self._add_joints(document, model, local)
        self._carry_tissues(document, model, local)
        self._add_mounts(parts.mounts, model)
        if top.flag("ignore inter-collision"):
            self.silent_files.append(local)

    def _place_proxy(self, device: int, before: dict[str, int]) -> None:
        """Put the proxy of an input device, all objects since ``before``, where the device has it."""
        first = before["body"]
        children = {joint.child for joint in self.joints[before["joint"] :]}
        taken = {body.identity.topic for body in self.bodies}
        element = self.files.devices[device]
        self.bodies[first:], root = proxies.placed(element, self.bodies[first:], children, taken)
        self.devices[device] = replace(self.devices[device], proxy=-1 if root is None else root)

    def _enter(self, before: dict[str, int]) -> None:
        """Let all objects created since ``before`` (count by kind) enter the world."""
        newcomers = [
            (kind, item.index, item.identity.identifier, item.identity.key)
            for kind in KINDS
            for item in self._list(kind)[before[kind] :]
        ]
        self.arrivals.enter(newcomers)

    def _list(self, kind: str) -> list[Any]:
        lists: dict[str, list[Any]] = {
            "body": self.bodies, "joint": self.joints, "ghost": self.ghosts, "sensor": self.sensors,
            "actuator": self.actuators, "camera": self.cameras, "light": self.lights,
        }  # fmt: skip
        return lists[kind]

    def _identity(self, kind: str, element: Element, model: Model) -> Identity:
        identity = self._names[kind].identity(element, model.namespace, model.index)
        self._note_shared(element, identity)
        return identity

    def _note_shared(self, element: Element, identity: Identity) -> None:
        """Report where an object has another name than the file says, because an earlier object has that."""
        name = element.text("name").replace(" ", "")
        repeated = identity.identifier != identity.namespace + element.key  # a file that is loaded twice needs no word
        if name and identity.name != name and not repeated:
            shared = topic_name(identity.namespace, name)
            message = f"{element.kind} '{element.key}' shares the topics '{shared}'; it gets '{identity.topic}'"
            hint = "give each object a name of its own; blanks in names do not count"
            self.report(Diagnostic(Severity.WARNING, message, element.mark_of("name"), hint, "name"))

    def _remap(self, kind: str, element: Element, model: Model) -> str:
        """The suffix of an object of whose name an earlier file has one, as where a file is loaded twice."""
        base = merged(model.namespace, element.text("namespace")) + element.key
        return free_suffix(base, self._earlier[kind])

    def _wait(self, kind: str, identity: Identity, index: int) -> None:
        self.arrivals.wait(kind, index, identity.identifier, identity.parent_text, identity.mark)

    def _add_bodies(self, parts: ModelParts, model: Model) -> list[int]:
        local = []
        taken: set[str] = set()
        for part in parts.bodies:
            element, identity = part.element, self._names["body"].identity(part.element, model.namespace, model.index)
            if part.make is None:
                self._names["body"].free(identity)
                self.diagnostics += part.findings
                self.lost.add(identity.identifier, len(self.diagnostics) - 1)
                continue
            self._note_shared(element, identity)
            self.diagnostics += part.findings
            body = part.make(index=len(self.bodies), identity=identity)
            self.bodies.append(body)
            base = identity.namespace + identity.key
            self._in_file[body.index] = base + free_suffix(base, taken)
            taken.add(self._in_file[body.index])
            self._scales.append(element.number("scale"))
            self.groups.append(self._valid_groups(element))
            if not element.flag("ligature rod"):
                self.no_rod.add(body.index)
            local.append(body.index)
        return local

    def _add_soft_bodies(self, parts: ModelParts, model: Model) -> None:
        """Bodies of tissue without topics, which no joint, group or other object names."""
        for part in parts.soft_bodies:
            self.diagnostics += part.findings
            if part.make is not None:
                identity = self._names["body"].identity(part.element, model.namespace, model.index, passive=True)
                self.no_rod.add(len(self.bodies))
                self.bodies.append(part.make(index=len(self.bodies), identity=identity))
                self._scales.append(1.0)
                self.groups.append(())

    def _add_volumes(self, parts: ModelParts, model: Model, local: list[int]) -> None:
        """Bodies in the shape of volumes, without topics: static, or fixed to the moving body that they name."""
        for part in parts.volumes:
            self.diagnostics += part.findings
            if part.make is None:
                continue
            place = self._body(part.element, "parent", local, "") if part.element.text("parent") else None
            if place is None and part.element.text("parent"):
                continue
            parent = None if place is None else self.bodies[place]
            identity = self._names["body"].identity(part.element, model.namespace, model.index, passive=True)
            body = part.make(index=len(self.bodies), identity=identity, parent=parent)
            self.bodies.append(body)
            self.no_rod.add(body.index)
            self._scales.append(1.0)
            self.groups.append(())
            if parent is not None and not body.static:
                held = replace(identity, key=f"{identity.key} parent")
                self.joints.append(fixed_joint(len(self.joints), held, parent, body))
                self._names["joint"].identifiers.append(held.identifier)
                self.linked.append((parent.index, body.index))

    def _note_unusable(self, document: Document, model: Model) -> None:
        """Record the listed bodies that an error dropped, so that references to them cause no further errors."""
        usable = {element.key for element in document.elements("bodies")}
        listed = document.top.node.get("bodies")
        for item in listed.items if isinstance(listed, Sequence) else []:
            if not isinstance(item, Scalar) or item.text in usable:
                continue
            for place, finding in enumerate(self.diagnostics):
                if finding.severity >= Severity.ERROR and f"body '{item.text}'" in finding.message:
                    self.lost.add(model.namespace + item.text, place)
                    break

    def _add_sutures(self, document: Document, gravity: Array, model: Model, local: list[int]) -> None:
        for element in document.elements("sutures"):
            parent = self._body(element, "parent", local, "") if element.text("parent") else None
            if parent is None and element.text("parent"):
                continue
            identity = self._names["suture"].identity(element, model.namespace, model.index, passive=True)
            held = None if parent is None else self.bodies[parent]
            try:
                bodies, joints = thread(element, identity, len(self.bodies), len(self.joints), gravity, held)
            except GeometryError as error:
                self._names["suture"].free(identity)
                self.report(error.diagnostic)
                continue
            self.bodies += bodies
            self.joints += joints
            self._scales += [1.0] * len(bodies)
            self.groups += [()] * len(bodies)
            self.linked += [(joint.parent, joint.child) for joint in joints]
            for kind, made in (("body", bodies), ("joint", joints)):
                self._names[kind].identifiers += [item.identity.identifier for item in made]
            local += [body.index for body in bodies]

    def _valid_groups(self, element: Element) -> tuple[int, ...]:
        groups = [int(g) for g in element.numbers("collision groups")]
        for group in groups:
            if not 0 <= group <= 999:
                message = f"collision group {group} of body '{element.key}' is outside 0 to 999; ignoring it"
                mark = element.mark_of("collision groups")
                self.report(Diagnostic(Severity.WARNING, message, mark, "use 0 to 999", "group"))
        return tuple(g for g in groups if 0 <= g <= 999)

    def _add_mounts(self, parts: Mounts, model: Model) -> None:
        kinds: tuple[tuple[str, tuple[Part[Any], ...]], ...] = (("light", parts.lights), ("camera", parts.cameras))
        for kind, each in kinds:
            made = self._list(kind)
            for part in each:
                assert part.make is not None  # every camera and light can be built
                identity = self._identity(kind, part.element, model)
                self._wait(kind, identity, len(made))
                made.append(part.make(index=len(made), identity=identity))

    def _add_ghosts(self, parts: ModelParts, model: Model) -> None:
        for part in parts.ghosts:
            self.diagnostics += part.findings
            if part.make is not None:
                identity = self._identity("ghost", part.element, model)
                self._wait("ghost", identity, len(self.ghosts))
                self.ghosts.append(part.make(index=len(self.ghosts), identity=identity))

    def _add_sensors(self, parts: ModelParts, model: Model, local: list[int]) -> None:
        for part in parts.sensors:
            element = part.element
            parent = self._body(element, "parent", local, "", self._remap("sensor", element, model))
            if parent is None:
                continue
            self.diagnostics += part.findings
            if part.make is None:
                continue
            identity = self._names["sensor"].identity(element, model.namespace, model.index)
            sensor = part.make(index=len(self.sensors), identity=identity, parent=parent)
            if sensor.type is not SensorType.CONTACT and not len(sensor.rays):
                self._names["sensor"].free(identity)
                sources = [name for name in ("array", "mesh", "parametric") if element.has(name)]
                if sources:  # the checker reports those without
                    message = f"'{sources[0]}' of sensor '{element.key}' gives no ray; it is left out"
                    hint = "list at least one ray"
                    self.report(Diagnostic(Severity.WARNING, message, element.mark_of(sources[0]), hint, "sensor"))
                continue
            self._note_shared(element, identity)
            self.sensors.append(sensor)

    def _add_actuators(self, document: Document, model: Model, local: list[int]) -> None:
        for element in document.elements("actuators"):
            parent = self._body(element, "parent", local, "", self._remap("actuator", element, model))
            if parent is not None:
                identity = self._identity("actuator", element, model)
                self.actuators.append(actuator_of(element, len(self.actuators), identity, self.bodies[parent]))

    def _add_joints(self, document: Document, model: Model, local: list[int]) -> None:
        for element in document.elements("joints"):
            space = merged(model.namespace, element.text("namespace"))
            remap = self._remap("joint", element, model)
            parent = self._body(element, "parent", local, space, remap)
            child = self._body(element, "child", local, space, remap)
            if parent is None or child is None:
                continue
            if parent == child:
                message = f"joint '{element.key}' has the same body as parent and child"
                self.report(Diagnostic(Severity.ERROR, message, element.mark, "name two bodies", "joint"))
                continue
            if not np.any(element.vector("parent axis")) or not np.any(element.vector("child axis")):
                message = f"joint '{element.key}' has an axis of length zero"
                self.report(
                    Diagnostic(Severity.ERROR, message, element.mark, "set a direction of non-zero length", "joint")
                )
                continue
            identity = self._identity("joint", element, model)
            scales = (self._scales[parent], self._scales[child])
            self.joints.append(
                joint_of(element, len(self.joints), identity, self.bodies[parent], self.bodies[child], scales)
            )
            if element.flag("ignore inter-collision"):
                self.linked.append((parent, child))
            if not element.flag("ligature rod"):
                self.no_rod.update((parent, child))

    def _carry_tissues(self, document: Document, model: Model, local: list[int]) -> None:
        """Fix bodies of tissue to the bodies that carry them."""
        key = "ligature tissue.carried by"
        made = {self.bodies[i].identity.key: i for i in local if self.bodies[i].tissue is not None}
        for element in document.elements("bodies"):
            child = made.pop(element.key, None)
            if child is None or not element.text(key):
                continue
            space = merged(model.namespace, element.text("namespace"))
            parent = self._body(element, key, local, space, fate="is carried by nothing")
            if parent is None:
                continue
            carrier, tissue = self.bodies[parent], self.bodies[child]
            if parent == child or (tissue.static and not carrier.static):
                what = (
                    "is carried by itself"
                    if parent == child
                    else f"has no mass but is carried by '{carrier.identity.name}'"
                )
                hint = "name another body" if parent == child else "remove its 'mass', or give one above 0"
                self.report(
                    Diagnostic(Severity.ERROR, f"body '{element.key}' {what}", element.mark_of(key), hint, "tissue")
                )
            elif not tissue.static:
                identity = replace(tissue.identity, key=f"{element.key} carrier", passive=True)
                self.joints.append(fixed_joint(len(self.joints), identity, carrier, tissue))
                self._names["joint"].identifiers.append(identity.identifier)
                self.linked.append((parent, child))

    def _body(
        self, element: Element, key: str, local: list[int], namespace: str, remap: str = "", fate: str = LEFT_OUT
    ) -> int | None:
        """The body that ``element`` names under ``key``, looked for in AMBF's order.

        ``remap`` is the element's own suffix; of bodies that earlier files have several times, it means that with it.
        ``fate`` is what becomes of the element without that body.
        """
        text = element.text(key)
        names = [body.identity.identifier for body in self.bodies]
        local_names = [self._in_file.get(i, names[i]) for i in local]
        in_file = [(True, text), (True, namespace + text)]
        searches = dict.fromkeys([*in_file, (False, namespace + text + remap), (False, text)])
        ambiguous: list[str] = []
        for within, wanted in searches:
            pool = local_names if within else names
            found = candidates(pool, wanted) if wanted else []
            if len(found) == 1:
                body = local[found[0]] if within else found[0]
                self._note_incomplete(element, key, self.bodies[body].identity)
                return body
            ambiguous += [pool[i] for i in found if pool[i] not in ambiguous]
        dependant = f"{element.kind} '{element.key}'" if fate == LEFT_OUT else f"'{key}' of '{element.key}'"
        if not ambiguous and self.lost.took_along(dependant, (text, namespace + text)):
            return None
        shown = [*ambiguous[:3], *(["…"] if len(ambiguous) > 3 else [])]
        reason = f"is ambiguous ({', '.join(shown)})" if ambiguous else "does not exist"
        message = f"{element.kind} '{element.key}' {fate}: its {key} '{text}' {reason}"
        hint = "write one of these in full" if ambiguous else "name a body of this or an earlier file"
        self.report(Diagnostic(Severity.ERROR, message, element.mark_of(key), hint, "reference"))
        return None

    def _note_incomplete(self, element: Element, key: str, found: Identity) -> None:
        """Report a text that is only a part of the name of the body that it stands for, as a mistyped one may be."""
        text = element.text(key)
        if not text.endswith(found.key):
            message = f"{key} '{text}' of {element.kind} '{element.key}' is incomplete; using '{found.identifier}'"
            self.report(Diagnostic(Severity.INFO, message, element.mark_of(key), "", "parent"))


def _device(element: Element) -> InputDevice:
    return InputDevice(
        element.key, element.text("hardware name"), element.text("root link"), element.raw(), element.mark
    )
