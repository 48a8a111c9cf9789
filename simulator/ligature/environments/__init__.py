"""Gymnasium environments; importing it registers ``ligature/Reach-v0`` and the other tasks of `goals`."""

from typing import Any

import gymnasium

from ligature.environments.goals import GOALS
from ligature.environments.suturing import EnvState, SuturingEnv
from ligature.environments.vector import SuturingVectorEnv

__all__ = ["EnvState", "SuturingEnv", "SuturingVectorEnv", "make_vec", "registered"]

MAX_STEPS = 200
"""Actions until an episode of a registered environment is cut; ``gymnasium.make`` has ``max_episode_steps``."""


def registered(task: str, **options: Any) -> SuturingEnv:
    """What ``gymnasium.make`` calls: an environment of ``task`` whose episodes are cut by Gymnasium's own wrapper.

    ``options`` are those of `SuturingEnv` but ``max_steps``, for which ValueError is raised.
    """
    if "max_steps" in options:
        raise ValueError("gymnasium.make has 'max_episode_steps' for what SuturingEnv calls 'max_steps'")
    return SuturingEnv(task, **options, max_steps=None)


registered.metadata = SuturingEnv.metadata  # type: ignore[attr-defined]

for _task in GOALS:
    gymnasium.register(
        id=f"ligature/{_task.capitalize()}-v0",
        entry_point="ligature.environments:registered",
        max_episode_steps=MAX_STEPS,
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
