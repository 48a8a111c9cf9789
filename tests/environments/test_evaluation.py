"""Policies are measured as what they are: by the deed, on their own seeds, alike in any number of processes."""

from __future__ import annotations

import copy
import errno
import json
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from ligature.cli.evaluate import evaluate
from ligature.cli.main import app
from ligature.environments import SuturingEnv
from ligature.environments.evaluation import Episode, run_episode, run_episodes, summary
from ligature.environments.goals import GOALS
from ligature.environments.policies import PolicyError, checked, load_policy
from ligature.render import RenderUnavailable
from rich.console import Console
from typer.testing import CliRunner

TIP, TARGET, NUMBERS = 27, 30, 52


def to_the_target(path: Path, R: np.ndarray, gain: float = 400.0) -> Path:
    """A network (ONNX) that steps towards the target of an observation, given the rotation of the arm's base."""
    weights = np.zeros((NUMBERS, 7), dtype=np.float32)
    weights[TARGET : TARGET + 3, :3] = gain * R
    weights[TIP : TIP + 3, :3] = -gain * R
    float_type = onnx.TensorProto.FLOAT
    graph = onnx.helper.make_graph(
        [
            onnx.helper.make_node("MatMul", ["state", "W"], ["way"]),
            onnx.helper.make_node("Clip", ["way", "low", "high"], ["action"]),
        ],
        "towards",
        [onnx.helper.make_tensor_value_info("state", float_type, [1, NUMBERS])],
        [onnx.helper.make_tensor_value_info("action", float_type, [1, 7])],
        [
            onnx.numpy_helper.from_array(weights, "W"),
            onnx.numpy_helper.from_array(np.float32(-1.0), "low"),
            onnx.numpy_helper.from_array(np.float32(1.0), "high"),
        ],
    )
    model = onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 17)], ir_version=9)
    onnx.save(model, path)
    return path


@pytest.fixture(scope="module")
def env() -> Any:
    made = SuturingEnv("reach", max_steps=None)
    yield made
    made.close()


