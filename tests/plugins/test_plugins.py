"""Plug-ins in Python: permitted or not run, contained, exact in snapshots, and able to do what their page promises."""

from __future__ import annotations

import csv
import json
import textwrap
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

import ligature
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature import Simulation
from ligature.adf import Severity
from ligature.bus.codec import decode, encode
from ligature.cli.options import RunOptions
from ligature.model.commands import PluginCommand
from ligature.plugins import Plugin
from ligature.render import overlay
from ligature.simulation import Snapshot

from tests.conftest import ROOT

EXAMPLE = ROOT / "examples" / "plugins" / "falling.yaml"
HOOKS = ("on_load", "before_step", "after_step", "on_reset", "on_close", "draw", "snapshot", "restore")
SCENE = """\
namespace: /ambf/env/
gravity: {x: 0, y: 0, z: -10}
plugins: [%s]
bodies: [Ball, Rod]
joints: [Hinge]
Ball: {name: Ball, mass: 2.0, inertia: {ix: 0.1, iy: 0.1, iz: 0.1}, inertial offset: {}, collision shape: SPHERE,
  collision geometry: {radius: 0.05}, damping: {linear: 0, angular: 0}%s}
Rod: {name: Rod, mass: 0.5, collision shape: BOX, collision geometry: {x: 0.1, y: 0.02, z: 0.02}, location: {position: {x: 1, y: 0, z: 0}}}
Hinge: {name: Hinge, type: revolute, parent: Post, child: Rod, parent axis: {x: 0, y: 1, z: 0}, child axis: {x: 0, y: 1, z: 0},
  parent pivot: {x: 0.95, y: 0, z: 0}, child pivot: {x: -0.05, y: 0, z: 0}}
Post: {name: Post, mass: 0}
"""
SCENE = SCENE.replace("bodies: [Ball, Rod]", "bodies: [Ball, Post, Rod]")
ENTRY = "{name: mine, filename: mine.py%s}"
HEAD = "from ligature.plugins import Plugin\nimport numpy as np\nclass Mine(Plugin):\n"

Make = Callable[..., Simulation]


@pytest.fixture
def simulate(tmp_path: Path) -> Make:
    def make(code: str, more: str = "", allow: bool = True, on_body: bool = False) -> Simulation:
        (tmp_path / "mine.py").write_text(HEAD + textwrap.indent(textwrap.dedent(code), "    "))
        entry = ENTRY % more
        text = SCENE % (("", f", plugins: [{entry}]") if on_body else (entry, ""))
        (tmp_path / "m.yaml").write_text(text)
        return Simulation(ligature.load(tmp_path / "m.yaml"), allow_plugins=allow)

    return make


# --- permission -------------------------------------------------------------------------------


def test_no_code_of_a_scene_runs_unless_its_user_allows_it(simulate: Make, tmp_path: Path) -> None:
    canary = tmp_path / "canary"
    code = f"open({str(canary)!r}, 'w').close()\ndef on_load(self): pass"
    sim = simulate(code, allow=False)
    sim.step(5)
    assert not canary.exists()
    assert not sim.scene.plugins
    for allowed in (False, True):
        scene = RunOptions(str(tmp_path / "m.yaml"), allow_plugins=allowed).load()
        notes = [d for d in scene.diagnostics if "plug-ins are not run" in d.message]
        assert len(notes) == (not allowed)
        assert len(scene.plugins) == allowed
        assert allowed or "--allow-plugins" in str(notes[0])
    assert not canary.exists(), "loading a scene runs nothing"
    simulate(code)
    assert canary.exists()


def test_no_record_of_a_stranger_allows_plugins(tmp_path: Path) -> None:
    from ligature.bus.record import Header, Record
    from ligature.cli.resimulation import Differs, resimulate

    options = json.dumps(asdict(RunOptions(str(EXAMPLE), allow_plugins=True)))
    fields = {name: "" for name in Header.__dataclass_fields__} | {"options": options}
    record = Record.__new__(Record)
    object.__setattr__(record, "header", Header(**fields))
    with pytest.raises(Differs, match="--allow-plugins"):
        resimulate(record, None)


