"""What differs from episode to episode beside the start of a task: ranges, and what is drawn from them.

SI units; every range is drawn from uniformly, and the same seed draws the same.
"""

from __future__ import annotations

import math
import os
import reprlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml

from ligature.model.scene import Scene
from ligature.paths import open_file, reason

MOST_BYTES, MOST_LEVELS = 1 << 16, 3
"""Of a file of ranges."""

Range = tuple[float, float]
Triple = tuple[float, float, float]


class Bound(NamedTuple):
    """What a range must lie in: ``least`` to ``most``; ``whole`` numbers where it counts; and what the unit is."""

    least: float
    most: float
    unit: str
    whole: bool = False


BOUNDS: dict[str, Bound] = {
    "light": Bound(0.05, 20.0, "times as bright"),
    "light_shift": Bound(-0.5, 0.5, "m"),
    "colour": Bound(0.0, 4.0, "times"),
    "camera_shift": Bound(-0.1, 0.1, "m"),
    "camera_turn": Bound(-0.5, 0.5, "rad"),
    "field_of_view": Bound(0.5, 1.5, "times"),
    "exposure": Bound(-4.0, 4.0, "stops"),
    "picture_noise": Bound(0.0, 0.5, "of full scale"),
    "mass": Bound(0.2, 5.0, "times"),
    "friction": Bound(0.3, 3.0, "times"),
    "needle_size": Bound(0.8, 1.2, "times"),
    "action_delay": Bound(0, 25, "actions", whole=True),
    "observation_delay": Bound(0, 25, "actions", whole=True),
    "joint_noise": Bound(0.0, 0.1, "rad"),
    "position_noise": Bound(0.0, 0.02, "m"),
    "angle_noise": Bound(0.0, 0.5, "rad"),
}
"""By name of a range."""

PHYSICS = ("mass", "friction", "needle_size")
"""Ranges that need another simulation for each episode."""


