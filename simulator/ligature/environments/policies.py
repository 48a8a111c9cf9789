"""What acts in an environment: networks in ONNX files, functions of Python files, the scripted experts, chance."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.environments.experts import EXPERTS
from ligature.environments.hand import Hand
from ligature.environments.layout import ACTION, numbers_of
from ligature.environments.suturing import SuturingEnv
from ligature.paths import real_path

Act = Callable[[Any], NDArray[Any]]
"""The action (7 numbers for each arm) for an observation; of one episode, whose first is the first that it gets."""

Policy = Callable[[SuturingEnv, int], Act]
"""What acts in an episode, from the environment, which has been reset, and the seed of the episode."""


RIGHT = "policy(env, seed) returns a function from observation to action"

LOOK = "it may only look at it, and try things in a copy (copy.deepcopy)"
"""What a policy may do with the environment."""

LARGEST = float(np.finfo(np.float32).max)

ROUNDING = 1e-9
"""Metres by which bodies may seem to move where an environment is copied, which restores its state."""


class PolicyError(ValueError):
    """A policy that is unavailable, or that answers with something other than an action."""


def load_policy(name: str) -> Policy:
    """A policy by its name.

    Parameters
    ----------
    name
        ``expert``, ``random``; a file ``*.onnx``: one network from observations to actions, in any framework's export;
        or ``FILE.py:FUNCTION`` and ``MODULE:FUNCTION``, called with environment and seed at the start of each episode,
        which returns a function from observation to action. The code of such a file runs: it must be trusted.

    Raises
    ------
    PolicyError
        Where there is no such policy, with what is expected.
    """
    if name in BUILT_IN:
        return BUILT_IN[name]
    if name.endswith(".onnx"):
        return _network(Path(name))
    if ":" in name:
        return _function(*name.rsplit(":", 1))
    known = ", ".join(sorted(BUILT_IN))
    raise PolicyError(f"no policy '{name}': use {known}, a file *.onnx, FILE.py:FUNCTION or MODULE:FUNCTION")


def _expert(env: SuturingEnv, seed: int) -> Act:
    """The scripted expert of the task, which sees the ground truth; what it leaves over is spent standing still."""
    if env.action != "cartesian":
        raise PolicyError("experts act with action='cartesian'")
    actions = EXPERTS[env.task](Hand(env), env.true_state())
    still = np.zeros(env.action_space.shape or (), dtype=np.float32)

    def act(observation: Any) -> NDArray[Any]:
        try:
            return next(actions, still)
        except ValueError:  # the needle lies where it cannot be grasped: an episode that the expert loses
            return still

    return act


def _random(env: SuturingEnv, seed: int) -> Act:
    rng = np.random.default_rng(seed)
    return lambda observation: rng.uniform(-1.0, 1.0, env.action_space.shape)


BUILT_IN: dict[str, Policy] = {"expert": _expert, "random": _random}


def _network(path: Path) -> Policy:
    """A network whose inputs are observations with a first axis of 1, and whose first output is (1, 7 for each arm)."""
    import onnxruntime

    if not path.is_file():
        raise PolicyError(f"no file '{path}'")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1  # the same sums in the same order everywhere
    try:
        session = onnxruntime.InferenceSession(path.read_bytes(), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime has a class of its own for each way in which a file can be wrong
        raise PolicyError(f"{path} is not an ONNX network: {_first_line(error)}") from error
    inputs = session.get_inputs()
    if not inputs:
        raise PolicyError(f"{path} has no input; a policy takes an observation")
    types = {"tensor(float)": np.float32, "tensor(double)": np.float64, "tensor(uint8)": np.uint8}
    for wanted in inputs:
        if wanted.type not in types:
            raise PolicyError(f"{path}: input '{wanted.name}' has the type {wanted.type}; use {', '.join(types)}")

    def act(observation: Any) -> NDArray[Any]:
        seen = observation if isinstance(observation, dict) else {inputs[0].name: observation}
        missing = [wanted.name for wanted in inputs if wanted.name not in seen]
        if missing:
            raise PolicyError(f"{path} wants '{missing[0]}', an observation has {', '.join(seen)}")
        fed = {wanted.name: np.asarray(seen[wanted.name], types[wanted.type])[None] for wanted in inputs}
        try:
            return np.asarray(session.run(None, fed)[0])[0]
        except Exception as error:  # as above
            shapes = ", ".join(f"{name} {value.shape}" for name, value in fed.items())
            raise PolicyError(f"{path} does not take {shapes}: {_first_line(error)}") from error

    return lambda env, seed: act


def _first_line(error: Exception) -> str:
    """What onnxruntime says, which may be nothing."""
    return next(iter(str(error).splitlines()), type(error).__name__)


def _function(place: str, name: str) -> Policy:
    try:
        found = getattr(_module(place), name)
    except (ImportError, AttributeError, OSError) as error:
        raise PolicyError(f"no policy '{place}:{name}': {error}") from error
    except (Exception, SystemExit) as error:  # whatever the code of a user raises as it is imported
        raise PolicyError(f"no policy '{place}:{name}': {_raised(error)}") from error
    if not callable(found):
        raise PolicyError(f"'{place}:{name}' is not a function; {RIGHT}")
    _check_arguments(found, 2, f"'{place}:{name}' is called with environment and seed: {RIGHT}")
    return found  # type: ignore[no-any-return]


def _module(place: str) -> Any:
    if not place.endswith(".py"):
        return importlib.import_module(place)
    path = real_path(Path(place))
    if not path.is_file():
        raise FileNotFoundError(f"no file '{place}'")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module  # dataclasses and pickle look for the module of a class there
    spec.loader.exec_module(module)
    return module


def asked(policy: Policy, env: SuturingEnv, seed: int) -> Act:
    """What acts in an episode that has begun.

    PolicyError, also from it later, names where a user's code raised, and what it did to the environment.
    """
    act = _guarded(env, policy, env, seed)
    if not callable(act):
        raise PolicyError(f"{RIGHT}; it returned {act!r}")
    _check_arguments(act, 1, f"{RIGHT}, which takes the observation")
    return lambda observation: _guarded(env, act, observation)  # type: ignore[no-any-return]


def _check_arguments(function: Callable[..., Any], count: int, right: str) -> None:
    """Raise PolicyError where a ``function`` of a user cannot be called with ``count`` arguments."""
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):  # of some functions in C nobody knows
        return
    try:
        signature.bind(*range(count))
    except TypeError as error:
        raise PolicyError(f"{right}; this one takes {signature}: {error}") from error


def _guarded(env: SuturingEnv, function: Callable[..., Any], *arguments: Any) -> Any:
    """What a ``function`` of a user returns, which must leave ``env`` as it is."""
    before = Moment.of(env)
    try:
        answer = function(*arguments)
    except PolicyError:
        raise
    except (Exception, SystemExit) as error:
        raise PolicyError(f"the policy raised {_raised(error)}") from error
    done = before.changed(env)
    if done:
        raise PolicyError(f"the policy {done}; {LOOK}")
    return answer


class Moment(NamedTuple):
    """What nothing but an action changes in an environment while a policy is evaluated."""

    episodes: int
    steps: int
    time: float
    poses: NDArray[np.float64]

    @classmethod
    def of(cls, env: SuturingEnv) -> Moment:
        """That of now."""
        simulation = env.simulation
        return cls(env.episodes, env.steps, simulation.time, simulation.state["body_pose"].copy())

    def changed(self, env: SuturingEnv) -> str:
        """What was done to the environment since; empty: nothing."""
        if env.closed:
            return "closed the environment"
        now = Moment.of(env)
        if now.episodes != self.episodes:
            return "reset the environment"
        if now.steps != self.steps:
            return "stepped the environment" if now.steps > self.steps else "restored another moment of the environment"
        if now.time != self.time:
            return "stepped the simulation"
        moved = now.poses.shape != self.poses.shape or not np.allclose(now.poses, self.poses, rtol=0.0, atol=ROUNDING)
        return "moved bodies of the simulation" if moved else ""


def _raised(error: BaseException) -> str:
    """What was raised, and where."""
    if isinstance(error, SyntaxError):
        return f"SyntaxError: {error}"
    last = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__} at {last.filename}:{last.lineno}: {error}"


def checked(action: Any, width: int = ACTION) -> NDArray[np.float32]:
    """An action (``width``,) as the environment takes it; PolicyError where it is none."""
    right = f"the policy must return an action; an action is {width} finite numbers"
    try:
        found = numbers_of(action, (width,), right)
    except ValueError as error:
        raise PolicyError(str(error)) from error
    if not np.isfinite(found).all():
        raise PolicyError(f"{right}, not {found.tolist()}")
    return np.clip(found, -LARGEST, LARGEST).astype(np.float32)
