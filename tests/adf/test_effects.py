"""The support table keeps its word: every key that it calls used changes the scene, and what it changes is read.

Each key is set to two values in a small scene; both scenes are compared leaf by leaf. A leaf that nothing outside
`ligature.model` reads would make the key one without effect, whatever the table says.
"""

from __future__ import annotations

import copy
import dataclasses
import enum
import json
import re
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import ligature
import numpy as np
import pytest
import trimesh
import yaml
from ligature.adf import Severity
from ligature.adf.schema import NOT_SIMULATED, SCHEMA, Key, Status, Type
from PIL import Image

from tests.fuzz.seeds import ASCII_STL, MTL, OBJ

PACKAGE = Path(ligature.__file__).parent
AT = {"x": 0.0, "y": 0.0, "z": 0.0}
POSE = {"position": {"x": 0.1, "y": 0.2, "z": 0.3}, "orientation": {"r": 0.1, "p": 0.2, "y": 0.3}}
OTHER = {"position": {"x": 0.3, "y": 0.1, "z": 0.2}, "orientation": {"r": 0.3, "p": 0.1, "y": 0.2}}
AXES = {
    "parent pivot": AT, "child pivot": {"x": 0.0, "y": 0.0, "z": 0.2},
    "parent axis": {"x": 0, "y": 0, "z": 1}, "child axis": {"x": 0, "y": 0, "z": 1},
}  # fmt: skip
BOX = {"collision shape": "BOX", "collision geometry": {"x": 0.1, "y": 0.1, "z": 0.1}}
SHADERS = {"path": "./", "vertex": "a.vs", "fragment": "a.fs"}

SUBJECTS: dict[str, dict[str, Any]] = {
    "body": {"name": "subject", "mass": 0.5, "mesh": "part.obj", **BOX},
    "joint": {"name": "subject", "type": "revolute", "parent": "BODY base", "child": "BODY link", **AXES},
    "ghost object": {"name": "subject", "parent": "BODY base", "mesh": "part.obj", **BOX},
    "sensor": {
        "name": "subject", "type": "Proximity", "parent": "BODY base",
        "array": [{"offset": AT, "direction": {"x": 1, "y": 0, "z": 0}}],
    },
    "actuator": {"name": "subject", "type": "Constraint", "parent": "BODY base"},
    "camera": {"name": "subject", "location": {"x": 1, "y": 0, "z": 0}, "look at": AT},
    "light": {"name": "subject", "location": {"x": 1, "y": 0, "z": 1}, "direction": {"x": 0, "y": 0, "z": -1}},
    "suture": {"name": "subject", "length": 0.1, "diameter": 0.0004, "elements": 12},
    "volume": {
        "name": "subject", "parent": "BODY base",
        "images": {"path": "./", "prefix": "slice", "format": "png", "count": 3},
    },
    "soft body": {"name": "subject", "mass": 0.2, "mesh": "lump.obj", "config": {"kLST": 0.01, "kMT": 0.01}},
    "input device": {"hardware name": "MTMR", "simulated multibody": "proxy.yaml", "root link": "BODY handle"},
}  # fmt: skip
"""One object of each kind, as small as it may be."""

LISTS = {
    "body": "bodies", "joint": "joints", "ghost object": "ghost objects", "sensor": "sensors",
    "actuator": "actuators", "camera": "cameras", "light": "lights", "suture": "sutures", "soft body": "soft bodies", "volume": "volumes",
}  # fmt: skip

ROUND = {"shape": "CYLINDER", "geometry": {"radius": 0.1, "height": 0.2}}
CUBE = {"shape": "BOX", "geometry": {"x": 0.1, "y": 0.1, "z": 0.1}}
FLAT = {"shape": "PLANE", "geometry": {"normal": {"x": 0, "y": 0, "z": 1}, "offset": 0.1}}


