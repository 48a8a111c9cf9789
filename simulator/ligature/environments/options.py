"""The options of an environment: whether they are allowed, and the arms and the scene that they stand for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from ligature.bundle import SCENES
from ligature.camera_simulation import Simulation
from ligature.environments.goals import GOALS
from ligature.environments.randomisation import Randomisation
from ligature.model.load import load
from ligature.model.scene import Scene
from ligature.robots.psm_arm import PsmArm

MOST_PIXELS = 16384
"""Of a side of a picture."""

RENDER_MODES = ("rgb_array",)


def check_options(
    task: Any, action: Any, observation: Any, reward: Any, size: Any, max_steps: Any, render_mode: Any
) -> None:
    """Raise ValueError for an option that is none of those allowed, and name these."""
    for name, value, allowed in (
        ("task", task, tuple(GOALS)), ("action", action, ("cartesian", "joint")),
        ("observation", observation, ("state", "image", "both")), ("reward", reward, ("dense", "sparse")),
    ):  # fmt: skip
        if not isinstance(value, str) or value not in allowed:
            raise ValueError(f"{name} must be one of {', '.join(allowed)}, not '{value}'")
    if (
        len(np.shape(size)) != 1
        or len(size) != 2
        or not all(isinstance(n, int | np.integer) and 0 < n <= MOST_PIXELS for n in size)
    ):
        raise ValueError(f"size is a width and a height in pixels, 1 to {MOST_PIXELS} each, not {size!r}")
    if max_steps is not None and (not isinstance(max_steps, int | np.integer) or max_steps < 1):
        raise ValueError(f"max_steps is a number of actions, at least 1, or None for no end, not {max_steps!r}")
    if render_mode not in (None, *RENDER_MODES):
        raise ValueError(f"render_mode must be None or rgb_array, not {render_mode!r}")


def arm_names(task: str, given: str | Sequence[str] | None) -> tuple[str, ...]:
    """Names of the arms that act; ValueError where the task needs more or fewer, TypeError for what is no name."""
    own = GOALS[task].arms
    if not isinstance(given, str | Sequence | None):
        raise TypeError(f"arm is {given!r}; it must be the name of an arm, or a list of names")
    names = own if given is None else (given,) if isinstance(given, str) else tuple(given)
    if len(names) != len(own) or len(set(names)) != len(names):
        wanted = f"{len(own)} arm{'s' * (len(own) > 1)}, such as {', '.join(own)}"
        raise ValueError(f"{task} is done by {wanted}, not by {', '.join(names) or 'none'}")
    return names


def psm_of(simulation: Simulation, name: str) -> PsmArm:
    """The PSM of a name; ValueError where it is no PSM, KeyError where there is none."""
    arm = simulation.arms[name]
    if not isinstance(arm, PsmArm):
        known = [other for other, found in simulation.arms.items() if isinstance(found, PsmArm)]
        raise ValueError(f"'{name}' is not a PSM; choose one of {', '.join(known) or 'none'}")
    return arm


@cache
def task_scene(task: str, arms: tuple[str, ...]) -> Scene:
    """What a task needs of its scene; all of it when other arms than the task's own are asked for."""
    goal = GOALS[task]
    path = SCENES / goal.scene / "launch.yaml"
    if arms != goal.arms:
        return load(path)
    scene = load(path, goal.models)
    scene = replace(scene, arms=tuple(found for found in scene.arms if found.name in arms))
    if goal.thread:
        return scene
    fixed = {needle.body for needle in scene.needles}
    bodies = tuple(replace(body, mass=0.0) if body.index in fixed else body for body in scene.bodies)
    return replace(scene, bodies=bodies, rods=())


def difference(name: str, theirs: Any, own: Any) -> str:
    """How the option ``name`` of a state differs from the own one; of ranges, those that do."""
    if not (isinstance(theirs, Randomisation) and isinstance(own, Randomisation)):
        first, second = (given.as_dict() if isinstance(given, Randomisation) else given for given in (theirs, own))
        return f"{name}={first!r}, not {second!r}"
    ranges, others = theirs.as_dict(), own.as_dict()
    differing = [each for each in {**ranges, **others} if ranges.get(each) != others.get(each)]
    first, second = (", ".join(f"{each}={given.get(each)}" for each in differing) for given in (ranges, others))
    return f"{name} with {first}, not {second}"
