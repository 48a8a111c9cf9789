"""Pause, single updates and speed by services."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.ros.conftest import BIN
from tests.waiting import stays, until

pytestmark = pytest.mark.ros


@pytest.fixture(scope="module")
def program(start: Callable[..., Any], arms_scene: Path) -> Any:
    program = start(BIN / "ligature", "run", arms_scene, "-p", "500", "--no-cameras", "--speed", "0.5")
    program.wait_for("first state published")
    return program


def service(node: Any, name: str) -> Callable[..., Any]:
    from std_srvs.srv import SetBool, Trigger

    topic = f"/ligature/{name}"
    node.wait_for_service(topic, 20.0)
    return node.ServiceProxy(topic, SetBool if name == "pause" else Trigger)


def speed(world: Any) -> float:
    """Simulated over wall time, of a second."""
    begin, at = world.messages[-1].sim_time, time.monotonic()
    time.sleep(1.0)
    return (world.messages[-1].sim_time - begin) / (time.monotonic() - at)


def test_a_run_is_paused_stepped_and_goes_on_at_another_speed(
    program: Any, node: Any, listen: Callable[..., Any], publish: Callable[..., Any]
) -> None:
    from ambf_msgs.msg import WorldState
    from std_msgs.msg import Bool, Float64

    world, paused = listen("/ambf/env/World/State", WorldState), listen("/ligature/paused", Bool)
    pause, step = service(node, "pause"), service(node, "step")
    world.wait()
    assert speed(world) < 0.65, "half the speed of the world at most; a busy machine may be slower"
    assert not step().success, "a run that goes on is not stepped"
    answer = pause(True)
    assert answer.success and paused.wait(lambda m: m.data)
    at = int(answer.message.rpartition(" ")[2])
    until(lambda: world.messages[-1].sim_step == at, "the state of that update", 5.0)
    stays(lambda: world.messages[-1].sim_step == at, "it stands still", 0.5)
    for k in range(1, 21):
        answer = step()
        assert answer.success and answer.message == f"update {at + k}"
    until(lambda: world.messages[-1].sim_step == at + 20, "twenty updates", 5.0)
    stays(lambda: world.messages[-1].sim_step == at + 20, "and no more", 0.3)
    assert pause(False).success and paused.wait(lambda m: not m.data)
    until(lambda: world.messages[-1].sim_step > at + 40, "it goes on", 10.0)
    faster = publish("/ligature/set_speed", Float64)
    faster.publish(1.0)
    until(lambda: 0.7 < speed(world) < 1.25, "at the speed of the world", 60.0)
    faster.publish(0.1)
    until(lambda: speed(world) < 0.15, "slower", 20.0)
    faster.publish(float("nan"))
    faster.publish(-1.0)
    stays(lambda: speed(world) < 0.15, "nonsense changes nothing", 2.0)
