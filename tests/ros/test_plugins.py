"""Plug-ins in a run on ROS: not run unless allowed, their topics, and what is reported of one that fails."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.plugins.test_plugins import HEAD, SCENE, SPRING
from tests.ros.conftest import BIN, Program
from tests.waiting import until

pytestmark = pytest.mark.ros

ROOT = "/ligature/plugins/mine"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("plugins")
    (folder / "mine.py").write_text(HEAD + SPRING)
    (folder / "bad.py").write_text(
        HEAD.replace("Mine", "Bad")
        + "    def after_step(self):\n        if self.host.time > 0.5:\n            raise RuntimeError('worn out')\n"
        + f"    def on_close(self):\n        open({str(folder / 'closed')!r}, 'w').close()\n"
    )
    entries = (
        "{name: mine, filename: mine.py, publishes: {force: 3}, subscribes: {goal: 3}}, {name: bad, filename: bad.py}, "
        "{name: closer, filename: closer.py}"
    )
    (folder / "closer.py").write_text(
        HEAD.replace("Mine", "Closer")
        + f"    def on_close(self):\n        open({str(folder / 'ended')!r}, 'w').close()\n"
    )
    (folder / "m.yaml").write_text(SCENE % (entries, ""))
    return folder


def test_topics_failures_and_the_end_of_plugins_in_a_run(
    start: Callable[..., Program], folder: Path, node: Any, listen: Callable[..., Any], publish: Callable[..., Any]
) -> None:
    from ambf_msgs.msg import RigidBodyState
    from diagnostic_msgs.msg import DiagnosticArray
    from std_msgs.msg import Float64MultiArray

    program = start(BIN / "ligature", "run", folder / "m.yaml", "-p", "200", "--allow-plugins")
    program.wait_for("first state published")
    reports = listen("/diagnostics", DiagnosticArray)
    goal = publish(f"{ROOT}/goal", Float64MultiArray)
    goal.publish(Float64MultiArray(data=[0.1, -0.2]))  # two numbers too few: rejected
    goal.publish(Float64MultiArray(data=[0.1, -0.2, 0.3]))
    ball = listen("/ambf/env/Ball/State", RigidBodyState)

    def there(message: Any) -> bool:
        p = message.pose.position
        return abs(p.x - 0.1) + abs(p.y + 0.2) + abs(p.z - 0.3) < 0.05

    ball.wait(there)
    force = listen(f"{ROOT}/force", Float64MultiArray).wait(lambda m: abs(m.data[2] - 20.0) < 3.0)
    assert len(force.data) == 3
    text = "plug-in 'bad' failed in after_step and is switched off: RuntimeError: worn out (bad.py:6)"
    program.wait_for(text)

    def reported() -> bool:
        values = (value.value for m in list(reports.messages) for status in m.status for value in status.values)
        return any(text in value for value in values)

    until(reported, "the plug-in in /diagnostics")
    assert program.output.count(text) == 1
    assert program.end() == 0
    assert (folder / "ended").exists()
    assert not (folder / "closed").exists(), "a plug-in that is off is not called any more"


def test_a_run_without_the_option_names_what_it_leaves_out(
    start: Callable[..., Program], folder: Path, node: Any
) -> None:
    program = start(BIN / "ligature", "run", folder / "m.yaml", "-p", "200")
    program.wait_for("first state published")
    lines = [line for line in program.lines if "plug-ins are not run" in line]
    assert len(lines) == 1
    assert "mine, bad, closer" in lines[0]
    assert "--allow-plugins" in lines[0]
    topics = [name for name, _ in node.get_published_topics("/ligature")]
    assert not [name for name in topics if "plugins" in name]
    program.end()