def test_a_plugin_outside_the_folders_of_the_scene_is_left_out(tmp_path: Path) -> None:
    inside = tmp_path / "scenes" / "deep" / "scene"
    inside.mkdir(parents=True)
    (tmp_path / "evil.py").write_text("raise SystemExit('ran')")
    (inside / "link.py").symlink_to(tmp_path / "evil.py")
    for name in ("../../../evil.py", "link.py", str(tmp_path / "evil.py"), "missing.py", "libdrill.so"):
        (inside / "m.yaml").write_text(SCENE % (f"{{name: mine, filename: {name}}}", ""))
        scene = ligature.load(inside / "m.yaml")
        assert not scene.plugins, name
        (finding,) = [d for d in scene.diagnostics if "is left out" in d.message]
        assert finding.mark is not None and finding.mark.line == 3


# --- what hooks do ----------------------------------------------------------------------------


def test_hooks_come_in_their_order(simulate: Make) -> None:
    code = "log = []\n" + "".join(f"def {hook}(self): self.log.append('{hook}')\n" for hook in HOOKS[:5])
    sim = simulate(code)
    log = type(sim._parts.plugins._plugins[0]).log
    sim.step(2)
    sim.reset()
    sim.close()
    sim._parts.plugins.close()
    assert log == ["on_load", *2 * ["before_step", "after_step"], "on_reset", "on_close"]


def test_a_push_is_felt_in_the_same_tick_and_hooks_see_the_present(simulate: Make) -> None:
    """Newton's law, whatever the number of ticks of a step: the ball is held against its weight, and accelerated."""
    code = """
    def on_load(self):
        self.ball = self.host.body("Ball")
        self.seen = []
    def before_step(self):
        self.host.push(self.ball, [4.0, 0, 20.0])
    def after_step(self):
        self.seen.append((self.host.twist(self.ball)[0], self.host.pose(self.ball)[0], self.host.time))
    """
    sim = simulate(code)
    sim.step(50)
    seen = np.array(sim._parts.plugins._plugins[0].seen)
    assert seen[:, 0] == pytest.approx(2.0 * 1e-3 * np.arange(1, 51), rel=1e-6)
    assert np.diff(seen[:, 1]) == pytest.approx(seen[1:, 0] * 1e-3, rel=1e-6)
    assert abs(sim.bodies["Ball"].pose[2]) < 1e-6
    assert seen[-1, 2] == pytest.approx(0.05)


def test_a_plugin_of_a_body_has_it_and_gives_commands_and_reads_joints(simulate: Make) -> None:
    code = """
    def on_load(self):
        from ligature.model.commands import BodyCommand, CommandType
        self.hinge = self.host.joint("Hinge")
        self.host.apply(BodyCommand(self.body.index, CommandType.VELOCITY, (0.1, 0, 0, 0, 0, 0)))
    def after_step(self):
        self.angle = self.host.joint_state(self.hinge)
        self.hits = self.host.rays([[-1.0, 0, 0]], [[5.0, 0, 0]])
    """
    sim = simulate(code, on_body=True)
    sim.step(100)
    plugin = sim._parts.plugins._plugins[0]
    assert plugin.body.identity.name == "Ball"
    assert sim.bodies["Ball"].pose[0] == pytest.approx(0.01, abs=1e-4)
    assert plugin.angle == pytest.approx((sim.joints["Hinge"].position, sim.joints["Hinge"].velocity), abs=1e-12)
    assert plugin.angle[0] != 0.0
    assert plugin.hits.body[0] == sim.bodies["Ball"].body.index


