"""Environments in processes of their own, which write what they observe into shared memory."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np
from gymnasium.vector import AsyncVectorEnv, AutoresetMode
from gymnasium.vector.async_vector_env import AsyncState

from ligature.environments.layout import numbers_of
from ligature.environments.suturing import SuturingEnv
from ligature.process import ending

AUTORESET = {"next step": AutoresetMode.NEXT_STEP, "same step": AutoresetMode.SAME_STEP, "off": AutoresetMode.DISABLED}
"""When an environment whose episode ended begins the next one; see Gymnasium's ``AutoresetMode``."""

PARENT_NAP = 0.5
"""Seconds between two looks of a worker at whether its parent lives."""

DEATH_WAIT = 2.0
"""Seconds to wait for the status of a process whose pipe is shut."""


@dataclass(frozen=True)
class _Made:
    """Makes an environment in a worker, or one in the process ``parent`` to ask for its spaces."""

    task: str
    options: dict[str, Any]
    parent: int

    def __call__(self) -> SuturingEnv:
        if os.getpid() != self.parent:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
            signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent closes its workers
            threading.Thread(target=self._end_with_parent, name="parent", daemon=True).start()
        return SuturingEnv(self.task, **self.options)

    def _end_with_parent(self) -> None:
        """End this process once its parent has: workers hold each other's pipes open, so that none notices."""
        forked_by_server, maker = os.getppid() != self.parent, multiprocessing.parent_process()
        while os.getppid() == self.parent or (forked_by_server and maker is not None and maker.is_alive()):
            time.sleep(PARENT_NAP)
        os._exit(0)


class SuturingVectorEnv(AsyncVectorEnv):
    """Gymnasium's vector of environments in processes, which reports which of them ended and leaves none behind.

    Parameters
    ----------
    task, n, autoreset, options
        As for `ligature.environments.make_vec`.
    """

    def __init__(self, task: str, n: int, autoreset: str = "next step", **options: Any) -> None:
        if not isinstance(n, int | np.integer) or n < 1:
            raise ValueError(f"n is a number of environments, at least 1, not {n!r}")
        if autoreset not in AUTORESET:
            raise ValueError(f"autoreset must be one of {', '.join(map(repr, AUTORESET))}, not {autoreset!r}")
        made = _Made(task, options, os.getpid())
        with _imports_of_installed():
            super().__init__(
                [made] * n, shared_memory=True, autoreset_mode=AUTORESET[autoreset], context=_start_method(options)
            )

    def _check_spaces(self) -> None:
        with self._watched():
            super()._check_spaces()

    def reset_async(self, *args: Any, **kwargs: Any) -> None:
        """Have all environments begin anew; ``AsyncVectorEnv`` lists what this and the methods below take."""
        with self._watched():
            super().reset_async(*args, **kwargs)

    def reset_wait(self, *args: Any, **kwargs: Any) -> Any:
        """Observations and infos once all have begun anew."""
        with self._watched():
            return super().reset_wait(*args, **kwargs)

    def step_async(self, actions: Any) -> None:
        """Send each environment its action; raises ValueError, before any of them acts, for what is none."""
        shape = self.action_space.shape
        assert shape is not None
        numbers = numbers_of(actions, shape, f"actions of {shape[0]} environments are {shape[0]} by {shape[1]} numbers")
        with self._watched():
            super().step_async(numbers)

    def step_wait(self, *args: Any, **kwargs: Any) -> Any:
        """What all environments answer to their actions."""
        with self._watched():
            return super().step_wait(*args, **kwargs)

    def call_async(self, name: str, *args: Any, **kwargs: Any) -> None:
        """Call the method ``name`` of each environment, or ask for the attribute."""
        with self._watched():
            super().call_async(name, *args, **kwargs)

    def call_wait(self, *args: Any, **kwargs: Any) -> Any:
        """What all environments answer to the call."""
        with self._watched():
            return super().call_wait(*args, **kwargs)

    def set_attr(self, name: str, values: Any) -> None:
        """Set the attribute ``name`` of each environment to its one of ``values``."""
        with self._watched():
            super().set_attr(name, values)

    def close_extras(self, timeout: float | None = None, terminate: bool = False, **_: Any) -> None:
        """End all processes within ``timeout`` seconds, or unasked (``terminate``), as when one has ended."""
        if any(process.exitcode is not None for process in self.processes):
            self._state, terminate = AsyncState.DEFAULT, True
        try:
            super().close_extras(timeout, terminate)
        except (EOFError, ConnectionError):
            super().close_extras(timeout, True)

    @contextmanager
    def _watched(self) -> Iterator[None]:
        """Report a process that ended, and end the others with it."""
        try:
            yield
        except (EOFError, ConnectionError) as error:
            self._report(error)

    def _report(self, error: Exception) -> NoReturn:
        deadline = time.monotonic() + DEATH_WAIT
        while all(process.exitcode is None for process in self.processes) and time.monotonic() < deadline:
            time.sleep(0.01)
        ended = [
            f"environment {k} of {self.num_envs} (process {process.pid}) {ending(process.exitcode)}"
            for k, process in enumerate(self.processes)
            if process.exitcode is not None
        ]
        self._state = AsyncState.DEFAULT
        self.close(terminate=True)
        raise RuntimeError(
            f"{'; '.join(ended) or 'an environment'}: the vector environment is closed; make a new one"
        ) from error

    def _raise_if_errors(self, successes: list[bool] | tuple[bool]) -> None:
        """Raise RuntimeError for what an environment raised, and end all."""
        try:
            super()._raise_if_errors(successes)
        except Exception as error:
            failed = [k for k, success in enumerate(successes) if not success]
            self.close(terminate=True)
            raise RuntimeError(
                f"environment {failed[-1]} of {self.num_envs} raised {type(error).__name__}: {error}"
            ) from error


def _start_method(options: dict[str, Any]) -> str | None:
    """How to start the processes: by forking, the default on Linux, unless they draw and this process has drawn."""
    draws = options.get("observation", "state") != "state" or options.get("render_mode") is not None
    if not draws or multiprocessing.get_start_method() != "fork":
        return None
    from ligature.render.context import has_drawn

    return "spawn" if has_drawn() else None


@contextmanager
def _imports_of_installed() -> Iterator[None]:
    """Have processes that are spawned in the block import nothing from the working folder; from Python 3.11 on."""
    before = os.environ.get("PYTHONSAFEPATH")
    os.environ["PYTHONSAFEPATH"] = before or "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ["PYTHONSAFEPATH"]
        else:
            os.environ["PYTHONSAFEPATH"] = before
