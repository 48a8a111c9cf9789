"""Topics of strangers that nobody serves: each is reported once, with what to use instead."""

from __future__ import annotations

import functools
import random
from collections.abc import Callable
from typing import Any
from xmlrpc.client import ServerProxy

import pytest
from ligature.model.scene import ArmKind

pytestmark = pytest.mark.ros
pytest.importorskip("rospy")

ARMS = {"PSM1": ArmKind.PSM, "PSM2": ArmKind.PSM, "ECM": ArmKind.ECM, "MTML": ArmKind.MTM}
SIM, CAMERAS, WATCHER = "/ligature", "/ligature_cameras", "/ligature_rivals"
OBJECTS = ("World", "psm1/baselink", "phantom/Needle", "cameras/cameraL", "phantom/CameraFrame")
Known = dict[str, list[str]]


def served(root: str = "/") -> tuple[Known, Known]:
    """What a run publishes and subscribes, as a master lists it."""
    out, into = names()
    published = {root + name: [SIM] for name in out}
    subscribed = {root + name: [SIM] for name in into}
    subscribed |= {name: [WATCHER] for name in published if name.endswith("measured_cp")}
    return published, subscribed


@functools.cache
def names() -> tuple[list[str], list[str]]:
    """What a run publishes and subscribes: the tables of the arms, and some objects."""
    from ligature.ros.arms.commands import listeners
    from ligature.ros.arms.events import event_topics
    from ligature.ros.arms.readings import readings

    out, into = [f"ambf/env/{name}/State" for name in OBJECTS], [f"ambf/env/{name}/Command" for name in OBJECTS]
    for arm, kind in ARMS.items():
        out += [f"{arm}/{name}" for name in (*(r.topic for r in readings(kind, (), "")), *event_topics(kind))]
        into += [f"{arm}/{topic}" for topic, _, _ in listeners(0, kind)]
    out += ["console/teleop/enabled", "footpedals/clutch", "console/clutch", "SUJ/PSM1/measured_cp"]
    into += ["console/teleop/enable", "system/power_on", "console/emulate_clutch"]
    return out, into


def finder(root: str = "/") -> Any:
    from ligature.ros.unserved import Unserved

    return Unserved(root, list(ARMS))


def reported(topic: str, sends: bool, root: str = "/") -> str:
    """The line for one topic of a stranger; empty without one."""
    published, subscribed = served(root)
    (published if sends else subscribed)[topic] = ["/stranger"]
    found = finder(root)
    assert found.look(published.items(), subscribed.items()) == []
    lines = found.look(published.items(), subscribed.items())
    assert len(lines) < 2
    return "".join(lines)


def test_every_former_name_leads_to_one_that_arms_have() -> None:
    from ligature.ros.unserved import RENAMED

    published, subscribed = served()
    for old, new in RENAMED.items():
        owners = [arm for arm in ARMS if f"/{arm}/{new}" in {**published, **subscribed}]
        assert owners, f"{old}: no arm has {new}"
        for prefix in ("/", "/dvrk/"):
            sends = SIM in subscribed.get(f"/{owners[0]}/{new}", ())
            line = reported(f"{prefix}{owners[0]}/{old}", sends)
            assert line.endswith(f"; since dVRK 2.x it is /{owners[0]}/{new}"), line
            assert line.startswith(f"node /stranger {'publishes' if sends else 'subscribes'} {prefix}{owners[0]}/{old}")


@pytest.mark.parametrize(
    ("topic", "sends", "why"),
    [
        ("/dvrk/footpedals/clutch", False, "here it is /footpedals/clutch"),
        ("/PSM3/servo_cp", True, "this run has the arms PSM1, PSM2, ECM, MTML"),
        ("/SUJ/PSM3/measured_cp", False, "this run has the arms PSM1, PSM2, ECM, MTML"),
        ("/IO/PSM1/pot", False, "the simulator has no controller boards"),
        ("/PSM1/io/tool", False, "the simulator has no controller boards"),
        ("/endoscope_focus/lock", True, "the simulated endoscope is always in focus"),
        ("/console/teleop/select_teleop_psm", True, "run 'ligature teleop', which serves it"),
        ("/CRTK/psm1/servo_cp", True, "run with '--src-crtk', which provides these names"),
        ("/ambf/env/Needle/State", False, "run with '--names src', which provides this name"),
        ("/ambf/env/psm1/base_link/Command", True, "a similar name is /ambf/env/psm1/baselink/Command"),
        ("/PSM1/measured_jp", False, "a similar name is /PSM1/measured_js"),
    ],
)
def test_what_a_run_lacks_has_a_reason_or_a_remedy(topic: str, sends: bool, why: str) -> None:
    assert reported(topic, sends).partition("; ")[2] == why


def test_a_run_with_a_prefix_names_it() -> None:
    line = reported("/PSM1/measured_cp", False, "/left/")
    assert (
        line == "node /stranger subscribes /PSM1/measured_cp, which nobody publishes; here it is /left/PSM1/measured_cp"
    )
    assert reported("/right/PSM1/measured_cp", False, "/left/") == "", "the run beside this one is not its business"


def test_pictures_have_time_to_come() -> None:
    from ligature.ros.unserved import PICTURE_LOOKS

    published, subscribed = served()
    subscribed["/ambf/env/cameras/cameraL/ImageData"] = ["/viewer"]
    found = finder()
    looks = [found.look(published.items(), subscribed.items()) for _ in range(PICTURE_LOOKS + 3)]
    assert [len(lines) for lines in looks] == [0] * (PICTURE_LOOKS - 1) + [1] + [0] * 3
    assert "pictures need a run without '--no-cameras'" in looks[PICTURE_LOOKS - 1][0]


