"""Namespaces and topic names."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ligature import load
from ligature.model.handles import Handles
from ligature.model.naming import merged, topic_name


@pytest.mark.parametrize(
    ("outer", "inner", "result"),
    [
        ("/a/b", "c/", "/a/bc/"),
        ("/a/b/", "c/", "/a/b/c/"),
        ("/a//b/", "/c", "/c"),
        ("/a/", "", "/a/"),
        ("/ambf/env/ecm/", "ambf/env/psm/", "/ambf/env/ecm/ambf/env/psm/"),
    ],
)
def test_an_inner_namespace_is_appended_unless_absolute(outer: str, inner: str, result: str) -> None:
    assert merged(outer, inner) == result


def test_repeated_slashes_collapse_in_topics() -> None:
    assert topic_name("/ambf/env/psm1/", "tool_id/400006") == "/ambf/env/psm1/tool_id/400006"
    assert topic_name("", "Needle") == "/Needle"


SPACES = st.sampled_from(["", "/a/", "b/"])
LISTS = {
    "bodies": "mass: 1", "ghost objects": "collision shape: SPHERE, collision geometry: {radius: 0.1}",
    "sensors": "type: Contact, parent: B0", "actuators": "type: Constraint, parent: B0", "cameras": "parent: B0",
    "lights": "parent: B0", "joints": "type: fixed, parent: B0, child: B1, parent pivot: *o, child pivot: *o, "
    "parent axis: *z, child axis: *z",
}  # fmt: skip
OBJECTS = st.lists(
    st.tuples(st.sampled_from(list(LISTS)), st.sampled_from(["x", " x", "x1", "x 1", "World"]), SPACES, st.booleans()),
    max_size=8,
)


@settings(deadline=None, max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(OBJECTS)
def test_no_two_objects_share_a_topic_and_each_is_found_by_its_key(tmp_path: Path, objects: list[tuple]) -> None:
    objects = [("bodies", "one", "", False), ("bodies", "two", "", False), *objects]
    lists: dict[str, list[str]] = {}
    text = "o: &o {x: 0, y: 0, z: 0}\nz: &z {x: 0, y: 0, z: 1}\nnamespace: /n/\n"
    for number, (kind, name, space, passive) in enumerate(objects):
        key = f"B{number}" if kind == "bodies" else f"K{number}"
        lists.setdefault(kind, []).append(key)
        text += f"{key}: {{name: '{name}', namespace: '{space}', passive: {str(passive).lower()}, {LISTS[kind]}}}\n"
    text += "".join(f"{kind}: [{', '.join(keys)}]\n" for kind, keys in lists.items())
    (tmp_path / "m.yaml").write_text(text)
    scene = load(tmp_path / "m.yaml")
    kinds = (scene.bodies, scene.ghosts, scene.sensors, scene.actuators, scene.cameras, scene.lights)
    found = [thing.identity.topic for things in kinds for thing in things if not thing.identity.passive]
    found += [scene.world.topic]
    assert len(found) == len(set(found)), text
    first = {}  # the first of a name keeps it
    for thing in scene.bodies:
        assert first.setdefault(thing.identity.topic, thing) is thing or thing.identity.passive
    for things in (scene.bodies, scene.joints, scene.cameras):
        handles = Handles("body", things, things)
        assert [handles[key].index for key in handles] == [thing.index for thing in things]


def test_a_name_that_another_object_has_is_reported_with_what_it_gets(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text("bodies: [A, B]\nA: {name: x y, mass: 1}\nB: {name: xy, mass: 1}\n")
    scene = load(tmp_path / "m.yaml")
    assert [body.identity.topic for body in scene.bodies] == ["/xy", "/xy1"]
    (finding,) = (d for d in scene.diagnostics if d.code == "name")
    assert str(finding).endswith(
        "m.yaml:3:11: warning: body 'B' shares the topics '/xy'; it gets '/xy1'; "
        "give each object a name of its own; blanks in names do not count"
    )


BROKEN = {
    "bodies": "mass: 1, mesh: none.obj", "ghost objects": "mesh: none.obj", "cameras": "location: 3",
    "sensors": "type: Proximity, parent: B0, array: []", "actuators": "type: Constraint, parent: none",
    "joints": LISTS["joints"].replace("child: B1", "child: none"),
    "sutures": "length: 0.1, diameter: 0.001, elements: 0", "soft bodies": "mesh: none.obj",
}  # fmt: skip
NAMES = st.tuples(st.sampled_from(["x", " x", "x1"]), SPACES)
LOST = st.lists(st.tuples(st.just(True), st.sampled_from(list(BROKEN)), NAMES), min_size=1, max_size=6)
KEPT = st.lists(st.tuples(st.just(False), st.sampled_from(list(LISTS)), NAMES), min_size=1, max_size=6)


@settings(deadline=None, max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.tuples(LOST, KEPT).flatmap(lambda both: st.permutations(both[0] + both[1])))
def test_an_object_that_is_left_out_takes_no_name_from_others(tmp_path: Path, objects: list[tuple]) -> None:
    def names(with_lost: bool) -> list[tuple[str, str]]:
        lists: dict[str, list[str]] = {"bodies": ["B0", "B1"]}
        text = "o: &o {x: 0, y: 0, z: 0}\nz: &z {x: 0, y: 0, z: 1}\nB0: {name: b0, mass: 1}\nB1: {name: b1, mass: 1}\n"
        for number, (lost, kind, (name, space)) in enumerate(objects):
            if lost and not with_lost:
                continue
            lists.setdefault(kind, []).append(f"K{number}")
            content = (BROKEN if lost else LISTS)[kind]
            text += f"K{number}: {{name: '{name}', namespace: '{space}', {content}}}\n"
        text += "".join(f"{kind}: [{', '.join(keys)}]\n" for kind, keys in lists.items())
        (tmp_path / "m.yaml").write_text(text)
        scene = load(tmp_path / "m.yaml")
        kinds = (scene.bodies, scene.joints, scene.ghosts, scene.sensors, scene.actuators, scene.cameras, scene.lights)
        shared = sum(d.code == "name" for d in scene.diagnostics)
        found = [(thing.identity.identifier, thing.identity.topic) for things in kinds for thing in things]
        return [*found, ("shared", str(shared))]

    assert names(with_lost=True) == names(with_lost=False)


def test_a_body_that_is_left_out_leaves_its_topic_to_the_next_of_its_name(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text("bodies: [A, B]\nA: {name: x, mesh: none.obj}\nB: {name: x, mass: 1}\n")
    scene = load(tmp_path / "m.yaml")
    assert [body.identity.topic for body in scene.bodies] == ["/x"]
    assert not [d for d in scene.diagnostics if d.code == "name"]