@settings(max_examples=30, deadline=None)
@given(calls=st.lists(st.integers(1, 40), min_size=1, max_size=6))
def test_how_ticks_are_shared_out_changes_nothing(tmp_path_factory: pytest.TempPathFactory, calls: list[int]) -> None:
    folder = tmp_path_factory.getbasetemp()
    (folder / "mine.py").write_text(HEAD + SPRING)
    (folder / "m.yaml").write_text(SCENE % (ENTRY % ", publishes: {force: 3}, subscribes: {goal: 3}", ""))
    hashes = set()
    for shares in (calls, [sum(calls)]):
        sim = Simulation(ligature.load(folder / "m.yaml"), allow_plugins=True)
        for share in shares:
            sim.step(share)
        hashes.add(sim.state_hash())
    assert len(hashes) == 1


SPRING = '''
    """A spring that draws the ball to a goal, and remembers how it went."""
    def on_load(self):
        self.ball, self.sum = self.host.body("Ball"), np.zeros(3)
    def before_step(self):
        error = self.received["goal"] - self.host.pose(self.ball)[:3]
        self.sum = self.sum + error
        force = 200.0 * error - 20.0 * self.host.twist(self.ball)[:3] + 0.5 * self.sum
        self.host.push(self.ball, force)
        self.publish("force", force)
    def on_reset(self):
        self.sum = np.zeros(3)
    def snapshot(self):
        return self.sum
    def restore(self, snapshot):
        self.sum = snapshot
    def draw(self):
        at = self.host.pose(self.ball)[:3]
        yield at, at + [0, 0, 1], (255, 0, 0)
'''
TOPICS = ", publishes: {force: 3}, subscribes: {goal: 3}"


def test_topics_reach_a_plugin_and_its_numbers_the_state(simulate: Make) -> None:
    sim = simulate(SPRING, TOPICS)
    sim.apply(decode(encode(PluginCommand(0, 0, (0.1, -0.2, 0.3)))))  # as it travels
    sim.step(2000)
    assert sim.bodies["Ball"].pose[:3] == pytest.approx([0.1, -0.2, 0.3], abs=0.02)
    assert sim.state["plugin_value"][0] == pytest.approx([0, 0, 20], abs=2.0)
    assert sim.state["plugin_line_count"][0] == 1
    ((begin, end, colour),) = overlay.plugin_lines(sim.state)
    assert begin == pytest.approx(sim.bodies["Ball"].pose[:3])
    assert end - begin == pytest.approx([0, 0, 1])
    assert colour == (255, 0, 0)
    for bad in (PluginCommand(0, 1, (0.0,) * 3), PluginCommand(0, 0, (0.0,) * 2)):
        sim.problems.clear()
        sim.apply(bad)
        assert "plug-in 'mine'" in str(sim.problems[0])
    with pytest.raises(ValueError, match="no plug-in number 1"):
        sim.apply(PluginCommand(1, 0, (0.0,)))


def test_snapshots_and_resets_hold_what_a_plugin_keeps(simulate: Make) -> None:
    sim = simulate(SPRING, TOPICS)
    fresh = sim.state_hash(clock=False)
    sim.apply(PluginCommand(0, 0, (0.1, 0.0, 0.2)))
    sim.step(100)
    taken: Snapshot = sim.snapshot()
    sim.step(80)
    expected = sim.state_hash()
    for other in (sim, Simulation(sim.scene, allow_plugins=True)):
        other.restore(taken)
        other.step(80)
        assert other.state_hash() == expected
    sim.reset()
    assert sim.state_hash(clock=False) == fresh


# --- failures ---------------------------------------------------------------------------------


@pytest.mark.parametrize("hook", HOOKS)
@pytest.mark.parametrize("failure", ["raise RuntimeError('broken')", "raise SystemExit(3)", "x: int = None + 1"])
def test_a_hook_that_fails_switches_its_plugin_off_and_the_run_goes_on(simulate: Make, hook: str, failure: str) -> None:
    argument = ", snapshot" if hook == "restore" else ""
    code = f"count = 0\ndef {hook}(self{argument}):\n    type(self).count += 1\n    {failure}\n"
    sim, alone = simulate(code), simulate("pass", allow=False)
    for each in (sim, alone):
        each.step(3)
        each.restore(each.snapshot())
        each.reset()
        each.step(5)
    assert sim.bodies["Ball"].pose.tobytes() == alone.bodies["Ball"].pose.tobytes()
    sim.close()
    problems = [p for p in [*sim.problems, *sim._parts.plugins.take_problems()] if p.code == "plugin"]
    # a snapshot is restored at once here, and that of before the failure switches the plug-in on again
    assert len(problems) == (2 if hook == "restore" else 1)
    assert problems[0].severity is Severity.ERROR
    assert f"plug-in 'mine' failed in {hook} and is switched off" in str(problems[0])
    assert "(mine.py:" in str(problems[0])
    assert problems[0].mark is not None and problems[0].mark.line == 3


