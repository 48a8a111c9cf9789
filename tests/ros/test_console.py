"""The console, its pedals and the set-up joints, message by message and without a master."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import pytest
from ligature.model.scene import ArmKind
from ligature.robots.commands import StateCommand

pytestmark = pytest.mark.ros
rospy = pytest.importorskip("rospy")

WORLD: Any = SimpleNamespace(root="/", frame_prefix="")


@dataclass
class Wires:
    """Topics that a part of ours uses: callbacks of those that it hears, messages of those that it publishes."""

    heard: dict[str, Callable[[Any], None]] = field(default_factory=dict)
    published: dict[str, list[Any]] = field(default_factory=dict)
    latched: set[str] = field(default_factory=set)
    logged: list[str] = field(default_factory=list)
    now: float = 100.0

    def publisher(self, topic: str, type_: type, *_: Any, latch: bool = False, **__: Any) -> Any:
        messages = self.published.setdefault(topic, [])
        if latch:
            self.latched.add(topic)

        def publish(content: Any) -> None:
            messages.append(content if isinstance(content, type_) else type_(content))

        return SimpleNamespace(publish=publish, unregister=lambda: self.published.pop(topic, None))

    def subscriber(self, topic: str, type_: type, take: Callable[[Any], None], **_: Any) -> Any:
        self.heard[topic] = take
        return SimpleNamespace(unregister=lambda: self.heard.pop(topic, None))

    def newest(self, topic: str) -> Any:
        return self.published[topic][-1]


@pytest.fixture
def wires(monkeypatch: pytest.MonkeyPatch) -> Wires:
    from ligature.ros.arms import console, events, latched, setup_joints

    wires = Wires()
    fake = SimpleNamespace(
        Publisher=wires.publisher, Subscriber=wires.subscriber, ROSException=rospy.ROSException,
        Time=type("Time", (rospy.Time,), {"now": staticmethod(lambda: rospy.Time.from_sec(wires.now))}),
        Duration=rospy.Duration, logwarn=wires.logged.append, loginfo=wires.logged.append,
        logwarn_throttle=lambda _, text: wires.logged.append(text), get_name=lambda: "/ligature",
    )  # fmt: skip
    for module in (console, events, latched, setup_joints):
        monkeypatch.setattr(module, "rospy", fake)
    return wires


def arms(*failed: str) -> list[Any]:
    """Outlets of arms, some of them in FAULT."""
    kinds = {"PSM1": ArmKind.PSM, "PSM2": ArmKind.PSM, "ECM": ArmKind.ECM, "MTML": ArmKind.MTM}
    return [
        SimpleNamespace(
            index=i, description=SimpleNamespace(name=name, kind=kind), events=SimpleNamespace(failed=name in failed)
        )
        for i, (name, kind) in enumerate(kinds.items())
    ]


def console(wires: Wires, *failed: str) -> list[StateCommand]:
    """A console on ``wires``; returns where its commands go."""
    from ligature.ros.arms.console import Console

    sent: list[Any] = []
    Console("/", arms(*failed), sent.append, False)
    return sent


def test_every_pedal_is_pressed_by_emulation_and_reported_by_both_of_its_names(wires: Wires) -> None:
    from sensor_msgs.msg import Joy

    console(wires)
    pedals = [topic for topic in wires.heard if topic.startswith("/console/emulate_")]
    assert len(pedals) == 7
    old = {"focus_minus": "cam_minus", "focus_plus": "cam_plus"}
    rng = random.Random(1)
    before = {topic: len(messages) for topic, messages in wires.published.items()}
    for topic in pedals:
        name = topic.removeprefix("/console/emulate_")
        wires.now += 1.0
        button = rng.randrange(3)
        wires.heard[topic](Joy(buttons=[button, 7]))
        for report in (f"/console/{name}", f"/footpedals/{old.get(name, name)}"):
            message = wires.newest(report)
            assert list(message.buttons) == [button] and message.header.stamp.to_sec() == wires.now
            assert len(wires.published[report]) == before[report] + 1 and report in wires.latched


def test_a_pedal_without_a_button_is_rejected_with_what_to_send(wires: Wires) -> None:
    """Programs read the first button of what is reported."""
    from sensor_msgs.msg import Joy

    console(wires)
    before = {topic: len(messages) for topic, messages in wires.published.items()}
    for topic in [topic for topic in wires.heard if topic.startswith("/console/emulate_")]:
        wires.logged.clear()
        wires.heard[topic](Joy())
        assert "send 'buttons: [1]'" in wires.logged[0]
    assert {topic: len(messages) for topic, messages in wires.published.items()} == before


@pytest.mark.parametrize("names", [("select", "unselect"), ("select_teleop", "unselect_teleop")])
def test_pairs_are_selected_by_the_names_of_the_code_and_of_the_documentation(
    wires: Wires, names: tuple[str, str]
) -> None:
    from std_msgs.msg import String

    console(wires)
    for name, kind in zip(names, ("selected", "unselected"), strict=True):
        wires.heard[f"/console/teleop/{name}"](String(f"MTMR_{kind}"))
        for report in (kind, f"teleop_{kind}"):
            assert wires.newest(f"/console/teleop/{report}").data == f"MTMR_{kind}"


@pytest.mark.parametrize("root", ["/system", "/console"])
@pytest.mark.parametrize(("topic", "command"), [("power_on", "enable"), ("home", "home")])
def test_power_and_homing_end_faults_first(wires: Wires, root: str, topic: str, command: str) -> None:
    from std_msgs.msg import Empty

    sent = console(wires, "PSM2", "ECM")
    wires.heard[f"{root}/{topic}"](Empty())
    words = {index: [one.command for one in sent if one.arm == index] for index in range(4)}
    assert words == {0: [command], 1: ["disable", command], 2: ["disable", command], 3: [command]}


def test_power_off_disables_all_arms_and_teleoperation(wires: Wires) -> None:
    from std_msgs.msg import Bool, Empty

    sent = console(wires, "PSM2")
    wires.heard["/console/teleop/enable"](Bool(True))
    assert wires.newest("/console/teleop/enabled").data
    wires.heard["/system/power_off"](Empty())
    assert not wires.newest("/console/teleop/enabled").data
    assert sent == [StateCommand(index, "disable") for index in range(4)]


@pytest.mark.parametrize("command", ["/console/set_volume", "/system/set_volume", "/console/teleop/set_scale"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, -0.1, 1.1, 0.5, 1.0])
def test_a_volume_and_a_scale_are_fractions(wires: Wires, command: str, value: float) -> None:
    from std_msgs.msg import Float64

    console(wires)
    report = "/console/teleop/scale" if command.endswith("scale") else "/system/volume"
    before = [message.data for message in wires.published[report]]
    wires.heard[command](Float64(value))
    after = [message.data for message in wires.published[report]]
    if 0.0 < value <= 1.0:
        assert (after, wires.logged) == ([*before, value], [])
    else:
        assert after == before and f"not {value:g}" in wires.logged[0]


def test_teleoperation_hears_that_power_is_off_and_the_documented_names(
    wires: Wires, monkeypatch: pytest.MonkeyPatch
) -> None:
    from ligature.teleop import console as teleop
    from std_msgs.msg import Empty, String

    heard: list[tuple[str, Any]] = []
    fake = SimpleNamespace(Publisher=wires.publisher, Subscriber=wires.subscriber)
    monkeypatch.setattr(teleop, "rospy", fake)
    teleop.ConsoleTopics("/", lambda name, value: heard.append((name, value)))
    for topic in ("/system/power_off", "/console/power_off"):
        wires.heard[topic](Empty())
    for word in ("select", "select_teleop", "unselect", "unselect_teleop"):
        wires.heard[f"/console/teleop/{word}"](String("MTMR_PSM1"))
    pair = "MTMR_PSM1"
    assert heard == [("enable", False)] * 2 + [("select", pair)] * 2 + [("unselect", pair)] * 2


# --- set-up joints ----------------------------------------------------------------------------

SUJ = ("PSM1", "PSM2", "ECM")


def setup_joints(wires: Wires, silent: tuple[str, ...] = ()) -> Any:
    from ligature.ros.arms.setup_joints import SetupJoints

    return SetupJoints(WORLD, arms(), silent)


def test_set_up_joints_have_one_state_that_any_of_them_switches_and_that_stays_fresh(wires: Wires) -> None:
    from crtk_msgs.msg import StringStamped

    joints, rng, state, last = setup_joints(wires), random.Random(2), "ENABLED", 0.0
    for _ in range(60):
        wires.now += rng.choice((0.0, 0.3))
        if rng.random() < 0.5:
            word = rng.choice(("enable", "disable", "home", "pause", "resume", "unhome", "", "x" * 200))
            arm, warnings = rng.choice(SUJ), {name: len(wires.published[f"/SUJ/{name}/warning"]) for name in SUJ}
            wires.heard[f"/SUJ/{arm}/state_command"](StringStamped(string=word))
            state = {"enable": "ENABLED", "disable": "DISABLED", "home": "ENABLED"}.get(word, state)
            warned = {name for name in SUJ if len(wires.published[f"/SUJ/{name}/warning"]) > warnings[name]}
            assert warned == (set() if word in ("enable", "disable", "home") else {arm})
            if warned:
                assert f"'{word[:40]}' is no state command" in wires.newest(f"/SUJ/{arm}/warning").data
        joints.beat()
        messages = [wires.newest(f"/SUJ/{arm}/operating_state") for arm in SUJ]
        assert {(m.state, m.is_homed, m.is_busy) for m in messages} == {(state, True, False)}
        (stamp,) = {m.header.stamp.to_nsec() for m in messages}
        assert stamp > last and abs(stamp * 1e-9 - wires.now) < 1e-3
        last = stamp


def test_motions_of_set_up_joints_are_rejected_with_a_reason(wires: Wires) -> None:
    setup_joints(wires)
    motions = [topic for topic in wires.heard if topic.endswith(("_jp", "_cp"))]
    assert len(motions) == 3 * len(SUJ)
    for topic in motions:
        wires.heard[topic](None)
        _, _, arm, verb = topic.split("/", 3)
        assert wires.newest(f"/SUJ/{arm}/warning").data.startswith(f"{verb}: the bases of the arms are fixed")


def test_everything_that_set_up_joints_publish_is_on_the_list_for_rivals_and_ends_with_them(wires: Wires) -> None:
    from ligature.ros.arms.setup_joints import setup_topics

    joints = setup_joints(wires, ("ECM",))
    listed = {topic for arm in ("PSM1", "PSM2") for topic in setup_topics(WORLD, arm)}
    assert set(wires.published) == listed
    arm = joints._arms["PSM1"]
    arm.close()
    assert set(wires.published) == set(setup_topics(WORLD, "PSM2"))
    assert not [topic for topic in wires.heard if topic.startswith("/SUJ/PSM1/")]
    joints.beat()
