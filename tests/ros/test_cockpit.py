"""The cockpit beside ROS: teleoperation from afar, how topics do, and both on the page."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.cockpit.conftest import somebody, until
from tests.ros.conftest import BIN, Listener
from tests.waiting import stays

pytestmark = [pytest.mark.ros, pytest.mark.timeout(600)]

CONFIG = """
camera: ECM
settings: {scale: 0.5, align: false}
devices:
  pen: {kind: touch, topic: /arm1/, buttons: {grey: clutch, white: close}}
pairs:
  pen: [PSM1, PSM2]
"""


@pytest.fixture(scope="module")
def simulator(start: Callable[..., Any], arms_scene: Path) -> Any:
    program = start(BIN / "ligature", "run", arms_scene, "-p", "250", "--no-cameras", "--cockpit-at", "127.0.0.1:0")
    program.wait_for("cockpit ready")
    program.wait_for("first state published")
    return program


@pytest.fixture(scope="module")
def teleop(simulator: Any, start: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory) -> Any:
    file = tmp_path_factory.mktemp("teleop") / "teleop.yaml"
    file.write_text(CONFIG)
    program = start(BIN / "ligature", "teleop", file)
    program.wait_for("driving:")
    return program


@pytest.fixture(scope="module")
def remote(node: Any, teleop: Any) -> Iterator[Any]:
    from ligature.teleop.remote import TeleopRemote

    found = TeleopRemote()

    def known() -> bool:
        found.find_pairs()
        return set(found.pairs) == {"pen_PSM1", "pen_PSM2"}

    until(known, "both pairs are found")
    return found


def test_a_pair_is_chosen_from_afar(remote: Any) -> None:
    until(lambda: remote.pairs["pen_PSM1"].selected, "the first pair is the one that is selected")
    until(lambda: remote.pairs["pen_PSM1"].status, "its status is shown")

    def chosen() -> bool:
        remote.select("pen_PSM2")  # again and again: a topic that is new reaches its listeners a moment later
        time.sleep(0.2)
        return remote.pairs["pen_PSM2"].selected and not remote.pairs["pen_PSM1"].selected

    until(chosen, "the other is selected")


def test_a_pedal_is_pressed_from_afar(remote: Any, listen: Callable[..., Listener]) -> None:
    from sensor_msgs.msg import Joy

    clutch = listen("/console/clutch", Joy)

    def arrives(pressed: bool) -> bool:
        remote.press("clutch", pressed)  # again until it does: who listens already, nobody knows
        return bool(clutch.messages) and list(clutch.messages[-1].buttons) == [int(pressed)]

    until(lambda: arrives(True), "the pedal is down", 20.0, every=0.2)
    until(lambda: arrives(False), "the pedal is up", 20.0, every=0.2)


def test_topics_that_are_heard_are_listed_with_their_rates(node: Any, simulator: Any, teleop: Any) -> None:
    from ligature.ros.health import TopicHealth, rate_of

    health = TopicHealth()
    health.look()
    heard = {topic.name: topic for topic in health.topics}
    assert "/PSM1/operating_state" in heard, sorted(heard)  # teleoperation listens to it
    assert heard["/PSM1/operating_state"].publishers == 1
    assert health.published > 50
    assert rate_of("/PSM1/measured_js", 2.0) > 5.0
    assert rate_of("/nobody_publishes_this", 0.2) == 0.0


def test_the_page_shows_ros_and_selects_a_pair(simulator: Any, remote: Any) -> None:
    url = next(line for line in simulator.lines if line.startswith("cockpit ready")).partition(": ")[2]
    with somebody() as person:
        person.opens(url)
        person.sees("pen → PSM1")
        person.operates()
        wanted = "PSM1" if remote.pairs["pen_PSM2"].selected else "PSM2"
        label = f"//*[normalize-space(text())='pen → {wanted}']"
        person.find(f"({label}/following::button[normalize-space(.)='Select'])[1]").click()
        until(lambda: remote.pairs[f"pen_{wanted}"].selected, "the pair is selected")
        person.find("//*[normalize-space(text())='ROS topics']").click()
        person.sees("topics are published")
        person.sees("/PSM1/operating_state")
    stays(lambda: simulator.process.poll() is None, "the simulator goes on", 0.1)