@dataclass(frozen=True)
class Randomisation:
    """Ranges (low, high) from which every episode draws; None leaves a thing as the scene has it.

    Attributes
    ----------
    light, light_shift
        Brightness of each light, a factor; metres by which it is moved along each axis of what carries it.
    colour
        Factor of red, green and blue of each body, and so of its texture.
    camera_shift, camera_turn
        Metres along, and radians about, each axis of what carries the cameras. Cameras with one carrier move as one.
    field_of_view
        Factor of the angle that the environment's camera sees.
    exposure, picture_noise
        Stops by which its pictures are brighter; standard deviation of each channel, as a part of full scale.
    mass
        Factor of the mass of each free body, and of each thread.
    friction
        Factor of the friction of each thing: an arm, a free body, a thread, a body that stands still.
    needle_size
        Factor of the lengths of the needle, by which it is heavier with the third power.
    action_delay, observation_delay
        Whole actions of 20 ms by which commands, and all that is observed, come late. Rewards and ``info`` do not.
    joint_noise
        Standard deviation of the angles that are observed of an arm's joints and jaw, radians.
    position_noise, angle_noise
        The same of the place of what is handled, for each axis, metres, and of its orientation, radians; the target is
        seen with the error of the place.
    """

    light: Range | None = None
    light_shift: Range | None = None
    colour: Range | None = None
    camera_shift: Range | None = None
    camera_turn: Range | None = None
    field_of_view: Range | None = None
    exposure: Range | None = None
    picture_noise: Range | None = None
    mass: Range | None = None
    friction: Range | None = None
    needle_size: Range | None = None
    action_delay: Range | None = None
    observation_delay: Range | None = None
    joint_noise: Range | None = None
    position_noise: Range | None = None
    angle_noise: Range | None = None

    def __post_init__(self) -> None:
        for name, bound in BOUNDS.items():
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, _checked(name, value, bound))

    @classmethod
    def of(cls, given: Randomisation | Mapping[str, Any] | str | Path | None) -> Randomisation | None:
        """What ``randomise`` of an environment states: None, ranges by name, or a YAML file of such.

        Raises
        ------
        ValueError
            For names that do not exist, ranges that are none or out of bounds, and files that are no mapping.
        """
        if given is None or isinstance(given, Randomisation):
            return given
        if isinstance(given, str | Path):
            try:
                return cls.of(_read(Path(given)))
            except ValueError as error:
                raise ValueError(str(error) if str(given) in str(error) else f"{given}: {error}") from error
        if not isinstance(given, Mapping):
            raise ValueError(f"randomise must be ranges by name or a YAML file of them, not {type(given).__name__}")
        unknown = [str(name) for name in given if name not in BOUNDS]
        if unknown:
            raise ValueError(f"randomise: unknown key '{unknown[0]}'; choose one of {', '.join(BOUNDS)}")
        return cls(**{name: _checked(name, value, BOUNDS[name]) for name, value in given.items()})

    def as_dict(self) -> dict[str, list[float]]:
        """The ranges that are given, as a YAML file has them."""
        return {name: list(value) for name, value in asdict(self).items() if value is not None}

    def draw(self, scene: Scene, rng: np.random.Generator) -> Drawn:
        """What an episode in ``scene`` gets.

        Parameters
        ----------
        scene
            What is simulated; all of its free bodies get a mass and a friction of their own.
        rng
            Where the numbers come from: the same state draws the same.

        Returns
        -------
        The numbers of one episode.
        """
        things = list(things_of(scene))
        free = [name for name, bodies in things if _free(scene, bodies)]

        def one(name: str) -> float:
            return float(rng.uniform(*getattr(self, name)))

        def three(name: str) -> Triple:
            low, high = getattr(self, name)
            x, y, z = rng.uniform(low, high, 3).tolist()
            return x, y, z

        def whole(name: str) -> int:
            low, high = getattr(self, name)
            return int(rng.integers(int(low), int(high), endpoint=True))

        def each(keys: list[str], of: Callable[[str], Any]) -> Callable[[str], dict[str, Any]]:
            return lambda name: {key: of(name) for key in keys}

        lights = [light.identity.identifier for light in scene.lights]
        seen = [body.identity.identifier for body in scene.bodies]
        how: dict[str, Callable[[str], Any]] = dict.fromkeys(BOUNDS, one) | {
            "light": each(lights, one), "light_shift": each(lights, three), "colour": each(seen, three),
            "camera_shift": three, "camera_turn": three,
            "mass": each(free, one), "friction": each([name for name, _ in things], one),
            "action_delay": whole, "observation_delay": whole,
        }  # fmt: skip
        if not scene.needles:
            del how["needle_size"]
        noise_seed = int(rng.integers(2**31))
        found = {name: draw(name) for name, draw in how.items() if getattr(self, name) is not None}
        return Drawn(noise_seed, **{name: value for name, value in found.items() if value != {}})


@dataclass(frozen=True)
class Drawn:
    """What one episode has, by the names of `Randomisation`; None where nothing was to be drawn.

    Nothing is drawn for what a scene lacks, such as a needle. Of lights, bodies and things there is a value for each,
    by identifier; an arm and a thread are known by their first body. ``noise_seed`` is that of all noise.
    """

    noise_seed: int = 0
    light: Mapping[str, float] | None = None
    light_shift: Mapping[str, Triple] | None = None
    colour: Mapping[str, Triple] | None = None
    camera_shift: Triple | None = None
    camera_turn: Triple | None = None
    field_of_view: float | None = None
    exposure: float | None = None
    picture_noise: float | None = None
    mass: Mapping[str, float] | None = None
    friction: Mapping[str, float] | None = None
    needle_size: float | None = None
    action_delay: int | None = None
    observation_delay: int | None = None
    joint_noise: float | None = None
    position_noise: float | None = None
    angle_noise: float | None = None

    @property
    def physics(self) -> tuple[Any, ...]:
        """What makes the scene another one; equal for equal scenes."""
        return tuple(getattr(self, name) for name in PHYSICS)

    def as_dict(self) -> dict[str, Any]:
        """What was drawn, for ``info``."""
        return {
            field.name: getattr(self, field.name) for field in fields(self) if getattr(self, field.name) is not None
        }