def thing(rng: random.Random, sends: bool) -> str:
    """A topic that no run has, of a command or a reading."""
    return f"/PSM1/{'servo_' if sends else ''}thing{rng.randrange(30)}"


def commands(topic: str) -> bool:
    """Whether an arm or a thing takes this topic."""
    return topic[1:] in names()[1] or topic.startswith("/PSM1/servo_thing")


@pytest.mark.parametrize("seed", range(20))
def test_only_what_lasts_and_nobody_serves_is_reported_once_for_each_stay(seed: int) -> None:
    """Nodes come and go with topics of all kinds; some are served in time, some never."""
    from ligature.ros.unserved import LOOKS, MOST_LINES

    rng, found = random.Random(seed), finder()
    published, subscribed = served()
    known = [*published, *subscribed]
    uses: dict[tuple[str, str, bool], int] = {}
    expected: set[tuple[str, str, bool]] = set()
    for _ in range(12):
        for _ in range(rng.randrange(4)):
            node, sends = f"/client{rng.randrange(3)}", rng.random() < 0.5
            topic = rng.choice(known) if rng.random() < 0.4 else thing(rng, sends)
            uses.setdefault((node, topic, sends), 0)
        for use in list(uses):
            if rng.random() < 0.1:
                del uses[use]
        sends = rng.random() < 0.5  # somebody else, at the other end or the same
        other = (thing(rng, sends), sends if rng.random() < 0.5 else not sends)
        now: tuple[Known, Known] = (
            {k: list(v) for k, v in published.items()},
            {k: list(v) for k, v in subscribed.items()},
        )
        for node, topic, sends in uses:
            now[not sends].setdefault(topic, []).append(node)
        now[other[1]].setdefault(other[0], []).append(CAMERAS)
        for use in uses:
            _, topic, sends = use
            mine, others = now[not sends].get(topic, []), now[sends].get(topic, [])
            alone = (
                commands(topic) is use[2]
                and not [n for n in others if n != WATCHER]
                and not any(n.startswith(SIM) for n in mine)
            )
            uses[use] = uses[use] + 1 if alone else 0
        expected = {use for use in expected if use[0] in {each[0] for each in uses}}
        new = {use for use, looks in uses.items() if looks >= LOOKS} - expected
        expected |= new
        fresh = found.look(now[0].items(), now[1].items())
        assert sum("more topics" not in line for line in fresh) == sum(
            min(MOST_LINES, sum(use[0] == node for use in new)) for node in {use[0] for use in new}
        )
        assert len(fresh) == len(set(fresh))


def test_nodes_that_came_and_went_leave_nothing_behind() -> None:
    found = finder()
    for number in range(50):
        published, subscribed = served()
        subscribed["/PSM1/state_joint_current"] = [f"/script_{number}"]
        found.look(published.items(), subscribed.items())
        assert len(found.look(published.items(), subscribed.items())) == 1
    assert len(found._reported) == 1


def test_every_command_that_a_run_takes_counts_as_one_and_no_reading_does() -> None:
    from ligature.ros.unserved import COMMAND

    published, subscribed = served()
    for topic in (topic for topic, nodes in subscribed.items() if SIM in nodes):
        assert COMMAND.fullmatch(topic), topic
    for topic in published:
        assert not COMMAND.fullmatch(topic), topic


def test_a_robot_beside_the_run_is_no_client() -> None:
    """Its arms, which the run lacks, report and listen; nobody else does yet."""
    published, subscribed = served()
    for topic in list(published):
        published[topic.replace("/PSM1/", "/PSM3/")] = ["/dvrk_console"]
    for topic in [topic for topic, nodes in subscribed.items() if SIM in nodes]:
        subscribed[topic.replace("/PSM1/", "/PSM3/")] = ["/dvrk_console"]
    ours = served()
    published |= ours[0]
    subscribed |= ours[1]
    assert any("PSM3" in topic for topic in published) and any("PSM3" in topic for topic in subscribed)
    found = finder()
    assert [found.look(published.items(), subscribed.items()) for _ in range(4)] == [[]] * 4


def test_strangers_to_all_of_it_are_left_alone() -> None:
    published, subscribed = served()
    for topic in ("/chatter", "/camera/image_raw", "/rosout", "/tf", "/joint_states", "/move_group/goal"):
        published[topic] = subscribed[f"{topic}2"] = ["/other"]
    found = finder()
    assert [found.look(published.items(), subscribed.items()) for _ in range(8)] == [[]] * 8


def test_a_run_reports_a_program_for_another_dvrk(
    start: Callable[..., Any], arms_scene: Any, ros_env: dict[str, str]
) -> None:
    from tests.ros.conftest import BIN
    from tests.waiting import until

    program = start(BIN / "ligature", "run", arms_scene, "-p", "500", "--no-cameras")
    program.wait_for("first state published")
    master, caller = ServerProxy(ros_env["ROS_MASTER_URI"]), ("/old_script", "http://127.0.0.1:1/")
    master.registerSubscriber(caller[0], "/dvrk/PSM1/state_joint_current", "sensor_msgs/JointState", caller[1])
    try:
        line = "node /old_script subscribes /dvrk/PSM1/state_joint_current, which nobody publishes"
        until(lambda: f"{line}; since dVRK 2.x it is /PSM1/measured_js" in program.output, lambda: program.output, 30.0)
    finally:
        master.unregisterSubscriber(caller[0], "/dvrk/PSM1/state_joint_current", caller[1])
