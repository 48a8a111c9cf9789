"""Gymnasium environments; importing it registers ``ligature/Reach-v0`` and the other tasks of `goals`."""

from typing import Any

import gymnasium

from ligature.environments.goals import GOALS, Goal
from ligature.environments.randomisation import Randomisation
from ligature.environments.suturing import EnvState, SuturingEnv
from ligature.environments.vector import SuturingVectorEnv

__all__ = ["EnvState", "Randomisation", "SuturingEnv", "SuturingVectorEnv", "env_id", "make_vec", "registered"]
MAX_STEPS = Goal.steps
"""Actions until an episode of most registered environments is cut; ``gymnasium.make`` has ``max_episode_steps``."""


def registered(task: str, **options: Any) -> SuturingEnv:
    """What ``gymnasium.make`` calls: an environment of ``task`` whose episodes are cut by Gymnasium's own wrapper.

    ``options`` are those of `SuturingEnv` but ``max_steps``, for which ValueError is raised.
    """
    if "max_steps" in options:
        raise ValueError("gymnasium.make has 'max_episode_steps' for what SuturingEnv calls 'max_steps'")
    return SuturingEnv(task, **options, max_steps=None)


registered.metadata = SuturingEnv.metadata  # type: ignore[attr-defined]


def env_id(task: str) -> str:
    """The name of the registered environment of ``task``: ``ligature/HandOver-v0`` for ``hand_over``."""
    return f"ligature/{''.join(part.capitalize() for part in task.split('_'))}-v0"


for _task in GOALS:
    gymnasium.register(
        id=env_id(_task),
        entry_point="ligature.environments:registered",
        max_episode_steps=GOALS[_task].steps,
        kwargs={"task": _task},
    )


def make_vec(task: str, n: int, *, autoreset: str = "next step", **options: Any) -> SuturingVectorEnv:
    """``n`` environments in as many processes, which write their observations into shared memory.

    When one of them ends or raises, all end, and RuntimeError names it. They end with the process that made them, too.

    Parameters
    ----------
    task, options
        As for `SuturingEnv`.
    n
        Number of environments, at least 1; as many as the machine has cores is best.
    autoreset
        When an environment whose episode ended begins the next one: with the ``next step``, within the ``same step``
        (``info`` has ``final_obs`` and ``final_info``), or ``off``: ``reset(options={"reset_mask": ...})`` does it.

    Returns
    -------
    SuturingVectorEnv
        As gymnasium's vector environments; observations (n, ...).
    """
    return SuturingVectorEnv(task, n, autoreset, **options)