@pytest.fixture(scope="module")
def network(env: SuturingEnv, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return to_the_target(tmp_path_factory.mktemp("network") / "towards.onnx", env.base_rotation)


def test_a_network_that_does_the_deed_succeeds_and_chance_does_not(env: SuturingEnv, network: Path) -> None:
    for seed in range(7, 11):
        found = run_episode(env, load_policy(str(network)), seed, 200)
        assert found.success and found.time == pytest.approx(found.steps * 0.02)
        assert not run_episode(env, load_policy("random"), seed, 60).success


def test_an_episode_is_measured_as_the_environment_tells_it(env: SuturingEnv, network: Path) -> None:
    """Way and reward by an own loop, whose tip comes from the observation."""
    found = run_episode(env, load_policy(str(network)), 21, 200)
    observation, info = env.reset(seed=21)
    begin, way, total, ended, steps = info["distance"], 0.0, 0.0, False, 0
    act = load_policy(str(network))(env, 21)
    while not ended:
        before = observation[TIP : TIP + 3]
        observation, reward, ended, _, info = env.step(act(observation))
        way, total, steps = way + np.linalg.norm(observation[TIP : TIP + 3] - before), total + reward, steps + 1
    assert (found.steps, found.success, found.lost) == (steps, True, "")
    assert found.reward == pytest.approx(total, abs=1e-12)
    assert found.path_length == pytest.approx(way, abs=1e-12) and found.path_length > begin - 0.002


def test_experts_are_policies_and_go_on_where_they_end(env: SuturingEnv) -> None:
    assert all(e.success for e in run_episodes("expert", {"task": "reach"}, range(3), 200))


def first_actions(task: str, **options: Any) -> Episode:
    """What the expert does at the start of an episode."""
    env = SuturingEnv(task, size=(8, 6), max_steps=None, **options)
    found = run_episode(env, load_policy("expert"), 3, 12)
    env.close()
    return found


@pytest.mark.parametrize("task", sorted(GOALS))
def test_an_expert_acts_by_the_ground_truth_whatever_is_observed(task: str) -> None:
    """Before, it did nothing where pictures are observed, and `pick` raised TypeError."""
    expected = first_actions(task)
    assert expected.path_length > 1e-3
    assert first_actions(task, observation="image") == expected == first_actions(task, observation="both")


@pytest.mark.parametrize("task", ["reach", "pick"])
def test_neither_noise_nor_delay_misleads_an_expert(task: str) -> None:
    noisy = {"position_noise": [0.02, 0.02], "observation_delay": [5, 5]}
    assert first_actions(task, randomise=noisy) == first_actions(task, randomise={})


def test_an_expert_succeeds_where_only_pictures_are_observed() -> None:
    options = {"task": "reach", "observation": "image", "size": (8, 6)}
    assert all(e.success for e in run_episodes("expert", options, range(3), 200))


def test_processes_change_nothing(network: Path) -> None:
    alone = list(run_episodes(str(network), {"task": "reach"}, range(40, 47), 60))
    shared = list(run_episodes(str(network), {"task": "reach"}, range(40, 47), 60, jobs=2))
    assert shared == alone


@pytest.mark.parametrize("name", ["nobody", "missing.onnx", "missing.py:act", "ligature.nothing:act", "json:nothing"])
def test_what_is_no_policy_is_named(name: str) -> None:
    with pytest.raises(PolicyError) as error:
        load_policy(name)
    assert name.split(":")[0] in str(error.value)


@settings(max_examples=50, deadline=None)
@given(st.binary(max_size=300))
def test_whatever_is_in_a_file_it_is_a_network_or_an_error(
    tmp_path_factory: pytest.TempPathFactory, data: bytes
) -> None:
    path = tmp_path_factory.mktemp("any") / "policy.onnx"
    path.write_bytes(data)
    with pytest.raises(PolicyError, match=r"is not an ONNX network"):
        load_policy(str(path))


@pytest.mark.parametrize(
    "answer", [np.zeros(6), np.zeros((1, 7)), np.full(7, np.nan), None, "left", [0.0] * 8, [10**400] * 7, [[1], [1, 2]]]
)
def test_what_is_no_action_is_reported(answer: Any) -> None:
    with pytest.raises(PolicyError, match="an action is 7 finite numbers"):
        checked(answer)


def test_a_file_s_function_acts_with_a_memory_of_its_own(env: SuturingEnv, tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(
        "import numpy as np\n"
        "def policy(env, seed):\n"
        "    left = [3]\n"
        "    def act(observation):\n"
        "        left[0] -= 1\n"
        "        return np.r_[0.5 * (left[0] >= 0), np.zeros(6)]\n"
        "    return act\n"
    )
    acts = load_policy(f"{tmp_path}/mine.py:policy")
    ways = [run_episode(env, acts, 5, 30).path_length for _ in range(2)]
    assert ways[0] == ways[1] == pytest.approx(1.5e-3, rel=0.2)


def episode(seed: int, success: bool, lost: str = "", time: float = 1.0) -> Episode:
    return Episode(seed, success, lost, round(time / 0.02), time, 1.0, 0.1, 0.0, 0.0)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.booleans(), st.floats(0.02, 4.0)), min_size=1, max_size=40))
def test_a_summary_is_within_its_intervals(data: list[tuple[bool, float]]) -> None:
    """Wilson's interval by its formula; a mean lies in its interval, and the interval in the range of the data."""
    found = summary([episode(k, done, "" if done else "dropped", time) for k, (done, time) in enumerate(data)])
    n, p, z = len(data), sum(done for done, _ in data) / len(data), 1.959963984540054
    middle, half = (
        (p + z * z / (2 * n)) / (1 + z * z / n),
        z / (1 + z * z / n) * np.sqrt(p * (1 - p) / n + z * z / (4 * n * n)),
    )
    assert found["success"]["mean"] == p and found["lost"]["mean"] == pytest.approx(1.0 - p)
    assert found["success"]["low"] == pytest.approx(middle - half, abs=1e-9)
    assert found["success"]["high"] == pytest.approx(middle + half, abs=1e-9)
    times = [time for _, time in data]
    mean, low, high = (found["time"][part] for part in ("mean", "low", "high"))
    assert min(times) - 1e-12 <= low <= mean + 1e-12 and mean - 1e-12 <= high <= max(times) + 1e-12
    done = [time for success, time in data if success]
    assert (
        found["time_to_success"] is None
        if not done
        else found["time_to_success"]["mean"] == pytest.approx(np.mean(done))
    )