def shaped(shape: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """A primitive with a prefix before its keys."""
    return {f"{prefix}{key}": value for key, value in shape.items()}


def primitives(block: str, prefix: str) -> dict[str, dict[str, Any]]:
    """What stands around the dimensions of a primitive, by key."""
    kinds = {
        "x": CUBE,
        "y": CUBE,
        "z": CUBE,
        "radius": ROUND,
        "height": ROUND,
        "axis": ROUND,
        "normal": FLAT,
        "offset": FLAT,
    }
    if block.endswith("[].geometry"):
        listed = block.partition("[]")[0]
        return {f"{block}.{key}": {listed: [dict(shape)], "collision shape": None} for key, shape in kinds.items()}
    return {f"{block}.{key}": shaped(shape, prefix) for key, shape in kinds.items()}


ANY_SHAPE = {
    "shape": "SPHERE",
    "geometry": {
        "x": 0.1,
        "y": 0.1,
        "z": 0.1,
        "radius": 0.1,
        "height": 0.3,
        "normal": {"x": 0, "y": 0, "z": 1},
        "offset": 0.1,
    },
}
"""Dimensions for any primitive."""

CONE = {"type": "cone twist", "joint limits": {"x": 0.5, "y": 0.5, "z": 0.5}}
SIX = {"type": "six dof spring", "joint limits": {half: {"low": AT, "high": AT} for half in ("linear", "angular")}}
SPRING = {"type": "linear spring", "joint limits": {"low": -0.1, "high": 0.1}}
CONTEXTS: dict[tuple[str, str], dict[str, Any]] = {
    **{
        (kind, path): context
        for kind in ("body", "ghost object")
        for block, prefix in (
            ("geometry", ""), ("collision geometry", "collision "), ("compound shape[].geometry", ""),
            ("compound collision shape[].geometry", ""),
        )
        for path, context in primitives(block, prefix).items()
    },
    **{
        (kind, f"{block}[].{key}"): {block: [dict(ANY_SHAPE)], "collision shape": None}
        for kind in ("body", "ghost object") for block in ("compound shape", "compound collision shape")
        for key in ("shape", "offset")
    },
    **{(kind, "collision mesh"): {"collision shape": None} for kind in ("body", "ghost object")},
    **{(kind, "collision mesh type"): {"collision shape": None} for kind in ("body", "ghost object")},
    ("body", "low resolution path"): {"collision shape": None},
    ("ghost object", "low resolution path"): {"collision shape": None},
    ("body", "color components.ambient.level"): {"color components": {"diffuse": {"r": 0.5, "g": 0.5, "b": 0.5}, "transparency": 1}},
    ("body", "controller output type"): {"controller": {half: {"P": 10, "D": 1} for half in ("linear", "angular")}},
    **{
        (kind, "use material"): {"color rgba": {"r": 1, "g": 0, "b": 0, "a": 1}}
        for kind in ("body", "ghost object", "soft body", "volume")
    },
    ("volume", "color components.ambient.level"): {"color components": {"diffuse": {"r": 0.5, "g": 0.5, "b": 0.5}, "transparency": 1}},
    ("soft body", "color components.ambient.level"): {"color components": {"diffuse": {"r": 0.5, "g": 0.5, "b": 0.5}, "transparency": 1}},
    **{("soft body", f"config.{key}"): {"config": {"kLST": 0.5, "kMT": 0.0}} for key in ("kLST", "piterations", "kMT")},
    **{
        ("soft body", f"config.{key}"): {"config": {"kLST": 0.01, other: 0.0}}
        for key, other in (("kVC", "kPR"), ("kPR", "kVC"))
    },
    ("joint", "parent"): {"child": "BODY far"}, ("joint", "child offset"): {},
    ("camera", "camera intrinsics.f"): {"camera intrinsics": {"cx": 320, "cy": 240}},
    ("camera", "publish depth noise.std dev"): {"publish depth": True, "publish depth noise": {"mean": 0.0, "bias": 0.0}},
    **{
        (kind, path): shaped(ANY_SHAPE, prefix)
        for kind in ("body", "ghost object") for path, prefix in (("shape", ""), ("collision shape", "collision "))
    },
    ("joint", "joint limits.x"): CONE, ("joint", "joint limits.y"): CONE,
    ("joint", "joint limits.z"): CONE,
    ("joint", "joint limits.low"): {"joint limits": {"high": 1.0}},
    ("joint", "joint limits.high"): {"joint limits": {"low": -1.0}},
    ("sensor", "mesh"): {"array": None}, ("sensor", "distance threshold"): {"type": "Contact"},
    ("sensor", "process contact details"): {"type": "Contact"},
    ("camera", "orthographic view width"): {}, ("suture", "USP size"): {"diameter": None},
    ("suture", "release force"): {"parent": "BODY base"},
    ("light", "location.orientation"): {"direction": None, "location": dict(AT)},
    ("camera", "field view angle"): {},
}  # fmt: skip
"""What must stand beside a key for it to count; None takes a key away."""

BESIDE: list[tuple[str, dict[str, Any]]] = [
    (
        "color components",
        {
            "color components": {
                "transparency": 0.5,
                **{part: {"r": 0.5, "g": 0.5, "b": 0.5} for part in ("diffuse", "specular", "emission")},
            }
        },
    ),
    ("color rgba", {"color rgba": {"r": 0.5, "g": 0.5, "b": 0.5, "a": 0.5}}),
    ("inertia.", {"inertia": {"ix": 0.01, "iy": 0.01, "iz": 0.01}}),
    ("publish frequency", {"publish frequency": {"low": 10, "high": 100}}),
    ("camera intrinsics", {"camera intrinsics": {"fx": 500, "fy": 500, "cx": 320, "cy": 240}}),
    ("clipping plane", {"clipping plane": {"near": 0.01, "far": 5.0}}),
    ("stereo", {"stereo": {"mode": "PASSIVE", "eye separation": 0.01, "focal length": 1.0}}),
    ("publish depth noise", {"publish depth": True, "publish depth noise": {"mean": 0.0, "std_dev": 0.01, "bias": 0.0}}),
    ("publish image resolution", {"publish image resolution": {"width": 320, "height": 240}}),
    ("window resolution", {"window resolution": {"width": 320, "height": 240}}),
    ("preprocessing shaders", {"preprocessing shaders": SHADERS}),
    ("depth compute shaders", {"depth compute shaders": SHADERS}),
    ("shaders", {"shaders": SHADERS}),
    ("parametric", {"array": None, "parametric": {"resolution": 2, "horizontal angle": 1.0, "vertical angle": 0.5, "start offset": 0.1}}),
    ("contact area", {"type": "Resistance"}), ("contact stiffness", {"type": "Resistance"}),
    ("friction.", {}),
    ("haptic gain", {"haptic gain": {"linear": 10.0, "angular": 10.0}}),
    ("controller gain", {"controller gain": {half: {"P": 10, "D": 1} for half in ("linear", "angular")}}),
    ("controller.linear", {"controller": {half: {"P": 10, "D": 1} for half in ("linear", "angular")}}),
    ("controller.angular", {"controller": {half: {"P": 10, "D": 1} for half in ("linear", "angular")}}),
    ("skybox", {"skybox": {"path": "./", "shaders": SHADERS, **{s: f"{s}.png" for s in ("right", "left", "top", "bottom", "front", "back")}}}),
    ("ligature transfer function", {"ligature transfer function": [{"value": 0.5, "opacity": 0.5}]}),
    ("attenuation", {"attenuation": {"constant": 1.0, "linear": 0.0, "quadratic": 0.0}}),
    ("way", {"way": [{"x": 0.01, "y": 0.02, "z": 0.03}]}),
]  # fmt: skip
"""The same for all keys that begin so."""

PAIRS: dict[tuple[str, str], list[Any]] = {
    ("*", "parent"): ["BODY base", "BODY link"], ("joint", "child"): ["BODY link", "BODY far"],
    ("*", "mesh"): ["part.obj", "plate.stl"], ("*", "collision mesh"): ["part.obj", "plate.stl"],
    ("*", "high resolution path"): ["./", "more/"], ("*", "low resolution path"): ["./", "more/"],
    ("*", "namespace"): ["/a/", "/b/"], ("*", "field view angle"): [0.5, 0.8],
    ("*", "look at"): [AT, {"x": 0, "y": 0.5, "z": 0}], ("*", "up"): [{"x": 0, "y": 0, "z": 1}, {"x": 0, "y": 1, "z": 0}],
    ("*", "projection matrix"): [
        [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, -1, -0.2], [0, 0, -1, 0]],
        [[2, 0, 0, 0], [0, 2, 0, 0], [0, 0, -1, -0.2], [0, 0, -1, 0]],
    ],
    ("*", "direction"): [{"x": 0, "y": 0, "z": -1}, {"x": 1, "y": 0, "z": 0}],
    ("*", "array[].direction"): [{"x": 0, "y": 0, "z": -1}, {"x": 1, "y": 0, "z": 0}],
    ("*", "collision margin"): [0.01, 0.02], ("*", "collision groups"): [[0], [1]], ("*", "pair cameras"): [["one"], ["other"]],
    ("*", "controlling devices"): [["one"], ["other"]],
    ("suture", "USP size"): ["2-0", "5-0"], ("volume", "images.path"): ["./", "./more/"],
    ("volume", "images.prefix"): ["slice", "layer"], ("volume", "images.format"): ["png", "bmp"], ("joint", "enable motor"): [0, 1],
    ("launch", "world config"): ["world.yaml", "other_world.yaml"],
    ("launch", "input devices config"): ["devices.yaml", "no_devices.yaml"],
    ("launch", "multibody configs"): [["model.yaml"], ["model.yaml", "proxy.yaml"]],
    ("world", "environment"): ["proxy.yaml", "environment.yaml"],
    ("input device", "simulated multibody"): ["proxy.yaml", "proxy2.yaml"],
    ("input device", "root link"): ["BODY handle", "BODY knob"],
    ("suture", "elements"): [10, 12], ("body", "collision groups"): [[0], [1]],
    ("soft body", "mesh"): ["lump.obj", "block.obj"], ("soft body", "collision mesh"): ["lump.obj", "block.obj"],
    ("soft body", "config.kVC"): [0.0, 0.5], ("soft body", "config.kPR"): [0.0, 0.5],
    ("soft body", "config.kDP"): [0.0, 0.001], ("soft body", "config.fixed nodes"): [[0], [0, 1]],
}  # fmt: skip
"""Two values of keys whose type does not suggest any."""

