"""What becomes of messages on their way to the bus: silence of every commanded object, and headers of every message.

Without a master: subscriptions are noted down, and their callbacks get generated messages.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import ligature
import pytest
from ligature.bus import Throttle
from ligature.bus.watchdog import TIMEOUT
from ligature.model.commands import Release
from ligature.model.scene import ArmKind, Scene

from tests.ros.conftest import SMALL
from tests.ros.test_flood import filled

pytestmark = pytest.mark.ros
rospy = pytest.importorskip("rospy")

NO_EFFECT = ("ghost", "sensor", "contact")
"""Kinds of objects whose commands only raise the rate of their states."""


@dataclass
class Bench:
    """A `Reception` whose subscriptions are ``topics``: type and callback; ``sent`` went to the bus at time ``now``."""

    scene: Scene
    now: float = 100.0
    sent: list[Any] = field(default_factory=list)
    warned: list[str] = field(default_factory=list)
    topics: dict[str, tuple[type, Callable[[Any], None]]] = field(default_factory=dict)
    reception: Any = None

    def send(self, topic: str, message: Any) -> list[Any]:
        """What a message on ``topic`` puts on the bus."""
        before = len(self.sent)
        self.topics[topic][1](message)
        return self.sent[before:]


@pytest.fixture(scope="module")
def scene() -> Scene:
    return ligature.load(SMALL)


@pytest.fixture
def bench(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> Bench:
    from ligature.ros import conversion, reception

    bench = Bench(scene)

    def subscribe(topic: str, type_: type, take: Callable[[Any], None], **_: Any) -> None:
        bench.topics[topic] = type_, take

    monkeypatch.setattr(
        reception,
        "rospy",
        SimpleNamespace(Subscriber=subscribe, logwarn_throttle=lambda _, text: bench.warned.append(text)),
    )
    monkeypatch.setattr(reception, "time", SimpleNamespace(monotonic=lambda: bench.now))
    outbox: Any = SimpleNamespace(push=bench.sent.append, flush=lambda: None)
    bench.reception = reception.Reception(scene, outbox, lambda key, at_once: None)
    for template in conversion.templates(scene):
        bench.reception.subscribe(template, template.identity.topic)
    bench.reception.subscribe_world()
    return bench


def key_of(bench: Bench, topic: str) -> tuple[str, int]:
    """The object that a topic commands."""
    from ligature.ros import conversion

    owner = topic.removesuffix("/Command")
    if owner == bench.scene.world.topic:
        return "world", 0
    return next((t.kind, t.index) for t in conversion.templates(bench.scene) if t.identity.topic == owner)


@pytest.mark.parametrize("seed", range(2))
def test_an_object_is_released_half_a_second_after_its_last_command_and_no_other_is(bench: Bench, seed: int) -> None:
    """Whoever commands falls silent at a moment of its own; rejected commands keep nothing alive."""
    rng = random.Random(seed)
    topics = [topic for topic in bench.topics if topic.endswith("/Command")]
    keys = {topic: key_of(bench, topic) for topic in topics}
    assert {kind for kind, _ in keys.values()} >= {"world", "body", "ghost", "actuator", "camera", "light"}
    last: dict[tuple[str, int], float] = {}
    released = 0
    for _ in range(1000):
        bench.now += rng.choice((0.0, 0.001, 0.02, 0.02, 0.3 * rng.random()))
        for topic in rng.sample(topics, 3) if rng.random() < 0.4 else ():
            good = rng.random() < 0.7
            complaints = len(bench.warned)
            bench.send(topic, bench.topics[topic][0]() if good else filled(bench.topics[topic][0], rng))
            assert not good or len(bench.warned) == complaints, bench.warned[-1]
            if len(bench.warned) == complaints:
                last[keys[topic]] = bench.now
        before = len(bench.sent)
        bench.reception.watch(bench.now)
        late = {key for key, at in last.items() if bench.now - at > TIMEOUT}
        expected = [
            Throttle(False, False, 0) if key[0] == "world" else Release(*key) for key in late if key[0] not in NO_EFFECT
        ]
        found = bench.sent[before:]
        assert sorted(map(repr, found)) == sorted(map(repr, expected))
        assert not any(bench.reception.commanded(key) for key in late)
        last = {key: at for key, at in last.items() if key not in late}
        assert all(bench.reception.commanded(key) for key in last)
        released += len(found)
    assert released > 50


def headers(rng: random.Random) -> Any:
    """A header that a client may send by mistake."""
    from std_msgs.msg import Header

    stamp = rng.choice((
        rospy.Time(), rospy.Time(1), rospy.Time(2**31 - 1, 999_999_999), rospy.Time(1_700_000_000, rng.randrange(10**9)),
    ))  # fmt: skip
    frame = rng.choice(("", "map", "PSM1_base", "/PSM2_base", "ECM", "ünïcødé 🪡", "x" * 300, "\0"))
    return Header(rng.choice((0, 1, 2**32 - 1, rng.randrange(2**32))), stamp, frame)


def test_headers_of_commands_to_objects_have_no_effect(bench: Bench) -> None:
    """Neither a frame, nor a stamp of zero or of the future, nor numbers that go back."""
    rng, taken, rejected = random.Random(1), 0, 0
    for topic, (type_, _) in bench.topics.items():
        if "header" not in type_.__slots__:
            continue
        for _ in range(20):
            message = filled(type_, rng) if rng.random() < 0.5 else type_()
            results = []
            for _ in range(3):
                message.header = headers(rng)
                complaints = len(bench.warned)
                results.append((repr(bench.send(topic, message)), bench.warned[complaints:]))
            assert results[1:] == results[:-1], f"{topic}: {results}"
            taken, rejected = taken + (not results[0][1]), rejected + bool(results[0][1])
    assert taken > 200 and rejected > 50


@pytest.mark.parametrize("kind", list(ArmKind))
def test_headers_of_commands_to_arms_have_no_effect_but_the_frame_of_a_base(kind: ArmKind) -> None:
    from ligature.ros.arms.commands import listeners

    rng = random.Random(2)
    stamped = [(topic, type_, take) for topic, type_, take in listeners(0, kind) if "header" in type_.__slots__]
    assert len(stamped) > 14
    for topic, type_, take in stamped:
        for _ in range(20):
            message = filled(type_, rng)
            commands = []
            for _ in range(3):
                message.header = headers(rng)
                commands.append(take(message))
                if topic == "set_base_frame":
                    assert commands[-1].reference == message.header.frame_id
                    commands[-1] = commands[-1].pose
            assert repr(commands[1:]) == repr(commands[:-1]), topic
