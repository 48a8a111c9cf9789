"""The mailbox: newest command of each object, events in order, everything counted, the dead released."""

from __future__ import annotations

from pathlib import Path

import ligature
import pytest
from ligature.bus import Mailbox, Throttle
from ligature.bus.codec import encode
from ligature.bus.ring import RING_BYTES, SLOTS, Ring
from ligature.model.commands import ActuatorCommand, BodyCommand, CommandType, ParentCommand, Release, Reset
from ligature.model.scene import Scene

SMALL = Path(__file__).resolve().parents[2] / "scenes" / "suturing_small" / "launch.yaml"


@pytest.fixture(scope="module")
def scene() -> Scene:
    return ligature.load(SMALL)


@pytest.fixture
def ring() -> Ring:
    return Ring(memoryview(bytearray(RING_BYTES)))


def push(ring: Ring, *messages: object) -> None:
    for message in messages:
        assert ring.push(encode(message))  # type: ignore[arg-type]


def force(body: int, x: float) -> BodyCommand:
    return BodyCommand(body, CommandType.FORCE, (x, 0.0, 0.0, 0.0, 0.0, 0.0))


def test_the_newest_command_of_an_object_counts(scene: Scene, ring: Ring) -> None:
    box = Mailbox(scene, {"ros": ring})
    push(ring, force(1, 1.0), force(2, 5.0), force(1, 2.0))
    assert box.take() == [force(2, 5.0), force(1, 2.0)]
    assert (box.received, box.coalesced, box.rejected) == (3, 1, 0)


def test_events_keep_their_order(scene: Scene, ring: Ring) -> None:
    box = Mailbox(scene, {"ros": ring})
    push(ring, Reset(True), Throttle(True, True, 5), Reset(False))
    assert box.take() == [Reset(True), Throttle(True, True, 5), Reset(False)]


def test_letting_go_and_grasping_again_within_an_update_are_both_done(scene: Scene, ring: Ring) -> None:
    box = Mailbox(scene, {"ros": ring})
    off, on = ActuatorCommand(0, False), ActuatorCommand(0, True, "Needle")
    push(ring, off, on)
    assert box.take() == [off, on]


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), 1e30])
def test_bad_numbers_are_counted_and_named(scene: Scene, ring: Ring, bad: float) -> None:
    box = Mailbox(scene, {"ros": ring})
    push(ring, force(1, bad), force(1, 3.0))
    assert box.take() == [force(1, 3.0)]
    assert box.rejected == 1 and "command must " in box.last_rejection


def test_an_object_that_is_missing_is_rejected(scene: Scene, ring: Ring) -> None:
    box = Mailbox(scene, {"ros": ring})
    push(ring, force(len(scene.bodies), 1.0))
    assert box.take() == []
    assert f"the scene has no body number {len(scene.bodies)}" in box.last_rejection


def test_a_parent_that_is_missing_is_rejected(scene: Scene, ring: Ring) -> None:
    box = Mailbox(scene, {"ros": ring})
    push(ring, ParentCommand("camera", 0, len(scene.bodies)), ParentCommand("camera", 0, None))
    assert box.take() == [ParentCommand("camera", 0, None)]
    assert box.last_rejection == f"the scene has no body number {len(scene.bodies)} to mount a camera on"


def test_bytes_that_are_no_command_are_rejected(scene: Scene, ring: Ring) -> None:
    box = Mailbox(scene, {"ros": ring})
    ring.push(b"\xff\x00")
    assert box.take() == [] and box.rejected == 1


def test_a_full_ring_takes_nothing_more(ring: Ring) -> None:
    assert all(ring.push(bytes([i % 256])) for i in range(SLOTS))
    assert not ring.push(b"x")
    assert len(list(ring.drain())) == SLOTS
    assert ring.push(b"x")


def test_a_silent_front_end_has_its_commands_released(scene: Scene, ring: Ring) -> None:
    box = Mailbox(scene, {"ros": ring})
    ring.beat()
    push(ring, force(3, 1.0), ActuatorCommand(1, True, "Needle"), Throttle(True, False, 5))
    box.take()
    ring._beat[0] -= 1.0
    assert box.take() == [Release("actuator", 1), Release("body", 3), Throttle(False, False, 0)]
    assert box.take() == []


def test_the_newest_command_of_a_front_end_whose_loop_is_late_is_carried_out(scene: Scene, ring: Ring) -> None:
    box = Mailbox(scene, {"ros": ring})
    ring.beat()
    push(ring, force(3, 1.0))
    box.take()
    ring._beat[0] -= 1.0
    push(ring, force(3, 2.0))
    assert box.take() == [force(3, 2.0)]
    assert box.take() == []


def test_a_silent_front_end_that_commands_nothing_any_more_changes_nothing(scene: Scene, ring: Ring) -> None:
    box = Mailbox(scene, {"ros": ring})
    ring.beat()
    push(ring, force(3, 1.0), Throttle(True, False, 5), Throttle(False, False, 5), Release("body", 3))
    box.take()
    ring._beat[0] -= 1.0
    assert box.take() == []


def test_a_paused_world_runs_again_when_its_front_end_dies(scene: Scene, ring: Ring) -> None:
    box = Mailbox(scene, {"ros": ring})
    ring.beat()
    push(ring, Throttle(True, False, 5))
    box.take()
    ring._beat[0] -= 1.0
    assert box.take() == [Throttle(False, False, 0)]


@pytest.mark.parametrize("lives", [True, False])
def test_a_front_end_that_was_released_owns_only_what_it_commands_since(scene: Scene, ring: Ring, lives: bool) -> None:
    """It is watched again from its next sign of life on; until then it counts as one that gives none, and may be silent."""
    box = Mailbox(scene, {"ros": ring})
    ring.beat()
    push(ring, force(3, 1.0))
    box.take()
    ring._beat[0] -= 1.0
    assert box.take() == [Release("body", 3)]
    assert ring.silence == 0.0
    if lives:
        ring.beat()
    push(ring, force(4, 1.0))
    assert box.take() == [force(4, 1.0)]
    if lives:
        ring._beat[0] -= 1.0
    assert box.take() == ([Release("body", 4)] if lives else [])
