"""Name policies: what unmodified clients find when they look objects up by a part of their name."""

from __future__ import annotations

import re
from pathlib import Path

import ligature
import pytest
from ligature.model.scene import Identity
from ligature.ros import conversion, names

WORLD = "/ambf/env/World"
LOOK_UPS = {
    "Needle": "/ambf/env/Needle",
    "CameraFrame": "/ambf/env/CameraFrame",
    **{f"{hole}{n}": f"/ambf/env/phantom/{hole}{n}" for hole in ("Entry", "Exit") for n in (1, 2, 3, 4)},
    **{f"phantom/{hole}{n}": f"/ambf/env/phantom/{hole}{n}" for hole in ("Entry", "Exit") for n in (1, 2, 3, 4)},
    "psm1/baselink": "/ambf/env/psm1/baselinksimple",
    "psm1/tool_id": "/ambf/env/psm1/tool_id/400006",
    "psm1/toolyawlink": "/ambf/env/psm1/toolyawlinksimple",
    "psm1/left_finger_ghost": "/ambf/env/ghosts/psm1/left_finger_ghost",
    "psm1/right_finger_ghost": "/ambf/env/ghosts/psm1/right_finger_ghost",
    "psm1/Actuator0": "/ambf/env/ghosts/psm1/Actuator0",
    "cameraL": "/ambf/env/cameras/cameraL",
}
"""What the challenge's scripts look up, and what they must find."""


def identity(topic: str) -> Identity:
    return Identity(key="", name=topic.rpartition("/")[2], identifier="", topic=topic, model=0)


@pytest.fixture(scope="module")
def scene(corpus: Path) -> ligature.Scene:
    return ligature.load(corpus / "suturing_scene" / "launch.yaml", [10, 11, 6, 7, 8, 9])


def advertised(scene: ligature.Scene, policy: str) -> list[str]:
    objects = [(template.kind, template.identity) for template in conversion.templates(scene)]
    return [topic for topic in names.topics(objects, policy, scene.world.topic) if topic is not None]


@pytest.mark.corpus
@pytest.mark.parametrize("part", LOOK_UPS)
def test_every_look_up_of_the_challenges_scripts_finds_exactly_one_object(scene: ligature.Scene, part: str) -> None:
    assert [topic for topic in advertised(scene, "src") if part in topic] == [LOOK_UPS[part]]


@pytest.mark.corpus
def test_the_stock_names_are_ambiguous_for_those_scripts(scene: ligature.Scene) -> None:
    assert len([topic for topic in advertised(scene, "ambf") if "Entry1" in topic]) == 2


@pytest.mark.corpus
@pytest.mark.parametrize("policy", names.POLICIES)
def test_no_two_objects_share_a_name(scene: ligature.Scene, policy: str) -> None:
    topics = advertised(scene, policy)
    assert len(topics) == len(set(topics))


OURS = Path(__file__).resolve().parents[2] / "scenes" / "suturing" / "launch.yaml"
SCENERY = re.compile(r"/(Table|BlackGround1?|Barrier)\Z|/psm[12]/toolpitchlink\Z")
"""What no client asks for: decor, and a link that an instrument has when its wrist is drawn."""

INSTRUMENT = re.compile(r"(?<=link)simple\Z|[/_]4[02]0006\Z")
"""What names of links state of the instrument; clients look for what stands before it."""


def asked_for(scene: ligature.Scene, policy: str) -> dict[str, str]:
    """Names of objects that clients use, whatever the instrument, and the types of their messages."""
    templates = conversion.templates(scene)
    topics = names.topics([(t.kind, t.identity) for t in templates], policy, scene.world.topic)
    return {
        INSTRUMENT.sub("", topic): type(template.message).__name__
        for template, topic in zip(templates, topics, strict=True)
        if topic is not None and not SCENERY.search(topic)
    }


@pytest.mark.corpus
@pytest.mark.parametrize("policy", names.POLICIES)
def test_our_scene_and_the_labs_agree_on_all_names_that_clients_use(scene: ligature.Scene, policy: str) -> None:
    ours = ligature.load(OURS)
    assert asked_for(ours, policy) == asked_for(scene, policy)
    assert len(asked_for(ours, policy)) > 15
    assert [(arm.name, arm.kind, len(arm.joints)) for arm in ours.arms] == [
        (arm.name, arm.kind, len(arm.joints)) for arm in scene.arms
    ]


def test_every_look_up_finds_exactly_one_object_in_our_scene() -> None:
    topics = advertised(ligature.load(OURS), "src")
    assert {part: len([topic for topic in topics if part in topic]) for part in LOOK_UPS} == dict.fromkeys(LOOK_UPS, 1)


def test_the_prefix_of_all_namespaces_is_kept() -> None:
    needle = identity("/left/ambf/env/phantom/Needle")
    assert names.topics([("body", needle)], "src", "/left/ambf/env/World") == ["/left/ambf/env/Needle"]


def test_a_second_needle_and_other_kinds_with_such_names_are_left_out() -> None:
    objects = [
        ("body", identity("/ambf/env/a/Needle")),
        ("body", identity("/ambf/env/b/Needle")),
        ("sensor", identity("/ambf/env/Needle/tip_sensor")),
        ("ghost", identity("/ambf/env/phantom/ghostExit2")),
        ("body", identity("/ambf/env/phantom/Exit2")),
    ]
    assert names.topics(objects, "src", WORLD) == ["/ambf/env/Needle", None, None, None, "/ambf/env/phantom/Exit2"]
