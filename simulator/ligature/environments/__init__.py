"""Gymnasium environments; importing this room registers ``ligature/Reach-v0`` and the other tasks of `goals`."""

import gymnasium

from ligature.environments.suturing import SuturingEnv

__all__ = ["SuturingEnv"]

for _task in ("reach", "pick", "insert", "puncture"):
    gymnasium.register(
        id=f"ligature/{_task.capitalize()}-v0",
        entry_point="ligature.environments.suturing:SuturingEnv",
        kwargs={"task": _task},
    )