CHECKED_ELSEWHERE = {
    ("*", "adf version"): "only one value is right",
    ("actuator", "type"): "there is only one",
    ("launch", "color config"): "never opened, as the table says",
    ("model", "vehicles"): "of kinds that are not simulated",
}


# --- scenes -----------------------------------------------------------------------------------


class Files:
    """A scene in memory, as nested dictionaries by file."""

    def __init__(self) -> None:
        still = {"mass": 0.0, **BOX}
        self.files: dict[str, Any] = {
            "launch.yaml": {
                "world config": "world.yaml", "color config": "colours.yaml", "input devices config": "devices.yaml",
                "multibody configs": ["model.yaml"],
            },
            "world.yaml": {"lights": [], "cameras": []},
            "other_world.yaml": {"lights": [], "cameras": [], "gravity": {"x": 0, "y": 0, "z": -1}},
            "devices.yaml": {"input devices": ["X"], "X": SUBJECTS["input device"]},
            "no_devices.yaml": {"input devices": []},
            "model.yaml": {
                "high resolution path": "./",
                "low resolution path": "./",
                "bodies": ["BODY base", "BODY link", "BODY far"],
                "BODY base": {"name": "base", "collision groups": [0], **still},
                "BODY link": {"name": "link", "mass": 0.1, **BOX},
                "BODY far": {"name": "far", "mass": 0.1, "mesh": "part.obj"},
            },
            "proxy.yaml": {
                "bodies": ["BODY handle", "BODY knob"], "BODY handle": {"name": "handle", "mass": 0.1, **BOX},
                "BODY knob": {"name": "knob", "mass": 0.1, **BOX},
            },
            "proxy2.yaml": {
                "bodies": ["BODY handle"], "BODY handle": {"name": "handle", "mass": 0.2, **BOX},
            },
            "environment.yaml": {"bodies": ["BODY wall"], "BODY wall": {"name": "wall", **still}},
            "colours.yaml": {"white": {"r": 255, "g": 255, "b": 255, "a": 255}},
        }  # fmt: skip

    def subject(self, kind: str) -> dict[str, Any]:
        """The block whose keys are those of ``kind``; made where it is missing."""
        tops = {"launch": "launch.yaml", "world": "world.yaml", "model": "model.yaml", "input devices": "devices.yaml"}
        if kind in tops:
            return self.files[tops[kind]]  # type: ignore[no-any-return]
        if kind == "input device":
            self.files["devices.yaml"]["X"] = copy.deepcopy(SUBJECTS[kind])
            return self.files["devices.yaml"]["X"]  # type: ignore[no-any-return]
        model = self.files["model.yaml"]
        model.setdefault(LISTS[kind], []).append("X")
        model["X"] = copy.deepcopy(SUBJECTS[kind])
        return model["X"]  # type: ignore[no-any-return]

    def write(self, folder: Path) -> Path:
        """Write all files; returns the launch file."""
        for name, content in self.files.items():
            (folder / name).write_text(yaml.safe_dump(content, sort_keys=False))
        return folder / "launch.yaml"


