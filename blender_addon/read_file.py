"""Brings a scene file into Blender: a collection for the file, an object for each object of the file.

Nothing is rejected silently: what could not be brought in is in `Import.problems`, with its place.
"""

from __future__ import annotations

import json
import os
import re
from codecs import BOM_UTF8
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import bpy
import numpy as np

from .folders import allowed_folders, remember_opened
from .ligature.adf import AdfError, Document, Element, Resolver, Severity, read_any, read_launch
from .ligature.adf.reader import read_text
from .ligature.adf.references import find_by_text
from .ligature.adf.update import Item, new_text
from .ligature.authoring.generate import Parts
from .ligature.authoring.placement import matrix_of
from .ligature.authoring.shapes import Shape, shape_mesh
from .ligature.mesh import Mesh, MeshError, load_mesh
from .mesh_making import MeshMaker, shape_data
from .mesh_reading import mesh_print
from .placing import parent_to, place, place_joint, place_light, place_view
from .poses import SHAPED, placed, rest_pose
from .properties import ROLE_OF_KIND
from .references import owner_names, qualified
from .schema_properties import fetch, identifier, state_text, store
from .solids import solids_of
from .steps import Steps, all_or_nothing, finished, part

EMPTY_LOOK = {"joint": "SINGLE_ARROW", "sensor": "CONE", "actuator": "SPHERE", "suture": "SINGLE_ARROW"}
READ, MADE = 0.25, 0.75
"""Shares of an import after the file is read, and of the rest when its objects are made."""

SHAPE_COLOUR = {"COLLISION": (0.95, 0.75, 0.1, 0.35), "VISUAL": (0.7, 0.7, 0.7, 1.0)}


@dataclass
class Import:
    """What came of a file: its collection, None without one, and what could not be brought in."""

    collection: bpy.types.Collection | None
    document: Document | None = None
    problems: list[str] = field(default_factory=list)


def import_file(path: Path, scene: bpy.types.Scene, roots: tuple[Path, ...] = ()) -> Import:
    """Bring one world, model, input-devices or colours file in; raises `AdfError` when it cannot be read at all."""
    done = finished(importing(path, roots))
    scene.collection.children.link(done.collection)
    return done


def importing(
    path: Path, roots: tuple[Path, ...] = (), reader: Callable[[Path, Resolver], Document] = read_any
) -> Steps[Import]:
    """The steps that bring a file in, whose collection is part of no scene yet; ended, they leave nothing.

    ``reader`` is for a file whose kind is known; otherwise its keys show the kind.
    """
    words = f"Opening {path.name}"
    yield words, 0.0
    resolver = Resolver.for_file(path, (*roots, *allowed_folders()))
    document = reader(path, resolver)
    yield words, READ
    with all_or_nothing():
        done = _begun(path, document)
        if done.collection.adf.kind != "OTHER":
            yield from part(_Importer(document, resolver, done).run(words), READ, 1.0)
    return done


def _begun(path: Path, document: Document) -> Import:
    """The collection of a file with what the file itself states, and without its objects."""
    collection = bpy.data.collections.new(path.stem)
    stored = collection.adf
    stored.filepath = str(path)
    stored.source = document.text
    data = path.read_bytes()
    stored.byte_order_mark = data.startswith(BOM_UTF8)
    remember_opened(stored, {path: data})
    stored.kind = {"model": "MODEL", "world": "WORLD", "input devices": "INPUT_DEVICES"}.get(document.kind, "OTHER")
    done = Import(collection, document, [str(d) for d in document.diagnostics if d.severity >= Severity.ERROR])
    if stored.kind == "OTHER":
        return done
    store(getattr(stored, identifier(document.kind)), document.kind, document.top.given())
    return done


def add_parts(collection: bpy.types.Collection, parts: Parts) -> list[bpy.types.Object]:
    """Make generated objects in the collection of a file; they are written with its next export."""
    return finished(adding(collection, parts))


