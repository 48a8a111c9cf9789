"""Gymnasium environments; importing it registers ``ligature/Reach-v0`` and the other tasks of `goals`."""

from functools import partial
from typing import Any

import gymnasium

from ligature.environments.suturing import SuturingEnv

__all__ = ["SuturingEnv", "make_vec"]

for _task in ("reach", "pick", "insert", "puncture"):
    gymnasium.register(
        id=f"ligature/{_task.capitalize()}-v0",
        entry_point="ligature.environments.suturing:SuturingEnv",
        kwargs={"task": _task},
    )


def make_vec(task: str, n: int, **options: Any) -> gymnasium.vector.AsyncVectorEnv:
    """``n`` environments in as many processes, which write their observations into shared memory.

    An episode that ended begins anew with the next step. Close it, or its processes stay.

    Parameters
    ----------
    task, options
        As for `SuturingEnv`.
    n
        Number of environments, at least 1; as many as the machine has cores is best.
    """
    if n < 1:
        raise ValueError(f"n is a number of environments, at least 1, not {n}")
    return gymnasium.vector.AsyncVectorEnv([partial(SuturingEnv, task, **options)] * n, shared_memory=True)