ABSENT = object()
"""Stands for a value that the file does not give."""


def put(block: dict[str, Any], path: str, value: Any) -> None:
    """Set the key ``path`` of a block."""
    first, _, rest = path.partition(".")
    name, listed, _ = first.partition("[]")
    if listed:
        items = block.setdefault(name, [{}])
        put(items[0], rest, value)
    elif rest:
        if not isinstance(block.get(name), dict):
            block[name] = {}
        put(block[name], rest, value)
    elif value is ABSENT:
        block.pop(name, None)
    else:
        block[name] = value


def merge(block: dict[str, Any], more: Mapping[str, Any]) -> None:
    for key, value in more.items():
        if value is None:
            block.pop(key, None)
        else:
            block[key] = json.loads(json.dumps(value))  # blocks that a context shares become separate


def loaded(folder: Path, kind: str, key: Key, context: Mapping[str, Any], value: Any) -> Any:
    """The scene with a key at a value; None when it is refused."""
    files = Files()
    subject = files.subject(kind)
    merge(subject, context)
    put(subject, key.path, value)
    launch = files.write(folder)
    try:
        scene = ligature.load(launch, devices=[0] if kind == "input device" else ())
    except ligature.SceneError as error:
        raise AssertionError(f"{key.path} = {value}: {error}") from error
    mine = [d for d in scene.diagnostics if d.severity >= Severity.ERROR]
    assert not mine, f"{key.path} = {value}: {mine[0]}"
    return scene