def adding(collection: bpy.types.Collection, parts: Parts) -> Steps[list[bpy.types.Object]]:
    """The steps that make generated objects in the collection of a file."""
    kind = {"MODEL": "model", "WORLD": "world"}[collection.adf.kind]
    folder = Path(collection.adf.filepath or "new.yaml").resolve().parent
    group = getattr(collection.adf, identifier(kind))
    top = fetch(group, kind)
    document = read_text(new_text(kind, top, _with_free_keys(collection, parts.items)), folder / "generated.yaml", kind)
    importer = _Importer(document, Resolver([folder]), Import(collection, document))
    importer.given_meshes = dict(parts.meshes)
    made = yield from importer.make(f"Making {collection.name}")
    for obj in made:
        obj.adf.was = ""
    return made


def outside_folders(path: Path, roots: tuple[Path, ...] = ()) -> Steps[list[str]]:
    """The steps that find the folders in which meshes of a file, or of a launch file's models, lie and may not be read.

    Raises `AdfError` when the file cannot be read.
    """
    words = f"Looking for the meshes of {path.name}"
    yield words, 0.0
    resolver = Resolver.for_file(path, (*roots, *allowed_folders()))
    document = read_any(path, resolver)
    if document.kind == "launch":
        launch = read_launch(path, resolver)
        models = [reference.path for reference in launch.models if reference.path is not None]
        found: list[str] = []
        for number, model in enumerate(models):
            yield words, number / len(models)
            found += _outside_of(model, (*roots, *resolver.roots))
        return list(dict.fromkeys(found))
    return _outside(document, resolver)


def _outside_of(path: Path, roots: tuple[Path, ...]) -> list[str]:
    resolver = Resolver.for_file(path, (*roots, *allowed_folders()))
    try:
        return _outside(read_any(path, resolver), resolver)
    except AdfError:
        return []  # opening it reports that


def _outside(document: Document, resolver: Resolver) -> list[str]:
    """The folders outside the scene's that a file needs; for two folders with one parent, the parent."""
    found: dict[Path, None] = {}
    for element in (e for listed in document.lists.values() for e in listed if e.kind in MESHED):
        high, low = element.text("mesh"), element.text("collision mesh") or element.text("mesh")
        for name, key in ((high, "high resolution path"), (low, "low resolution path")):
            file = Path(os.path.normpath(document.path.parent / document.top.text(key) / element.text(key) / name))
            try:
                if name and not resolver.exists(file) and file.is_file():
                    found[file.resolve().parent] = None
            except OSError:
                continue
    around = [folder.parent for folder in found]
    wider = {folder if around.count(folder.parent) < 2 else folder.parent: None for folder in found}
    return [str(folder) for folder in wider]


MESHED = ("body", "ghost object", "soft body")


def worded(error: Exception) -> str:
    """An error of a file in the words of this editor: its dialog, not the command line."""
    return _COMMAND_LINE.sub(r"allow '\1' as Further Folder of the import dialog", str(error))


_COMMAND_LINE = re.compile(r"allow it with --root (.+?) or \w+")


def _with_free_keys(collection: bpy.types.Collection, items: tuple[Item, ...]) -> list[Item]:
    """The items under identifiers that the file does not have yet, references among them changed too."""
    taken = {obj.adf.key for obj in collection.all_objects}
    new: dict[str, str] = {}
    for item in items:
        number = 1
        key = item.key
        while key in taken or key in new.values():
            key, number = f"{item.key} {number}", number + 1
        new[item.key] = key
    changed = []
    for item in items:
        values = {path: new.get(v, v) if path in ("parent", "child") else v for path, v in item.values.items()}
        if new[item.key] != item.key:
            values["name"] = f"{values.get('name', '')}{new[item.key][len(item.key) :]}".replace(" ", "_")
        changed.append(Item(item.kind, new[item.key], values))
    return changed