class Links(HTMLParser):
    """What pictures and cells a page has."""

    def __init__(self) -> None:
        super().__init__()
        self.pictures: list[str] = []
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        if tag == "img":
            self.pictures.append(dict(attributes)["src"] or "")
        elif tag != "meta":
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_the_command_writes_what_it_prints(network: Path, tmp_path: Path) -> None:
    out = tmp_path / "found"
    command = ["evaluate", str(network), "--env", "reach", "--episodes", "4", "--out", str(out), "--pictures", "2"]
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 0, done.output
    assert "success: 100.0% (51.0% to 100.0%)" in done.output
    report = json.loads((out / "evaluation.json").read_text())
    assert [e["seed"] for e in report["episodes"]] == list(range(1_000_000, 1_000_004))
    assert report["environment"] == {"task": "reach", "action": "cartesian", "observation": "state"}
    page = Links()
    page.feed((out / "index.html").read_text())
    assert page.open == ["!doctype"] or page.open == []
    assert len(page.pictures) == 6 and all((out / name).stat().st_size > 1000 for name in page.pictures)


@pytest.mark.parametrize("name", ["evaluation.json", "index.html"])
def test_an_evaluation_is_not_written_over(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ligature.cli.evaluate.run_episodes", lambda *_: pytest.fail("it simulates"))
    (tmp_path / name).write_text("of yesterday")
    done = CliRunner().invoke(app, ["evaluate", "random", "--env", "reach", "--out", str(tmp_path)])
    assert done.exit_code == 2 and f"'{tmp_path / name}' exists already; choose another folder" in done.output
    assert (tmp_path / name).read_text() == "of yesterday"


def test_without_opengl_or_a_disk_for_the_output_the_figures_are_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unavailable(self: SuturingEnv) -> None:
        raise RenderUnavailable("no OpenGL here")

    monkeypatch.setattr(SuturingEnv, "render", unavailable)
    out, still = tmp_path / "out", tmp_path / "no UTF-8 \udcff.py"
    still.write_text("policy = lambda env, seed: lambda seen: [0.0] * 7")
    words = ["evaluate", f"{still}:policy", "--env", "reach", "--episodes", "1", "--max-steps", "1", "--out", str(out)]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0 and "the page has no pictures: no OpenGL here" in done.output, done.output
    assert json.loads((out / "evaluation.json").read_text())["summary"]["episodes"] == 1
    assert "<img" not in (out / "index.html").read_text()

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("ligature.cli.evaluate._print", full)
    with pytest.raises(OSError, match="No space left"):
        evaluate("random", {"task": "reach"}, range(1), 1, tmp_path / "full", 0, 1, Console(quiet=True))
    assert json.loads((tmp_path / "full" / "evaluation.json").read_text())["episodes"]


def test_a_folder_that_cannot_be_written_is_reported_before_anything_is_simulated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ligature.cli.evaluate.run_episodes", lambda *_: pytest.fail("it simulates"))
    (tmp_path / "file").touch()
    for out in ("file", "file/below", "/proc/found"):
        with pytest.raises(OSError) as error:
            evaluate("random", {"task": "reach"}, range(1), 1, tmp_path / out, 0, 1, Console(quiet=True))
        assert str(tmp_path / out) == error.value.filename


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nobody", "--env", "reach"], "no policy 'nobody'"),
        (["random", "--env", "knit"], "task must be one of"),
        (["expert", "--env", "reach", "--action", "joint"], "experts act with action='cartesian'"),
    ],
)
def test_the_command_says_what_is_wrong(arguments: list[str], message: str) -> None:
    done = CliRunner().invoke(app, ["evaluate", *arguments, "--episodes", "1"])
    assert done.exit_code == 2 and message in done.output, done.output


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ("raise ValueError('no weights')", r"no policy '.*mine.py:policy': ValueError at .*mine.py:1: no weights"),
        ("def (", r"no policy '.*mine.py:policy': SyntaxError: invalid syntax \(mine.py, line 1\)"),
        ("policy = lambda env, seed: 5", r"policy\(env, seed\) returns a function from observation to action; .* 5"),
        ("policy = 5", r"'.*mine.py:policy' is not a function; policy\(env, seed\) returns a function"),
        ("policy = lambda: None", r"is called with environment and seed: policy\(env, seed\) .*; this one takes \(\)"),
        ("policy = lambda seen: None", r"policy\(env, seed\) returns a function .*; this one takes \(seen\)"),
        ("policy = lambda env, seed: lambda: 0", r"which takes the observation; this one takes \(\)"),
        ("raise SystemExit(0)", "no policy '.*': SystemExit at .*mine.py:1: 0"),
        ("def policy(env, seed): raise SystemExit(0)", "the policy raised SystemExit at .*mine.py:1: 0"),
        ("policy = lambda env, seed:\\\n lambda seen: exit()", "the policy raised SystemExit at .*sitebuiltins.*"),
        ("policy = lambda env, seed:\\\n lambda seen: 1 // 0", r"the policy raised ZeroDivisionError at .*mine.py:2: "),
    ],
)
def test_what_a_users_code_raises_is_reported_with_its_place(
    env: SuturingEnv, tmp_path: Path, code: str, message: str
) -> None:
    (tmp_path / "mine.py").write_text(code)
    with pytest.raises(PolicyError, match=message):
        run_episode(env, load_policy(f"{tmp_path / 'mine.py'}:policy"), 1, 5)