# --- leaves -----------------------------------------------------------------------------------

Leaf = tuple[str, str]
"""Class and field that a leaf belongs to."""


def leaves(value: Any, owner: Leaf, found: list[tuple[Leaf, Any]]) -> None:
    """Every number, text and array of a scene, with the field that it belongs to."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        for field in dataclasses.fields(value):
            if field.name not in ("mark", "marks", "diagnostics", "roots"):
                leaves(getattr(value, field.name), (type(value).__name__, field.name), found)
    elif isinstance(value, Mapping):
        for name, each in value.items():
            found.append((owner, str(name)))
            leaves(each, owner, found)
    elif isinstance(value, tuple | list | set | frozenset):
        found.append((owner, len(value)))
        for each in sorted(value, key=repr) if isinstance(value, set | frozenset) else value:
            leaves(each, owner, found)
    elif isinstance(value, np.ndarray):
        found.append((owner, value.tobytes()))
    elif isinstance(value, enum.Enum):
        found.append((owner, value.value))
    else:
        found.append((owner, repr(value)))


def differences(one: Any, other: Any) -> set[Leaf]:
    """Fields in which two scenes differ."""
    first: list[tuple[Leaf, Any]] = []
    second: list[tuple[Leaf, Any]] = []
    leaves(one, ("Scene", ""), first)
    leaves(other, ("Scene", ""), second)
    if len(first) != len(second):
        return {owner for owner, _ in set(first) ^ set(second)}
    return {a[0] for a, b in zip(first, second, strict=True) if a != b}


@cache
def readers() -> str:
    """All source text outside `ligature.model` and the reader of files."""
    return "\n".join(
        path.read_text("utf-8")
        for path in sorted(PACKAGE.rglob("*.py"))
        if path.relative_to(PACKAGE).parts[0] not in ("adf", "authoring", "tissue")
        and not (path.relative_to(PACKAGE).parts[0] == "model" and path.name in BUILDERS)
    )


BUILDERS = ("scene.py", "parts.py", "mounted.py", "builder.py", "load.py", "geometry.py", "assembly.py")
"""Modules of `ligature.model` that only fill what they read into the scene."""


@cache
def is_read(leaf: Leaf) -> bool:
    """Whether anything outside reads a field of that name."""
    return re.search(rf"\.{re.escape(leaf[1])}\b", readers()) is not None


# --- the table --------------------------------------------------------------------------------


def candidates(kind: str, key: Key) -> Iterator[tuple[Any, Any]]:
    """Pairs of different values of a key."""
    for who in (kind, "*"):
        if (who, key.path) in PAIRS:
            yield tuple(PAIRS[who, key.path])  # type: ignore[misc]
            return
    if key.type is Type.CHOICE:
        values = sorted(set(key.choices.values()))
        spelled = {meaning: spelling for spelling, meaning in key.choices.items()}
        yield from ((spelled[values[0]], spelled[other]) for other in values[1:])
        yield from ((spelled[values[1]], spelled[other]) for other in values[2:])
    elif key.type is Type.FLAG:
        yield False, True
    elif key.type in (Type.INTEGER, Type.UNSIGNED):
        yield from ((3, 4), (1, 2))
    elif key.type in (Type.NUMBER, Type.NUMBER_OR_MAP):
        yield from ((0.11, 0.23), (1.5, 2.5), (-0.4, -0.2), (0.0011, 0.0023))
    elif key.type is Type.VECTOR:
        yield {"x": 0.1, "y": 0.2, "z": 0.3}, {"x": 0.3, "y": 0.1, "z": 0.2}
    elif key.type is Type.RPY:
        yield {"r": 0.1, "p": 0.2, "y": 0.3}, {"r": 0.3, "p": 0.1, "y": 0.2}
    elif key.type is Type.POSE:
        yield POSE, OTHER
    elif key.type in (Type.TEXT, Type.PATH):
        yield ("a.png", "b.png") if key.type is Type.PATH else ("alpha", "beta")


def contexts(kind: str, key: Key) -> Iterator[dict[str, Any]]:
    """What may stand beside a key, until it counts."""
    if (kind, key.path) in CONTEXTS:
        yield CONTEXTS[kind, key.path]
        return
    beside: dict[str, Any] = {}
    for begin, more in BESIDE:
        if key.path.startswith(begin):
            beside = more
            break
    yield beside
    if kind == "joint":
        yield from ({**beside, **SPRING}, {**beside, "type": "torsion spring", "joint limits": {"low": -0.1, "high": 0.1}}, {**beside, **copy.deepcopy(SIX)})  # fmt: skip
    if kind == "sensor":
        yield from ({**beside, "type": "Resistance"}, {**beside, "type": "Contact"})


USED = [
    (kind, key)
    for kind, keys in SCHEMA.items()
    if kind not in NOT_SIMULATED
    for key in keys
    if key.status is Status.USED and key.type not in (Type.MAP, Type.MAPS)
    and (kind, key.path) not in CHECKED_ELSEWHERE and ("*", key.path) not in CHECKED_ELSEWHERE
]  # fmt: skip
LISTED = [(kind, key) for kind, key in USED if key.type is Type.TEXTS and (kind, key.path) not in PAIRS and ("*", key.path) not in PAIRS]  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("effects")
    for place in (folder, folder / "more"):
        place.mkdir(exist_ok=True)
        (place / "part.obj").write_text(OBJ)
        trimesh.creation.icosphere(2, 0.05 if place == folder else 0.04).export(place / "lump.obj")
        trimesh.creation.box((0.1, 0.08, 0.06)).export(place / "block.obj")
        (place / "part.mtl").write_text(MTL)
        (place / "plate.stl").write_text(ASCII_STL)
        (place / "red.png").touch()
        for k, (prefix, suffix) in enumerate((("slice", "png"), ("layer", "png"), ("slice", "bmp"))):
            levels = np.linspace(0, 255, 5 + k + (place != folder)).astype(np.uint8)
            for number in range(5):
                Image.fromarray(np.minimum.outer(levels, levels)).save(place / f"{prefix}{number}.{suffix}")
        for name in ("a.vs", "a.fs", "a.png", "b.png"):
            (place / name).write_text("void main() {}\n")
    return folder


@pytest.mark.parametrize(
    ("kind", "key"), [row for row in USED if row not in LISTED], ids=lambda value: value if isinstance(value, str) else value.path
)  # fmt: skip
def test_a_used_key_changes_something_that_is_read(kind: str, key: Key, folder: Path) -> None:
    tried: list[str] = []
    for context in contexts(kind, key):
        for one, other in candidates(kind, key):
            try:
                changed = differences(
                    loaded(folder, kind, key, context, one), loaded(folder, kind, key, context, other)
                )
            except AssertionError as error:
                tried.append(str(error))
                continue
            read = {leaf for leaf in changed if is_read(leaf)}
            if read:
                return
            tried.append(f"{one!r} and {other!r} differ in {sorted(changed) or 'nothing'}, which nobody reads")
    pytest.fail(f"{kind}: '{key.path}' is called used, but: " + "; ".join(tried)[:600])


@pytest.mark.parametrize(("kind", "key"), LISTED, ids=lambda value: value if isinstance(value, str) else value.path)
def test_what_a_list_names_exists(kind: str, key: Key, folder: Path) -> None:
    """Objects that a list leaves out do not exist."""
    files = Files()
    if kind == "input devices":
        full = ligature.load(files.write(folder))
        files.files["devices.yaml"]["input devices"] = []
        assert len(ligature.load(files.write(folder)).input_devices) < len(full.input_devices)
        return
    if kind == "camera":
        pytest.fail(f"'{key.path}' is called used")
    of = {plural: each for each, plural in LISTS.items()}[key.path]
    subject = files.subject(of)
    if kind == "world":
        del files.files["model.yaml"]["X"], files.files["model.yaml"][key.path]
        files.files["world.yaml"] |= {key.path: ["X"], "X": subject}
    full = ligature.load(files.write(folder))
    files.files[f"{kind}.yaml"][key.path].remove("X")
    left = ligature.load(files.write(folder))
    assert differences(full, left)


NUMBERS = [(kind, key) for kind, key in USED if key.type in (Type.NUMBER, Type.NUMBER_OR_MAP)]


@pytest.mark.parametrize(("kind", "key"), NUMBERS, ids=lambda value: value if isinstance(value, str) else value.path)
def test_a_number_that_cannot_be_used_is_an_error_or_has_no_effect(kind: str, key: Key, folder: Path) -> None:
    beyond = [float("nan"), float("inf"), float("-inf")]
    beyond += [] if key.least is None else [key.least - 1.0, -1e6]
    beyond += [] if key.most is None else [1.1 * key.most]
    for context in contexts(kind, key):
        try:
            without = loaded(folder, kind, key, context, ABSENT)
        except AssertionError:
            without = None  # it is required there
        for value in beyond:
            try:
                scene = loaded(folder, kind, key, context, value)
            except AssertionError:
                continue
            assert without is not None, f"{value} is taken beside {context}, where the key is required"
            assert not differences(without, scene), f"{value} is taken beside {context}"
            assert any(d.severity >= Severity.WARNING for d in scene.diagnostics), f"{value} is not reported"
