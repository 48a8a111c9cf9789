"""A prefix before all namespaces (``--ns``) renames what a scene has and changes nothing else."""

from __future__ import annotations

import os
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import ligature
import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.model.naming import topic_name
from ligature.model.scene import Scene

ROOT = Path(__file__).resolve().parents[2]
CORPUS = Path(os.environ.get("LIGATURE_CORPUS", ROOT.parent / "shared" / "corpus"))
FILES = [
    pytest.param(file, id=str(file.relative_to(folder)), marks=marks)
    for folder, marks in ((ROOT / "scenes", ()), (CORPUS, (pytest.mark.corpus,)))
    for file in sorted(folder.rglob("*.yaml"))
]
PREFIX = "/left"
NAMED = ("bodies", "joints", "ghosts", "sensors", "actuators", "cameras", "lights")


def expected(scene: Scene, prefix: str) -> dict[str, list[tuple[str, str]]]:
    """Identifier and topic of every object of ``scene``, with ``prefix`` put before by hand."""
    found = {}
    for kind in NAMED:
        identities = [thing.identity for thing in getattr(scene, kind)]
        found[kind] = [
            (prefix + i.identifier, topic_name(prefix + i.namespace, i.topic[len(topic_name(i.namespace, "")) :]))
            for i in identities
        ]
    return found


def difference(one: Any, other: Any, where: str = "scene") -> str:
    """Where two scenes differ but in identities, names and the world's topic; empty when nowhere."""
    if is_dataclass(one) and type(one) is type(other):
        for field in fields(one):
            if field.name in ("identity", "topic", "prefix") or (field.name == "name" and not isinstance(one, Scene)):
                continue
            found = difference(getattr(one, field.name), getattr(other, field.name), f"{where}.{field.name}")
            if found:
                return found
        return ""
    if isinstance(one, tuple | list) and isinstance(other, tuple | list):
        if len(one) != len(other):
            return f"{where}: {len(one)} and {len(other)}"
        pairs = enumerate(zip(one, other, strict=True))
        return next((found for i, (a, b) in pairs if (found := difference(a, b, f"{where}[{i}]"))), "")
    if isinstance(one, np.ndarray):
        return "" if np.array_equal(one, other) else f"{where}: {one} and {other}"
    if hasattr(one, "vertices"):  # meshes, cached by file
        return "" if one is other or np.array_equal(one.vertices, other.vertices) else where
    if isinstance(one, dict):
        return difference(sorted(one.items(), key=str), sorted(other.items(), key=str), where)
    return "" if one == other or type(one).__eq__ is object.__eq__ else f"{where}: {one} and {other}"


def same_but_for(prefix: str, file: Path, roots: list[Path]) -> None:
    """Load ``file`` with and without ``prefix`` and compare."""
    try:
        plain = ligature.load(file, roots=roots)
    except ligature.SceneError:
        with pytest.raises(ligature.SceneError):
            ligature.load(file, roots=roots, namespace_prefix=prefix)
        return
    scene = ligature.load(file, roots=roots, namespace_prefix=prefix)
    assert difference(plain, scene) == ""
    assert {k: [(t.identity.identifier, t.identity.topic) for t in getattr(scene, k)] for k in NAMED} == expected(
        plain, prefix
    )
    assert scene.world.topic == topic_name(prefix + plain.world.namespace, "World")
    assert [hole.name for hole in scene.holes] == [prefix + hole.name for hole in plain.holes]
    assert [rod.name for rod in scene.rods] == [prefix + rod.name for rod in plain.rods]


@pytest.mark.parametrize("file", FILES)
def test_a_file_gives_the_same_scene_with_a_prefix(file: Path) -> None:
    same_but_for(PREFIX, file, [CORPUS] if CORPUS.is_dir() else [])


# --- generated names: parts of one another, in several namespaces and files ------------------

WORDS = st.sampled_from(["BODY A", "BODY A1", "BODY A_001", "A", "BODY", "left", "BODY left/A"])
SPACES = st.sampled_from(["", "/", "/ambf/env/", "/ambf/env/psm1/", "/ambf/env/psm", "ambf/", "/left/", "left"])


@st.composite
def model(draw: Any) -> dict[str, Any]:
    """A model file whose names are hard to report apart, with references of every kind."""
    keys = draw(st.lists(WORDS, min_size=1, max_size=5))
    space = draw(SPACES)
    made: dict[str, Any] = {"namespace": space, "bodies": keys, "joints": [], "cameras": [], "sensors": []}
    reference = st.builds(lambda s, w: s + w, st.one_of(st.just(""), st.just(space), SPACES), WORDS)
    for key in keys:
        made[key] = {
            "name": key.replace("/", "_"),
            "mass": 1,
            "namespace": draw(st.sampled_from(["", "", "/x/", "y/"])),
        }
    for i in range(draw(st.integers(0, 4))):
        made["joints"].append(f"JOINT {i}")
        made[f"JOINT {i}"] = {
            "name": f"j{i}", "type": "revolute", "parent": draw(reference), "child": draw(reference),
            "parent axis": {"x": 1, "y": 0, "z": 0}, "child axis": {"x": 1, "y": 0, "z": 0},
        }  # fmt: skip
    for i in range(draw(st.integers(0, 2))):
        made["cameras"].append(f"CAMERA {i}")
        made[f"CAMERA {i}"] = {
            "name": f"c{i}", "parent": draw(reference), "location": {"x": 1, "y": 0, "z": 0},
            "look at": {"x": 0, "y": 0, "z": 0}, "up": {"x": 0, "y": 0, "z": 1},
        }  # fmt: skip
    for i in range(draw(st.integers(0, 1))):
        made["sensors"].append(f"SENSOR {i}")
        made[f"SENSOR {i}"] = {
            "name": f"s{i}", "type": "Proximity", "parent": draw(reference), "range": 0.1,
            "array": [{"offset": {"x": 0, "y": 0, "z": 0}, "direction": {"x": 1, "y": 0, "z": 0}}],
        }  # fmt: skip
    return made


@settings(max_examples=60)
@given(
    models=st.lists(model(), min_size=1, max_size=3),
    world=SPACES,
    prefix=st.sampled_from(["/left", "left", "/left/", "/ambf/env/", "BODY A", "/a/b", "x_"]),
)
def test_names_that_are_parts_of_each_other_mean_the_same_with_any_prefix(
    tmp_path_factory: pytest.TempPathFactory, models: list[dict[str, Any]], world: str, prefix: str
) -> None:
    folder = tmp_path_factory.mktemp("names")
    (folder / "world.yaml").write_text(yaml.safe_dump({"namespace": world, "gravity": {"x": 0, "y": 0, "z": -9.8}}))
    for i, made in enumerate(models):
        (folder / f"m{i}.yaml").write_text(yaml.safe_dump(made))
    launch = {"world config": "world.yaml", "multibody configs": [f"m{i}.yaml" for i in range(len(models))]}
    (folder / "launch.yaml").write_text(yaml.safe_dump(launch))
    same_but_for(prefix, folder / "launch.yaml", [])


def test_frames_and_topics_beside_objects_begin_with_the_prefix(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text("bodies: [A]\nA: {name: A, mass: 1}\n")
    for prefix, frames in (("", ""), ("/left", "left/"), ("left/", "left/"), ("/a//b", "a/b/")):
        world = ligature.load(tmp_path / "m.yaml", namespace_prefix=prefix).world
        assert (world.frame_prefix, world.root) == (frames, "/" + frames)