MISDEEDS: dict[str, Callable[[SuturingEnv], object]] = {
    "closed the environment": SuturingEnv.close,
    "closed the environment ": lambda env: env.simulation.close(),
    "reset the environment": lambda env: env.reset(seed=1),
    "stepped the environment": lambda env: env.step(np.ones(7)),
    "restored another moment of the environment": lambda env: env.restore(env.kept),  # type: ignore[attr-defined]
    "stepped the simulation": lambda env: env.simulation.step(),
    "moved bodies of the simulation": lambda env: env.simulation.set_pose(
        env.needle, np.array([0, 0, 0.1, 0, 0, 0, 1])
    ),
}


@settings(max_examples=14, deadline=None)
@given(what=st.sampled_from(sorted(MISDEEDS)), at=st.integers(-1, 5))
@example("stepped the environment", -1)
@example("reset the environment", 0)
@example("restored another moment of the environment", 3)
def test_what_a_policy_does_to_the_environment_is_found_whenever_it_does_it(what: str, at: int) -> None:
    """Before, steps of its own were not counted, and what it reset was reported under other seeds."""
    at = max(at, 1) if "restored" in what else at

    def policy(env: SuturingEnv, seed: int) -> Any:
        left = [at]
        env.kept = env.save()  # type: ignore[attr-defined]

        def act(observation: Any) -> Any:
            if left[0] == 0:
                MISDEEDS[what](env)
            left[0] -= 1
            return np.zeros(7)

        if at < 0:
            MISDEEDS[what](env)
        return act

    env = SuturingEnv("pick", max_steps=None)
    with pytest.raises(
        PolicyError, match=f"the policy {what.strip()}; it may only look at it, and try things in a copy"
    ):
        run_episode(env, policy, 4, 8)
    env.close()


@pytest.mark.parametrize("task", ["reach", "puncture"])
def test_a_policy_may_look_and_try_things_in_a_copy(task: str) -> None:
    def policy(env: SuturingEnv, seed: int) -> Any:
        def act(observation: Any) -> Any:
            trial = copy.deepcopy(env)
            trial.step(np.ones(7))
            trial.close()
            return env.base_rotation.T @ (env.goal.target() - env.tool_position) @ np.ones((3, 7))

        return act

    env = SuturingEnv(task, max_steps=None)
    assert run_episode(env, policy, 4, 3).steps == 3
    env.close()


def test_a_policy_that_exits_ends_the_command_with_an_error(tmp_path: Path) -> None:
    """Before, its status was the command's: 0, and no output."""
    (tmp_path / "mine.py").write_text("def policy(env, seed):\n    raise SystemExit(0)\n")
    for jobs in ("1", "2"):
        words = ["evaluate", f"{tmp_path}/mine.py:policy", "--env", "reach", "--episodes", "2", "-j", jobs]
        done = CliRunner().invoke(app, words)
        assert done.exit_code == 2 and "the policy raised SystemExit" in done.output, done.output


@given(st.lists(st.booleans(), min_size=1, max_size=200))
def test_the_interval_of_success_is_wilsons_by_his_formula(done: list[bool]) -> None:
    """Wilson, Journal of the American Statistical Association 22 (1927): roots of a quadratic, written out."""
    found = summary([episode(k, success) for k, success in enumerate(done)])["success"]
    n, share, z = len(done), sum(done) / len(done), 1.959963984540054
    middle, half = share + z * z / (2 * n), z * np.sqrt(share * (1 - share) / n + z * z / (4 * n * n))
    low, high = (middle - half) / (1 + z * z / n), (middle + half) / (1 + z * z / n)
    assert (found["low"], found["high"]) == pytest.approx((low, high), abs=1e-9)