class _Importer:
    """Makes the objects of one document."""

    def __init__(self, document: Document, resolver: Resolver, done: Import) -> None:
        self.given_meshes: dict[str, Mesh] = {}
        self.document, self.resolver, self.done = document, resolver, done
        self.collection = done.collection
        self.folder = document.path.parent
        self.values: dict[str, dict] = {}
        self.objects: dict[str, bpy.types.Object] = {}
        self.maker = MeshMaker()
        self.files: dict[Path, Mesh | None] = {}
        self.shapes: dict[tuple, bpy.types.Mesh] = {}
        self.shape_collection: bpy.types.Collection | None = None

    def run(self, words: str) -> Steps[None]:
        """Make all objects, and store their state, with which exports find what changed."""
        made = yield from part(self.make(words), 0.0, MADE)
        for number, obj in enumerate(made):
            yield words, MADE + (1.0 - MADE) * number / len(made)
            obj.adf.called = obj.name
            obj.adf.imported = state_text(placed(obj, owner_names(obj)).state())
            if obj.adf.role in SHAPED:
                obj.adf.mesh_print = mesh_print(solids_of(obj))
        self.collection.adf.imported_keys = json.dumps([obj.adf.key for obj in made])

    def make(self, words: str) -> Steps[list[bpy.types.Object]]:
        """Make the objects, bodies first, because they are the parents of others."""
        elements = {e.key: e for listed in self.document.lists.values() for e in listed}
        bodies_first = sorted(elements.values(), key=lambda e: (e.kind != "body", e.kind == "joint"))
        for number, element in enumerate(bodies_first):
            yield words, number / len(bodies_first)
            self.values[element.key] = element.given()
            if element.kind != "joint":
                self._make(element)
        for element in bodies_first:
            yield words, 1.0
            if element.kind == "joint":
                self._make_joint(element)
            elif element.kind != "body":
                self._hang(element)
        return [self.objects[key] for key in elements]

    def _new(self, name: str, data: bpy.types.ID | None, role: str, shapes: bool = False) -> bpy.types.Object:
        obj = bpy.data.objects.new(name, data)
        (self._shape_collection() if shapes else self.collection).objects.link(obj)
        obj.adf.role = role
        return obj

    def _shape_collection(self) -> bpy.types.Collection:
        """The collection of primitives, hulls and frames, which one click hides."""
        if self.shape_collection is None:
            self.shape_collection = shape_collection(self.collection)
        return self.shape_collection

    def _make(self, element: Element) -> None:
        values = self.values[element.key]
        obj = self._new(values.get("name") or element.key, self._data(element, values), ROLE_OF_KIND[element.kind])
        obj.adf.key = obj.adf.was = element.key
        obj.adf.parent_text = values.get("parent", "")
        store(getattr(obj.adf, identifier(element.kind)), element.kind, values)
        self.objects[element.key] = obj
        place(obj, self._placed(element.kind, values))
        if obj.type == "EMPTY":
            obj.empty_display_type = EMPTY_LOOK.get(element.kind, "PLAIN_AXES")
            obj.empty_display_size = 0.02
        if obj.adf.role in SHAPED:
            self._colour(obj, values)
            self._add_inertial(obj, values)
            self._add_shapes(obj, values)
            self._add_collision_mesh(element, obj, values)

    def _placed(self, kind: str, values: dict) -> np.ndarray:
        if kind == "camera":
            return place_view(values)
        if kind == "light":
            return place_light(values)
        return matrix_of(values.get("location")) if kind != "input device" else np.eye(4)

    def _data(self, element: Element, values: dict) -> bpy.types.ID | None:
        name = values.get("name") or element.key
        if element.kind == "camera":
            camera = bpy.data.cameras.new(name)
            camera.sensor_fit = "VERTICAL"
            camera.angle_y = min(max(element.number("field view angle"), 0.01), 3.0)
            camera.clip_start = max(element.number("clipping plane.near"), 1e-6)
            camera.clip_end = element.number("clipping plane.far")
            camera.display_size = 0.05
            return camera
        if element.kind == "light":
            light = bpy.data.lights.new(name, "SPOT")
            light.spot_size = min(2.0 * element.number("cutoff angle"), 3.14159)
            return light
        if "mesh" in values and element.kind in ("body", "ghost object", "soft body") and "shape" not in values:
            mesh = self._mesh_file(element, values["mesh"], "high resolution path")
            return None if mesh is None else self.maker.whole(mesh, name, values.get("scale", 1.0))
        return None

    def _mesh_file(self, element: Element, name: str, path_key: str) -> Mesh | None:
        """A mesh file of the element, from the folder that its own or the file's path names."""
        if not name or name in self.given_meshes:
            return self.given_meshes.get(name)
        file = os.path.join(self.document.top.text(path_key), element.text(path_key), name)
        try:
            path = self.resolver.resolve(file, self.folder)
            if path not in self.files:
                self.files[path] = load_mesh(path, self.resolver)
            self._report_missing_textures(element, self.files[path])
        except (MeshError, AdfError) as error:
            self.done.problems.append(f"{element.kind} '{element.key}': {worded(error)}")
            return None
        return self.files[path]

    def _report_missing_textures(self, element: Element, mesh: Mesh) -> None:
        looks = {part.material for part in mesh.parts if part.material is not None}
        named = sorted({file for look in looks for file in (look.texture, look.normal_map) if file is not None})
        for file in named:
            if not file.is_file():
                self.done.problems.append(f"{element.kind} '{element.key}': the texture '{file}' is missing")

    def _colour(self, obj: bpy.types.Object, values: dict) -> None:
        rgb = [values.get(f"color components.diffuse.{c}") for c in "rgb"]
        alpha = values.get("color components.transparency", 1.0)
        if "color rgba.r" in values:
            rgb, alpha = [values[f"color rgba.{c}"] for c in "rgb"], values["color rgba.a"]
        if None not in rgb:
            obj.color = (*rgb, alpha)

    def _add_inertial(self, obj: bpy.types.Object, values: dict) -> None:
        T = matrix_of(values.get("inertial offset")) if obj.adf.role != "SOFT_BODY" else np.eye(4)
        if np.array_equal(T, np.eye(4)):
            return
        frame = self._new(f"{obj.name} inertial", None, "INERTIAL", shapes=True)
        frame.empty_display_type = "ARROWS"
        frame.empty_display_size = 0.01
        parent_to(frame, obj, T)

    def _add_shapes(self, obj: bpy.types.Object, values: dict) -> None:
        inertial = matrix_of(values.get("inertial offset")) if obj.adf.role != "SOFT_BODY" else np.eye(4)
        for use, prefix in (("COLLISION", "collision "), ("VISUAL", "")):
            compound = "compound collision shape" if use == "COLLISION" else "compound shape"
            if f"{prefix}shape" in values:
                kind = values[f"{prefix}shape"]
                T = matrix_of(values["collision offset"]) if "collision offset" in values else inertial
                self._add_shape(
                    obj, use, kind, _below(values, f"{prefix}geometry."), T if use == "COLLISION" else np.eye(4), 0
                )
            else:
                for order, item in enumerate(values.get(compound, ())):
                    T = matrix_of(item.get("offset"))
                    self._add_shape(obj, use, item["shape"], _below(item, "geometry."), T, order)

    def _add_shape(self, obj: bpy.types.Object, use: str, kind: str, geometry: dict, T: np.ndarray, order: int) -> None:
        shape = Shape.of(kind, geometry)
        if shape not in self.shapes:
            self.shapes[shape] = shape_data(*shape_mesh(shape), kind.title())
        child = self._new(f"{obj.name} {use.lower()}", self.shapes[shape], "SHAPE", shapes=True)
        set_shape(child, shape, use, order)
        parent_to(child, obj, T)

    def _add_collision_mesh(self, element: Element, obj: bpy.types.Object, values: dict) -> None:
        if "collision shape" in values or "compound collision shape" in values or not values.get("collision mesh"):
            return
        mesh = self._mesh_file(element, values["collision mesh"], "low resolution path")
        if mesh is None:
            return
        for index in range(len(mesh.parts)):
            data = self.maker.part(mesh, index, f"{obj.name} hull", values.get("scale", 1.0))
            hull = self._new(f"{obj.name} hull", data, "HULL", shapes=True)
            hull.adf.shape.order = index
            hull.display_type = "WIRE"
            hull.hide_render = True
            hull.color = SHAPE_COLOUR["COLLISION"]
            parent_to(hull, obj, np.eye(4))

    def _find(self, text: str, kinds: tuple[str, ...] = ("body",)) -> bpy.types.Object | None:
        """The object that a reference means: of this file first, then of any other that is open."""
        if not text:
            return None
        own = [o for o in self.objects.values() if KINDS.get(o.adf.role) in kinds]
        found = find_by_text([self._qualified(o) for o in own], text)
        found = found if found is not None else find_by_text([o.adf.key for o in own], text)
        return own[found] if found is not None else find_open(text, kinds)

    def _qualified(self, obj: bpy.types.Object) -> str:
        return qualified(self.collection, obj)

    def _make_joint(self, element: Element) -> None:
        values = self.values[element.key]
        obj = self._new(values.get("name") or element.key, None, "JOINT")
        obj.empty_display_type, obj.empty_display_size = EMPTY_LOOK["joint"], 0.02
        obj.adf.key = obj.adf.was = element.key
        obj.adf.parent_text, obj.adf.child_text = values.get("parent", ""), values.get("child", "")
        store(obj.adf.joint, "joint", values)
        parent, child = self._find(values.get("parent", "")), self._find(values.get("child", ""))
        obj.adf.parent_object, obj.adf.child_object = parent, child
        self.objects[element.key] = obj
        T = place_joint(values, parent, child)
        if parent is not None:
            parent_to(obj, parent, T)
        else:
            place(obj, T)

    def _hang(self, element: Element) -> None:
        """Parent ghosts, sensors, cameras and lights to the object that they name."""
        obj = self.objects[element.key]
        parent = self._find(obj.adf.parent_text, tuple(ROLE_OF_KIND))
        if parent is not None and parent is not obj:
            parent_to(obj, parent, rest_pose(obj))
            obj.adf.hung = True


