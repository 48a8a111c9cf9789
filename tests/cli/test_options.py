"""Options of a run: what they mean, and that they travel whole."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature.cli.options import RunOptions, arm_entry, name_prefix
from ligature.model.scene import ArmKind

SMALL = Path(__file__).resolve().parents[2] / "scenes" / "suturing_small" / "launch.yaml"


def test_options_travel_whole() -> None:
    options = RunOptions(
        "a.yaml", (1, 2), ("b.yaml",), ("/r",), "/left", arms=("MTML=mtm",), src_crtk=True, notes=("n",)
    )
    assert RunOptions.from_text(options.to_text()) == options


@pytest.mark.parametrize(
    ("text", "entry"),
    [
        (
            "PSM1=psm:psm1/BODY base link:420006",
            {"name": "PSM1", "kind": "psm", "base": "psm1/BODY base link", "tool": "420006"},
        ),
        ("ECM=camera:BODY CameraFrame", {"name": "ECM", "kind": "ecm", "tip": "BODY CameraFrame"}),
        ("ECM=ecm:ecm/BODY base link", {"name": "ECM", "kind": "ecm", "base": "ecm/BODY base link"}),
        ("MTML=mtm", {"name": "MTML", "kind": "mtm"}),
    ],
)
def test_an_arm_is_written_on_the_command_line(text: str, entry: dict[str, str]) -> None:
    assert arm_entry(text) == entry


@pytest.mark.parametrize("text", ["PSM1", "PSM1=", "PSM1=robot:x", "PSM1=psm", "MTML=mtm:x", "PSM1=psm:"])
def test_what_is_no_arm_is_refused_with_the_right_form(text: str) -> None:
    with pytest.raises(ValueError, match="write PSM1=psm:BODY:TOOL"):
        arm_entry(text)


def test_arms_of_the_command_line_replace_those_of_the_scene() -> None:
    scene = RunOptions(str(SMALL), arms=("LEFT=psm:psm2/BODY base link:420006", "MTML=mtm")).load()
    assert [(arm.name, arm.kind) for arm in scene.arms] == [("LEFT", ArmKind.PSM), ("MTML", ArmKind.MTM)]


@given(st.text(max_size=6))
def test_a_prefix_is_one_that_topics_of_ros_may_begin_with(text: str) -> None:
    topic = re.compile(r"/[A-Za-z0-9_/]*")  # what a master registers, ROS names specification; digits behind the '/'
    if topic.fullmatch(f"/{text}"):
        assert name_prefix(text) == text
    else:
        with pytest.raises(ValueError, match="cannot begin names of ROS"):
            name_prefix(text)