@pytest.mark.parametrize(
    ("code", "reason"),
    [
        ("def after_step(self): self.host.push(0, [0, 0, 1])", "bodies are pushed in before_step"),
        ("def before_step(self): self.host.push(0, [0, 0, float('nan')])", "three finite numbers"),
        ("def before_step(self): self.host.push(0, [0, 0, 1e9])", "at most 1e\\+06 N"),
        ("def before_step(self): self.host.body('Nobody')", "'Nobody' does not name exactly one body; the scene has "),
        ("def before_step(self): self.publish('nothing', [1])", "nothing"),
        ("def before_step(self): self.received['goal'][0] = 1", "read-only"),
        ("def draw(self): yield 1, 2, 3", "two ends|inhomogeneous|dimension"),
    ],
)
def test_what_a_plugin_may_not_do_is_reported(simulate: Make, code: str, reason: str) -> None:
    sim = simulate(code, TOPICS)
    sim.step(3)
    assert len([p for p in sim.problems if p.code == "plugin"]) == 1
    assert pytest.importorskip("re").search(reason, str(sim.problems[0]))


def test_a_file_needs_one_class_and_an_entry_point_a_package(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("x = 1\n")
    for name, reason in (("mine.py", "must define one subclass"), ("nobodys_plugin", "no installed package offers")):
        (tmp_path / "m.yaml").write_text(SCENE % (f"{{name: mine, filename: {name}}}", ""))
        sim = Simulation(ligature.load(tmp_path / "m.yaml"), allow_plugins=True)
        sim.step(1)
        assert reason in str(sim.problems[0])


def test_an_endless_drawing_ends(simulate: Make) -> None:
    sim = simulate("def draw(self):\n    while True: yield (0, 0, 0), (0, 0, 1), (1, 2, 3)")
    sim.step(1)
    assert sim.state["plugin_line_count"][0] == len(sim.state["plugin_line"][0])


# --- the example ------------------------------------------------------------------------------


def test_the_recorder_of_the_example_writes_what_was_simulated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    sim = Simulation(ligature.load(EXAMPLE), allow_plugins=True)
    poses = []
    for _ in range(40):
        sim.step(10)
        poses += [sim.bodies[name].pose for name in ("Ball", "Cube")]
    assert sim.state["plugin_value"][0, 0] == 80
    sim.close()
    with (tmp_path / "motion.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["body"] for row in rows[:2]] == ["Ball", "Cube"]
    assert np.array(
        [[float(row[c]) for c in ("x", "y", "z", "qx", "qy", "qz", "qw")] for row in rows]
    ) == pytest.approx(np.array(poses), abs=1e-12)
    assert [float(row["time"]) for row in rows[::2]] == pytest.approx(np.arange(1, 41) * 0.01)


def test_two_plugins_of_one_name_get_two(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(HEAD + "    pass\n")
    (tmp_path / "m.yaml").write_text(SCENE % (", ".join([ENTRY % ""] * 3), ""))
    scene = ligature.load(tmp_path / "m.yaml")
    assert [plugin.name for plugin in scene.plugins] == ["mine", "mine_2", "mine_3"]
    sim = Simulation(scene, allow_plugins=True)
    kinds = {type(plugin) for plugin in sim._parts.plugins._plugins}
    assert len(kinds) == 3 and all(issubclass(kind, Plugin) for kind in kinds)