def shape_collection(collection: bpy.types.Collection) -> bpy.types.Collection:
    """The collection of a file's primitives, hulls and frames; made when there is none."""
    name = f"{collection.name} Shapes"
    found = next((c for c in collection.children if c.name.startswith(name)), None)
    if found is None:
        found = bpy.data.collections.new(name)
        collection.children.link(found)
    return found


def find_open(text: str, kinds: tuple[str, ...]) -> bpy.types.Object | None:
    """The object of any open file that a reference means."""
    candidates = [
        (qualified(collection, obj), obj)
        for collection in bpy.data.collections
        if collection.adf.kind != "NONE"
        for obj in collection.objects
        if KINDS.get(obj.adf.role) in kinds
    ]
    found = find_by_text([name for name, _ in candidates], text)
    return None if found is None else candidates[found][1]


KINDS = {role: kind for kind, role in ROLE_OF_KIND.items()}


def set_shape(obj: bpy.types.Object, shape: Shape, use: str, order: int) -> None:
    """Make an object stand for a primitive."""
    data = obj.adf.shape
    data.kind, data.use, data.order = shape.kind, use, order
    data.size, data.radius, data.height, data.axis = shape.size, shape.radius, shape.height, shape.axis
    data.normal, data.offset = shape.normal, shape.offset
    obj.color = SHAPE_COLOUR[use]
    if use == "COLLISION":
        obj.display_type = "WIRE"
        obj.hide_render = True


def _below(values: dict, prefix: str) -> dict:
    return {path[len(prefix) :]: value for path, value in values.items() if path.startswith(prefix)}
