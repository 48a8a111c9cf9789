"""Every seeded fault is found by its own rule, and a sound model draws no finding."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ligature import load
from ligature.adf import Resolver, Severity, read_any
from ligature.adf.writer import write_document
from ligature.authoring.lint import OF_LOADING, READER, RULES, Finding, lint
from ligature.authoring.lint.joints import thread_elements
from ligature.authoring.lint.subject import Subject
from ligature.authoring.objfile import Paint, Surface, obj_texts
from ligature.authoring.shapes import Shape, shape_mesh
from ligature.cli.main import app
from typer.testing import CliRunner

ZERO = {"x": 0.0, "y": 0.0, "z": 0.0}
UP = {"x": 0.0, "y": 0.0, "z": 1.0}
SOUND: dict[str, Any] = {
    "bodies": ["BODY a", "BODY b"],
    "joints": ["JOINT j"],
    "namespace": "/x/",
    "high resolution path": "./high/",
    "low resolution path": "./low/",
    "BODY a": {
        "name": "a", "mass": 1.0, "mesh": "a.obj", "collision mesh": "a_hull.obj", "collision mesh type": "CONVEX_HULL",
        "location": {"position": ZERO, "orientation": {"r": 0.0, "p": 0.0, "y": 0.0}},
    },
    "BODY b": {
        "name": "b", "mass": 2.0, "inertia": {"ix": 0.002, "iy": 0.002, "iz": 0.002}, "collision shape": "BOX",
        "collision geometry": {"x": 0.1, "y": 0.1, "z": 0.1}, "collision margin": 0.0001,
        "location": {"position": {"x": 0.0, "y": 0.0, "z": 0.5}, "orientation": {"r": 0.0, "p": 0.0, "y": 0.0}},
    },
    "JOINT j": {
        "name": "j", "parent": "BODY a", "child": "BODY b", "type": "revolute", "parent pivot": {**UP, "z": 0.5},
        "child pivot": ZERO, "parent axis": UP, "child axis": UP, "joint limits": {"low": -1.0, "high": 1.0},
    },
}  # fmt: skip
PATHS = {"high resolution path": "high", "low resolution path": "low"}
SIX = {"linear": {"low": ZERO, "high": ZERO}, "angular": {"low": ZERO, "high": ZERO}}


def write_mesh(folder: Path, name: str, shape: Shape, material: str = "") -> None:
    folder.mkdir(exist_ok=True, parents=True)
    vertices, faces = shape_mesh(shape)
    triangles = np.array([(f[0], f[i], f[i + 1]) for f in faces for i in range(1, len(f) - 1)], dtype=np.int32)
    obj, mtl = obj_texts([Surface(Paint("m"), vertices, triangles)], name.replace(".obj", ".mtl"), name)
    (folder / name).write_text(obj)
    (folder / name.replace(".obj", ".mtl")).write_text(mtl + material)


@pytest.fixture
def model(tmp_path: Path):
    write_mesh(tmp_path / "high", "a.obj", Shape("SPHERE", radius=0.05))
    write_mesh(tmp_path / "low", "a_hull.obj", Shape("BOX", size=(0.1, 0.1, 0.1)))

    def found(changes: dict[str, Any] | None = None, **settings: Any) -> list[Finding]:
        values = copy.deepcopy(SOUND)
        for path, value in (changes or {}).items():
            *inner, name = path.split("/")
            target = values
            for part in inner:
                target = target.setdefault(part, {})
            if value is None:
                target.pop(name, None)
            else:
                target[name] = value
        (tmp_path / "m.yaml").write_text(write_document("model", values) + settings.pop("more", ""))
        resolver = Resolver([tmp_path])
        return lint(read_any(tmp_path / "m.yaml", resolver), resolver, **settings)

    found.folder = tmp_path  # type: ignore[attr-defined]
    return found


def test_a_sound_model_draws_no_finding(model) -> None:
    assert model() == []


CASES: list[tuple[str, dict[str, Any]]] = [
    ("mass-missing", {"BODY a/mass": None}),
    ("inertia-impossible", {"BODY b/inertia": {"ix": 1.0, "iy": 1.0, "iz": 5.0}}),
    ("inertia-impossible", {"BODY b/inertia": {"ix": 0.0, "iy": 1.0, "iz": 1.0}}),
    ("inertia-unlike-geometry", {"BODY b/inertia": {"ix": 1.0, "iy": 1.0, "iz": 1.0}}),
    ("capsule-too-short", {"BODY b/collision shape": "CAPSULE", "BODY b/collision geometry": {"radius": 0.1, "height": 0.1}}),
    ("plane-in-compound", {"BODY b/collision shape": None, "BODY b/compound collision shape": [
        {"shape": "PLANE", "geometry": {"normal": UP, "offset": 0.0}}, {"shape": "SPHERE", "geometry": {"radius": 0.1}}]}),
    ("group-out-of-range", {"BODY b/collision groups": [1, 1000]}),
    ("groups-without-effect", {"ignore inter-collision": True, "BODY a/collision groups": [1], "BODY b/collision groups": [1]}),
    ("concave-moving", {"BODY a/collision mesh type": "CONCAVE_MESH"}),
    ("thin-for-margin", {"BODY b/collision margin": 0.05}),
    ("name-clash", {"BODY b/name": " a"}),
    ("overlap-at-rest", {"BODY b/location/position": {"x": 0.0, "y": 0.0, "z": 0.9}, "bodies": ["BODY a", "BODY b", "BODY c"],
                         "BODY c": {"name": "c", "mass": 1.0, "collision shape": "SPHERE", "collision geometry": {"radius": 0.1},
                                    "location": {"position": {"x": 0.0, "y": 0.0, "z": 0.9}}}}),
    ("reference-unresolved", {"JOINT j/parent": "BODY nowhere"}),
    ("reference-elsewhere", {"JOINT j/parent": "psm1/BODY nowhere"}),
    ("static-child", {"BODY b/mass": 0.0}),
    ("mass-ratio", {"BODY b/mass": 200.0}),
    ("limits-reversed", {"JOINT j/joint limits": {"low": 1.0, "high": -1.0}}),
    ("limits-reversed", {"JOINT j/type": "six dof", "JOINT j/joint limits": {**SIX, "linear": {"low": UP, "high": ZERO}}}),
    ("spring-without-stiffness", {"JOINT j/type": "six dof spring", "JOINT j/joint limits": SIX}),
    ("equilibrium-outside", {"JOINT j/type": "linear spring", "JOINT j/stiffness": 1.0, "JOINT j/equilibrium point": 5.0}),
    ("travel-too-long", {"JOINT j/type": "prismatic", "JOINT j/joint limits": {"low": -60.0, "high": 60.0}}),
    ("axes-nearly-antiparallel", {"JOINT j/child axis": {"x": 0.005, "y": 0.0, "z": -1.0}}),
    ("axis-zero", {"JOINT j/child axis": ZERO}),
    ("joint-residual", {"BODY b/location/position": {"x": 0.0, "y": 0.1, "z": 0.5}}),
    ("mesh-missing", {"BODY a/mesh": "nowhere.obj"}),
    ("path-outside", {"high resolution path": "../../../../"}),
    ("unit-smell", {"BODY b/location/position": {"x": 0.0, "y": 0.0, "z": 500.0}}),
    ("clipping-ratio", {"cameras": ["cam"], "cam": {"name": "cam", "look at": UP, "up": {"x": 1.0, "y": 0.0, "z": 0.0},
                                                    "clipping plane": {"near": 1e-5, "far": 10.0}}}),
    ("legacy-key", {"JOINT j/controller gains": {"P": 1}}),
    ("float-noise", {"BODY b/location/orientation": {"r": 1e-8, "p": 0.0, "y": 0.0}}),
    ("reader:unknown", {"BODY b/masss": 1.0}),
    ("reader:value", {"BODY b/scale": "big"}),
    ("reader:range", {"BODY b/scale": float("nan")}),
]  # fmt: skip


@pytest.mark.parametrize(("name", "changes"), CASES, ids=[f"{i}-{name}" for i, (name, _) in enumerate(CASES)])
def test_a_seeded_fault_is_found_by_its_rule(model, name: str, changes: dict[str, Any]) -> None:
    found = [finding for finding in model(changes) if finding.rule == name]
    assert found, [str(f) for f in model(changes)]
    assert found[0].message and (found[0].hint or name.startswith("reader"))


@pytest.mark.parametrize("elements", [3, 4, 6])
@pytest.mark.parametrize("opted_out", ["", "body", "file"])
def test_a_needle_on_a_thread_may_weigh_what_it_likes(model, elements: int, opted_out: str) -> None:
    """The solver of a thread does not iterate over its joints; a chain that stays bodies is warned about."""
    names = [f"BODY t{n}" for n in range(elements)]
    body = {"mass": 1e-4, "collision shape": "CAPSULE", "collision geometry": {"radius": 0.001, "height": 0.01}}
    spring = {"type": "six dof spring", "joint limits": SIX, "stiffness": {"linear": ZERO, "angular": UP}}
    ends = {"parent pivot": ZERO, "child pivot": ZERO, "parent axis": UP, "child axis": UP}
    changes: dict[str, Any] = {"bodies": ["BODY a", "BODY b", *names], "BODY b/mass": 1.0}
    joints = {"JOINT tail": ("BODY b", names[0])} | {f"JOINT s{n}": names[n : n + 2] for n in range(elements - 1)}
    changes |= {name: {"name": name[5:], **body} for name in names}
    changes |= {key: {"name": key[6:], "parent": p, "child": c, **spring, **ends} for key, (p, c) in joints.items()}
    changes["joints"] = ["JOINT j", *joints]
    changes |= {"": {}, "body": {f"{names[1]}/ligature rod": False}, "file": {"ligature rod": False}}[opted_out]
    found = [finding.key for finding in model(changes) if finding.rule == "mass-ratio"]
    assert found == ([] if elements >= 4 and not opted_out else ["JOINT tail"])


@pytest.mark.parametrize("seed", range(60))
def test_the_elements_of_threads_are_those_that_a_scene_has(tmp_path: Path, seed: int) -> None:
    """Chains with branches, rings, gaps, other shapes and joints, opted out in part: both readers agree."""
    random = np.random.default_rng(seed)
    names = [f"BODY t{n}" for n in range(random.integers(2, 16))]
    shapes: dict[str, dict[str, float]] = {
        "CAPSULE": {"radius": 0.001, "height": 0.01},
        "SPHERE": {"radius": 0.004},
        "BOX": dict.fromkeys("xyz", 0.01),
    }
    wide = {**SIX, "linear": {"low": ZERO, "high": UP}}
    rarely = random.uniform(0.0, 0.3)  # how often something is unlike a thread
    values: dict[str, Any] = {"bodies": names, "namespace": "/x/"}
    for n, name in enumerate(names):
        shape = random.choice(list(shapes), p=[1 - rarely, 2 * rarely / 3, rarely / 3])
        values[name] = {
            "name": name[5:], "mass": 0.0 if random.random() < rarely / 3 else 1e-4, "collision shape": str(shape),
            "collision geometry": shapes[shape], "location": {"position": {**ZERO, "z": 0.01 * n}},
        } | ({"ligature rod": False} if random.random() < rarely / 3 else {})  # fmt: skip
    pairs = [(n, n + 1) for n in range(len(names) - 1) if random.random() > rarely / 3]
    regular = len(pairs)
    pairs += [tuple(random.choice(len(names), 2, replace=False)) for _ in range(random.poisson(rarely))]
    for k, (a, b) in enumerate(pairs):
        parent, child, pivot = (b, a, -0.005) if random.random() < rarely else (a, b, 0.005)
        if k >= regular:
            pivot *= random.uniform(0.1, 0.9)  # two joints at one place would leave an element no length
        values[f"JOINT s{k}"] = {
            "name": f"s{k}", "parent": names[parent], "child": names[child],
            "type": "revolute" if random.random() < rarely / 4 else "six dof spring",
            "joint limits": wide if random.random() < rarely / 4 else SIX,
            "parent pivot": {**ZERO, "z": pivot}, "child pivot": {**ZERO, "z": -pivot},
            "stiffness": {"linear": ZERO, "angular": UP}, "parent axis": UP, "child axis": UP,
        } | ({"ligature rod": False} if random.random() < rarely / 4 else {})  # fmt: skip
    values["joints"] = [key for key in values if key.startswith("JOINT")]
    path = tmp_path / "m.yaml"
    path.write_text(json.dumps(values))
    scene = load(path)
    simulated = {scene.bodies[body].identity.key for rod in scene.rods for body in rod.bodies}
    resolver = Resolver([tmp_path])
    assert thread_elements(Subject(read_any(path, resolver), resolver)) == simulated


@pytest.mark.parametrize("scale", [0.01, 50.0])
def test_a_mesh_counts_as_large_as_its_scale_makes_it(model, scale: float) -> None:
    for folder, name, size in (("high", "a.obj", 0.1), ("low", "a_hull.obj", 0.09)):
        write_mesh(model.folder / folder, name, Shape("BOX", size=(size / scale,) * 3))
    moments = dict.fromkeys(("ix", "iy", "iz"), 1.0 / 600.0)
    pivot = {**UP, "z": 0.5 / scale}  # scaled too
    assert model({"BODY a/scale": scale, "BODY a/inertia": moments, "JOINT j/parent pivot": pivot}) == []
    assert {f.rule for f in model({"BODY a/inertia": moments})} >= {"inertia-unlike-geometry"}


def test_folders_are_those_that_the_simulator_opens(model) -> None:
    absolute = {key: str(model.folder / name) for key, name in PATHS.items()}
    assert model(absolute) == []
    assert (
        model({**dict.fromkeys(PATHS, "elsewhere/"), **{f"BODY a/{key}": path for key, path in absolute.items()}}) == []
    )
    write_mesh(model.folder / "low" / "own", "a_hull.obj", Shape("BOX", size=(0.1, 0.1, 0.1)))
    write_mesh(model.folder / "high" / "own", "a.obj", Shape("SPHERE", radius=0.05))
    for folder, name in (("high", "a.obj"), ("low", "a_hull.obj")):
        (model.folder / folder / name).unlink()
    assert "mesh-missing" not in {f.rule for f in model({"BODY a/high resolution path": "own"})}


def test_faults_of_meshes_are_found(model) -> None:
    def rules() -> set[str]:
        return {finding.rule for finding in model()}

    high, low = model.folder / "high", model.folder / "low"
    write_mesh(low, "a_hull.obj", Shape("PLANE"))
    assert rules() == {"hull-flat"}
    write_mesh(low, "a_hull.obj", Shape("SPHERE", radius=0.05))
    assert rules() >= {"hull-too-fine"}
    (low / "a_hull.obj").write_bytes((high / "a.obj").read_bytes())
    assert "low-equals-high" in rules()
    (low / "a_hull.obj").write_text("v 0 0 0\nv 1 0 0\n")
    assert "mesh-empty" in rules()
    write_mesh(low, "a_hull.obj", Shape("BOX"))
    for line, name in (("map_Bump -bm 1.0 n.png", "material-dialect"), ("map_Kd /home/me/t.png", "material-dialect")):
        write_mesh(high, "a.obj", Shape("SPHERE", radius=0.05), line + "\n")
        assert name in rules()
    (high / "n.png").write_bytes(b"x")
    write_mesh(high, "a.obj", Shape("SPHERE", radius=0.05), "map_Bump n.png\n")
    assert rules() == {"normal-map-without-uv"}
    write_mesh(high, "a.obj", Shape("SPHERE", radius=0.05))
    write_mesh(high, "left_over.obj", Shape("BOX"))
    assert rules() == {"file-unreferenced"}


def test_two_definitions_of_one_body_are_found(model) -> None:
    assert "duplicate-identifier" in {f.rule for f in model(more="BODY a:\n  name: again\n  mass: 1\n")}


def test_inertia_inflated_on_purpose_is_no_fault(model) -> None:
    changes = {"BODY b/inertia": {"ix": 1.0, "iy": 1.0, "iz": 1.0}}
    assert model(changes, inflated=frozenset({"BODY b"})) == []


def test_a_mesh_that_is_about_to_be_written_is_no_fault(model) -> None:
    assert model({"BODY a/mesh": "new.obj"}, unsaved=frozenset({"new.obj"})) == [
        f for f in model({"BODY a/mesh": "new.obj"}) if f.rule == "file-unreferenced"
    ]


def test_fixes_mend_what_they_claim_to(model) -> None:
    for name, changes in CASES:
        for finding in model(changes):
            if finding.rule == name and finding.fix:
                mended = {**changes}
                for path, value in finding.fix.items():
                    mended["/".join((finding.key, *path.split(".")))] = (
                        list(value) if isinstance(value, tuple) else value
                    )
                assert name not in {f.rule for f in model(mended) if f.key == finding.key}, name


def test_every_rule_has_a_seeded_fault() -> None:
    seeded = {name for name, _ in CASES} | {
        "hull-flat", "hull-too-fine", "low-equals-high", "mesh-empty", "material-dialect", "normal-map-without-uv",
        "file-unreferenced", "duplicate-identifier",
    }  # fmt: skip
    assert set(RULES) <= seeded


def test_the_command_names_each_finding_at_its_object_when_authors_ask(model) -> None:
    for _, changes in CASES:
        found = [f for f in model(changes) if not f.rule.startswith(READER) and f.rule not in OF_LOADING]
        lines = (model.folder / "m.yaml").read_text().splitlines()
        output = CliRunner().invoke(app, ["check", "--author", str(model.folder / "m.yaml")]).output
        for finding in found:
            (row,) = [line for line in output.splitlines() if f"{finding.key or 'model'}: {finding.message}" in line]
            place, _, text = row.partition(f": {finding.severity.name.lower()}: ")
            assert text.endswith(f"; {finding.hint}")
            if finding.key:
                assert lines[int(place.split(":")[-2]) - 2] == f"{finding.key}:"


def test_what_another_model_of_the_launch_file_has_is_no_finding(model) -> None:
    changes = {"bodies": ["BODY b"], "joints": [], "BODY a": None, "JOINT j": None, "ghost objects": ["GHOST g"]}
    ghost = {
        "name": "g",
        "parent": "BODY elsewhere",
        "collision shape": "SPHERE",
        "collision geometry": {"radius": 0.1},
    }
    assert {f.rule for f in model({**changes, "GHOST g": ghost})} == {"reference-unresolved"}
    (model.folder / "other.yaml").write_text("bodies: [BODY elsewhere]\nBODY elsewhere: {name: e, mass: 0}\n")
    launch = model.folder / "launch.yaml"
    (model.folder / "world.yaml").write_text("namespace: /x/\n")
    launch.write_text("world config: world.yaml\nmultibody configs: [other.yaml, m.yaml]\n")
    result = CliRunner().invoke(app, ["check", "--author", str(launch)])
    assert "elsewhere" not in result.output


def test_a_world_is_checked_for_what_worlds_have(tmp_path: Path) -> None:
    camera = "name: c\n  look at: {x: 1, y: 0, z: 0}\n  clipping plane: {near: 1.0e-6, far: 10}\n"
    (tmp_path / "w.yaml").write_text(f"environment: e.yaml\nnamespace: /x/\ncameras: [c]\nc:\n  {camera}")
    resolver = Resolver([tmp_path])
    assert [f.rule for f in lint(read_any(tmp_path / "w.yaml", resolver), resolver)] == ["clipping-ratio"]


def test_real_models_are_checked_without_a_crash(corpus: Path) -> None:
    resolver, severe = Resolver([corpus]), 0
    for file in sorted((corpus / "suturing_scene").rglob("*.yaml")):
        document = read_any(file, resolver)
        if document.kind == "model":
            severe += sum(f.severity >= Severity.ERROR for f in lint(document, resolver))
    assert severe < 60