def things_of(scene: Scene) -> Iterator[tuple[str, tuple[int, ...]]]:
    """What has one material: trees of bodies, such as arms, lone bodies, and threads; name and bodies of each."""
    for tree in scene.articulations:
        bodies = tuple(link.body for link in tree.links)
        yield scene.bodies[bodies[0]].identity.identifier, bodies
    for rod in scene.rods:
        yield scene.bodies[rod.bodies[0]].identity.identifier, rod.bodies


def _free(scene: Scene, bodies: tuple[int, ...]) -> bool:
    """Whether a thing is one free body, or a thread."""
    alone = len(bodies) == 1 or bodies[0] in scene.rod_bodies
    return alone and not any(scene.bodies[body].static for body in bodies)


def _checked(name: str, value: Any, bound: Bound) -> Range:
    """A range as a pair of numbers; ValueError for anything else, and for one that is out of bounds."""
    kind = "whole numbers" if bound.whole else "numbers"
    wanted = f"{name} must be a pair [low, high] of {kind} from {bound.least:g} to {bound.most:g} ({bound.unit})"
    if isinstance(value, str) or not isinstance(value, list | tuple | np.ndarray) or len(value) != 2:
        raise ValueError(f"{wanted}, not {value!r}")
    for number in value:
        if not _is_number(number) or (bound.whole and number != int(number)):
            hint = "; YAML reads it as text: write a decimal point, as in 1.0e-3" if isinstance(number, str) else ""
            raise ValueError(f"{wanted}, but {reprlib.repr(number)} is not{hint}")
    low, high = float(value[0]), float(value[1])
    if low > high:
        raise ValueError(f"{wanted}, but {low:g} is above {high:g}: write the lower one first")
    if low < bound.least or high > bound.most:
        raise ValueError(f"{wanted}, not {low:g} to {high:g}")
    return low, high


def _is_number(value: Any) -> bool:
    """Whether a value is a finite number."""
    try:
        return isinstance(value, int | float | np.number) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:  # a whole number beyond all floating-point ones
        return False


def _read(path: Path) -> Any:
    """The mapping in a YAML file."""
    try:
        with open_file(path) as file:
            if os.fstat(file.fileno()).st_size > MOST_BYTES:
                raise ValueError(f"it has more than {MOST_BYTES >> 10} KiB")
            text = file.read().decode("utf-8")
        _check_flat(text)
        _check_once(text)
        found = yaml.safe_load(text)
    except (OSError, ValueError, yaml.YAMLError) as error:
        why = reason(error) if isinstance(error, OSError) else " ".join(str(error).split())
        raise ValueError(f"randomise: {path} cannot be read: {why}") from error
    if not isinstance(found, Mapping):
        raise ValueError(f"randomise: {path} must hold ranges by name, such as 'mass: [0.8, 1.2]'")
    return found


def _check_flat(text: str) -> None:
    """Raise ValueError for aliases and deep nesting, by which a short file becomes a long one; ranges need neither."""
    depth = 0
    for event in yaml.parse(text, Loader=yaml.CSafeLoader if hasattr(yaml, "CSafeLoader") else yaml.SafeLoader):
        if isinstance(event, yaml.AliasEvent):
            raise ValueError(f"line {event.start_mark.line + 1}: write the range out, without an alias")
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > MOST_LEVELS:
            raise ValueError(f"line {event.start_mark.line + 1}: a range is a pair of numbers, without lists in it")


def _check_once(text: str) -> None:
    """Raise ValueError for a name that stands twice, of which YAML takes the last."""
    lines: dict[str, int] = {}
    node = yaml.compose(text, Loader=yaml.SafeLoader)
    for key, _ in node.value if isinstance(node, yaml.MappingNode) else ():
        line = key.start_mark.line + 1
        if isinstance(key, yaml.ScalarNode) and lines.setdefault(key.value, line) != line:
            raise ValueError(f"line {line}: '{key.value}' is already in line {lines[key.value]}; keep one of them")
