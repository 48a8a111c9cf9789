"""Two simulators on one ROS master."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from tests.ros.conftest import BIN, SMALL, Program

pytestmark = pytest.mark.ros


@pytest.fixture(scope="module", autouse=True)
def first(start: Callable[..., Program]) -> Iterator[Program]:
    program = start(BIN / "ligature", "run", SMALL, "-p", "100")
    program.wait_for("first state published")
    yield program
    assert "starting it again" not in program.output


def test_a_second_simulator_of_the_same_world_ends_and_says_what_to_do(
    start: Callable[..., Program], listen: Callable[..., Any]
) -> None:
    from ambf_msgs.msg import WorldState

    second = start(BIN / "ligature", "run", SMALL, "-p", "100")
    assert second.process.wait(20) == 1
    assert "another simulator runs on this ROS master (node /ligature at http://" in second.output
    assert "'--ns'" in second.output
    assert listen("/ambf/env/World/State", WorldState).rate(0.5) > 20


def test_a_simulator_with_a_prefix_lives_beside_it(start: Callable[..., Program], listen: Callable[..., Any]) -> None:
    from ambf_msgs.msg import RigidBodyState

    second = start(BIN / "ligature", "run", SMALL, "-p", "100", "--ns", "/left")
    second.wait_for("first state published")
    for prefix in ("", "/left"):
        message = listen(f"{prefix}/ambf/env/phantom/Needle/State", RigidBodyState).wait()
        assert message.identifier.data == f"{prefix}/ambf/env/phantom/BODY Needle"
    assert second.end() == 0
