"""Gymnasium environments; importing it registers ``ligature/Reach-v0``, ``Pick-v0``, ``Insert-v0``."""

import gymnasium

from ligature.environments.suturing import SuturingEnv

__all__ = ["SuturingEnv"]

for _task in ("reach", "pick", "insert"):
    gymnasium.register(
        id=f"ligature/{_task.capitalize()}-v0",
        entry_point="ligature.environments.suturing:SuturingEnv",
        kwargs={"task": _task},
    )
