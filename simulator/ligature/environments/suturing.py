"""An environment over the simulation in process: arms learn to reach, to handle a needle and to drive it.

Metres, radians, world axes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ligature.camera_simulation import Simulation
from ligature.environments import layout
from ligature.environments.actions import ArmActions
from ligature.environments.goals import GOALS, Goal, Progress
from ligature.environments.options import RENDER_MODES, arm_names, check_options, difference, psm_of, task_scene
from ligature.environments.randomisation import Drawn, Randomisation
from ligature.environments.reading import ArmReading, write_on_side
from ligature.environments.variation import Channel, dress, place, varied
from ligature.kernels import compiled
from ligature.model.frames import pose7_matrix
from ligature.model.load import load
from ligature.model.scene import Scene
from ligature.robots.psm_arm import PsmArm
from ligature.simulation import Snapshot

Array = NDArray[np.float64]

CONTROL = 0.02
"""Seconds of an action."""

SUCCESS_REWARD = 1.0

CAMERA = "cameraL"
"""What shows an environment by default; a scene without it can be simulated, but not drawn."""

TRIES = 20
"""How often an episode is drawn anew whose start cannot be simulated, such as one with a needle too smooth to hold."""


@dataclass(frozen=True, eq=False)
class EnvState:
    """Where an environment is in an episode: opaque, made by `SuturingEnv.save`; for the same task and options."""

    options: Mapping[str, Any]
    snapshot: Snapshot
    goal: Mapping[str, Any]
    progress: Progress
    count: int
    random: Mapping[str, Any]
    drawn: Drawn | None = None
    channel: Channel | None = None


class SuturingEnv(gymnasium.Env[Any, NDArray[np.float32]]):
    """One PSM or several before a pad with a needle, a board, or a vessel with a thread.

    **Actions**, `Box(-1, 1, (7,))`, for 20 ms each; of several arms 7 numbers each, one arm after the other:

    | number | ``action="cartesian"`` | ``action="joint"`` |
    |---|---|---|
    | 0 to 2 | step of the tip along the base's axes, 1 is 1 mm | yaw, pitch (1 is 0.01 rad), insertion (1 is 1 mm) |
    | 3 to 5 | rotation vector about the tip's axes, 1 is 0.05 rad | roll (0.08 rad), wrist pitch, yaw (0.06 rad) |
    | 6 | jaw, 1 opens by 0.1 rad | the same |

    An action moves the set-point, which stays within 5 mm and 0.25 rad of what is measured (joints: five actions): an
    arm that something stops does not wind up.

    **Observations** with ``observation="state"``, `Box(-inf, inf, (52,))`:

    | numbers | what | unit |
    |---|---|---|
    | 0 to 5 | joint values | rad, m |
    | 6 | jaw | rad |
    | 7 to 13 | pose of the tip in the arm's base, x y z qx qy qz qw | m |
    | 14 to 20 | pose of what is handled: the needle, the end of the thread, or another body of the task | m |
    | 21 to 26 | twist of it | m/s, rad/s |
    | 27 to 29 | the tool's control point | m |
    | 30 to 32 | the target | m |
    | 33 | how far there is to go | m |
    | 34 to 40 | joint velocities, that of the jaw last | rad/s, m/s |
    | 41 to 47 | set-point of the tip in the arm's base | m |
    | 48 | set-point of the jaw | rad |
    | 49 | 1 while the arm's jaws hold it | |
    | 50 | share of the time for which something must be so until the task is done | |
    | 51 | stage: lifted by half (``pick``), share of the holes passed (``insert``, ``puncture``), 0.5 when the second \
arm holds the needle and 1 when it alone does (``hand_over``), a quarter each for entry and exit passed, the needle \
driven, and taken by the second arm (``suture``), 1 when the thread has the throw (``first_throw``), a third each for \
the first throw, the square knot, and both ends drawn (``knot_tie``) | |

    Each further arm adds 33 numbers: joint values, jaw, pose of the tip, control point, joint velocities, set-point of
    the tip and of the jaw, and 1 while its jaws hold what is handled.

    Quaternions have the sign that is nearer to where tip and needle begin: they do not leap from one to the other.
    What the next state and reward depend on is among these but for the shapes of thread and tissue, and for what
    ``randomise`` draws.

    With ``observation="image"`` they are pictures of ``camera``, `Box(0, 255, (height, width, 3), uint8)`; with
    ``"both"``, a `Dict` of ``image`` and ``state``.

    **Reward** ``"dense"``: metres gained in an action, times 100, and 1 at the end; ``"sparse"``: 1 at the end, else 0.

    **Episodes** end when the task is done or the needle is dropped (``info["lost"]`` has the reason), and are cut after
    ``max_steps`` actions. The same seed and actions give the same bits.

    With ``randomise`` each episode draws its own world, `randomisation` has it, and ``info`` of `reset` in
    ``"randomisation"``.

    `save` and `restore` work at any time; copies (``copy.deepcopy``) and pickles continue identically.

    Parameters
    ----------
    task
        A name of `ligature.environments.goals.GOALS`, such as ``reach``.
    scene
        A launch file with PSMs and what the task needs: a needle, holes for ``insert``, soft tissue for ``puncture``;
        by default what it needs of a scene of ours, without other arms, and for ``reach`` without the thread and with
        the needle fixed.
    arm
        Name of the arm, or names of the arms in the order of the task; by default those of the task. Others bring the
        whole scene.
    action, observation, reward
        As above.
    camera, size
        Name of the camera, and width and height of its pictures in pixels.
    max_steps
        Actions until an episode is cut, None for no end; ``gymnasium.make`` has ``max_episode_steps`` for this.
    render_mode
        ``rgb_array`` to draw with `render`, or None.
    randomise
        What differs from episode to episode: a `Randomisation`, a mapping or a YAML file of its ranges, or None. With
        ranges of masses, friction or the needle's size each `reset` makes another `simulation`.
    """

    metadata: dict[str, Any] = {"render_modes": [*RENDER_MODES], "render_fps": 50}  # noqa: RUF012 (as the base class)

    def __init__(
        self,
        task: str = "reach",
        scene: str | Path | None = None,
        arm: str | Sequence[str] | None = None,
        action: str = "cartesian",
        observation: str = "state",
        reward: str = "dense",
        camera: str = CAMERA,
        size: tuple[int, int] = (84, 84),
        max_steps: int | None = 200,
        render_mode: str | None = None,
        randomise: Randomisation | Mapping[str, Any] | str | Path | None = None,
    ) -> None:
        self._options = {name: value for name, value in locals().items() if name not in ("self", "__class__")}
        check_options(task, action, observation, reward, size, max_steps, render_mode)
        self._randomisation = self._options["randomise"] = Randomisation.of(randomise)
        names = arm_names(task, arm)
        self._scene = task_scene(task, names) if scene is None else load(scene)
        self._arm_names, self._action, self._observation = names, action, observation
        self._dense, self._camera, self._size, self._most = reward == "dense", camera, size, max_steps
        self.render_mode = render_mode
        self.action_space = spaces.Box(-1.0, 1.0, (layout.action_width(len(names)),), np.float32)
        image = spaces.Box(0, 255, (size[1], size[0], 3), np.uint8)
        state = spaces.Box(-np.inf, np.inf, (layout.state_width(len(names)),), np.float64)
        both = spaces.Dict({"image": image, "state": state})
        self.observation_space: spaces.Space[Any] = {"image": image, "state": state, "both": both}[observation]
        self._drawn: Drawn | None = None
        self._channel: Channel | None = None
        self._dressed, self._count, self._episodes, self._closed = True, 0, 0, False
        self._refused, self._bounded = "", False
        self._progress: Progress | None = None
        self._build(self._scene)

    def _build(self, scene: Scene) -> None:
        """Simulate ``scene`` up to where episodes begin."""
        self._simulation = Simulation(scene)
        try:
            self._arms = tuple(psm_of(self._simulation, name) for name in self._arm_names)
            self._readings = tuple(ArmReading(self._simulation, arm) for arm in self._arms)
            self._hands = tuple(
                ArmActions(arm, reading, self._action) for arm, reading in zip(self._arms, self._readings, strict=True)
            )
            self._ticks = round(CONTROL / self._simulation.dt)
            self._goal: Goal = GOALS[self.task](self._simulation, self._arms)
            self._settle()
            if self._observation != "state" or self.render_mode is not None or self._camera != CAMERA:
                self._simulation.cameras[self._camera]  # KeyError names those that there are
        except Exception:
            self._simulation.close()
            raise
        self._tip_sides = [arm.local_measured_cp()[3:] for arm in self._arms]
        self._side = self._simulation.state["body_pose"][0, self.needle, 3:].copy()

    def _settle(self, start: int = 0) -> None:
        """Bring the scene to a settled start; it follows from scene, task and arms, and is simulated once in a process.

        The others than the first are simulated from that one, when an episode begins there for the first time.
        """
        known = _STARTS.setdefault(self._simulation.scene, {})
        which = type(self._goal), self._arm_names, start
        if which in known:
            self._simulation.restore(known[which])
            return
        if start:
            self._settle()
        self._goal.settle(start)
        known[which] = self._simulation.snapshot()

    @property
    def goal(self) -> Goal:
        """What is to be done."""
        return self._goal

    @property
    def simulation(self) -> Simulation:
        """The simulation, which is the ground truth for scripted experts and for datasets.

        With ranges of masses, friction or the needle's size it is another one after each `reset`.
        """
        return self._simulation

    @property
    def arm(self) -> PsmArm:
        """The arm that acts, the first of several."""
        return self._arms[0]

    @property
    def arms(self) -> tuple[PsmArm, ...]:
        """The arms that act."""
        return self._arms

    @property
    def readings(self) -> tuple[ArmReading, ...]:
        """What the arms report."""
        self._check_open()
        return self._readings

    @property
    def episodes(self) -> int:
        """Episodes that have begun."""
        return self._episodes

    @property
    def steps(self) -> int:
        """Actions of this episode."""
        return self._count

    @property
    def closed(self) -> bool:
        """Whether it, or its simulation, is closed."""
        return self._closed or self._simulation.closed

    @property
    def randomisation(self) -> dict[str, Any]:
        """What was drawn for this episode, by the names of `Randomisation`; empty without ``randomise``."""
        return {} if self._drawn is None else self._drawn.as_dict()

    @property
    def needle(self) -> int:
        """The body that is handled, such as the needle."""
        return self._goal.body

    @property
    def task(self) -> str:
        """Name of what is to be done."""
        return str(self._options["task"])

    @property
    def action(self) -> str:
        """What actions are, ``cartesian`` or ``joint``."""
        return self._action

    @property
    def tool_position(self) -> Array:
        """The control point (3,) of the first arm's tool, world axes."""
        self._check_open()
        return self._readings[0].tip_position()

    @property
    def tool_positions(self) -> Array:
        """The control points (arms, 3) of all tools, world axes."""
        self._check_open()
        return np.array([reading.tip_position() for reading in self._readings])

    @property
    def needle_force(self) -> Array:
        """What tissue, or holes in it, exert on the needle (3,), N, world axes."""
        self._check_open()
        state = self._simulation.state[0]
        n = int(state["insertion_count"])
        return np.asarray(state["insertion_force"][:n][state["insertion_body"][:n] == self.needle].sum(axis=0))

    @property
    def base_rotation(self) -> Array:
        """Rotation (3, 3) of the arm's base in the world; actions are along the base's axes, targets in the world's."""
        self._check_open()
        return pose7_matrix(self._readings[0].base)[:3, :3]

    @property
    def base_position(self) -> Array:
        """Where the arm's base is (3,), world axes."""
        self._check_open()
        return np.array(self._readings[0].base[:3])

    @property
    def setpoint(self) -> Array:
        """Pose (7,) of the tip in the arm's base that is asked for; Cartesian actions are added to it."""
        self._check_open()
        return np.array(self._readings[0].setpoint)

    def true_state(self) -> Array:
        """The numbers of ``observation="state"`` as they are, without noise or delay, whatever is observed.

        Raises RuntimeError before `reset` and after `close`.
        """
        self._begun("true_state()")
        return self._state()

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; ``seed`` begins another series of random starts.

        Raises ValueError for any of ``options``: there are none. Also where no episode can begin in `TRIES` draws, such
        as where no jaws hold a needle that they should.
        """
        if options:
            raise ValueError(
                f"reset takes no options, but got {', '.join(map(repr, options))}; pass options to the class"
            )
        self._check_open()
        super().reset(seed=seed)
        self._progress = None
        self._progress = self._draw_start()
        self._count, self._refused, self._bounded = 0, "", False
        self._episodes += 1
        drawn = {} if self._drawn is None else {"randomisation": self.randomisation}
        return self._seen(), {**self._info(), **drawn}

    def _draw_start(self) -> Progress:
        """Draw what this episode has and where it begins, again where it cannot begin so; returns how it stands."""
        draw = self._drawing()
        for _ in range(TRIES):
            try:
                draw()
                return self._start()
            except ValueError as error:
                why = error
        raise ValueError(f"no episode can begin in {TRIES} draws: {why}") from why

    def _drawing(self) -> Callable[[], None]:
        """What draws the world of this episode; without ranges it stays as it is."""
        ranges = self._randomisation
        if ranges is None:
            return lambda: None
        rng = np.random.default_rng(int(self.np_random.integers(2**62)))
        return lambda: self._take(ranges.draw(self._scene, rng))

    def _start(self) -> Progress:
        """Begin an episode; ValueError where it does not begin as the task has it."""
        starts = self._goal.starts
        self._settle(int(self.np_random.integers(starts)) if starts > 1 else 0)
        if self._drawn is not None:
            place(self._simulation, self._drawn)
        self._goal.begin(self.np_random)
        self._goal.check_start()
        begun = self._goal.observe()
        if begun.ended:
            raise ValueError(f"it is over as it begins: {begun.lost or 'the task is done'}")
        return begun

    def _take(self, drawn: Drawn) -> None:
        """Make ``drawn`` what this episode has."""
        before = self._drawn.physics if self._drawn is not None else Drawn().physics
        if drawn.physics != before:
            self._drawn = None
            self._simulation.close()
            self._build(varied(self._scene, drawn))
        self._drawn, self._channel, self._dressed = drawn, Channel(drawn, len(self._arms)), False

    def step(self, action: NDArray[np.float32]) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Act for 20 ms; NaN means 0, and what is beyond -1 and 1 these.

        After the task is done or lost the world goes on, but nothing is paid any more. Raises ValueError for what is no
        action, RuntimeError before `reset` and after `close`.
        """
        before = self._begun("step()")
        wanted = self._numbers_of(action)
        if self._channel is not None:
            wanted = self._channel.act(wanted)
        answers = [hand.act(wanted[layout.ACTION * k : layout.ACTION * (k + 1)]) for k, hand in enumerate(self._hands)]
        self._simulation.step(self._ticks)
        self._count += 1
        self._progress = before if before.ended else self._goal.observe()
        left, done, lost = self._progress
        reward = SUCCESS_REWARD * (done and not before.done) + (100.0 * (before.left - left) if self._dense else 0.0)
        cut = self._most is not None and self._count >= self._most
        self._refused = "; ".join(filter(None, (text for text, _ in answers)))
        self._bounded = any(bounded for _, bounded in answers)
        return self._seen(), float(reward), done or bool(lost), cut, self._info()

    def _numbers_of(self, action: Any) -> Array:
        """An action as numbers from -1 to 1."""
        width = layout.action_width(len(self._arms))
        found = layout.numbers_of(action, (width,), f"an action is {width} numbers")
        _bound(found)
        return found

    def _check_open(self) -> None:
        if self._closed:
            raise RuntimeError("the environment is closed: make another one")

    def _begun(self, call: str) -> Progress:
        """How the episode stands."""
        self._check_open()
        if self._progress is None:
            raise RuntimeError(f"no episode has begun: call reset() before {call}")
        return self._progress

    # --- keeping a moment -------------------------------------------------------------------

    def save(self) -> EnvState:
        """Where the environment is, with its random numbers, for `restore` here or in another one like it.

        Bullet keeps contacts that nobody can read; this drops them here too, so that an episode goes on with the same
        last bits as all that are restored from it, and with others than one that was never saved. Raises RuntimeError
        before the first `reset`.
        """
        progress = self._begun("save()")
        return EnvState(
            self._options, self._simulation.snapshot(), self._goal.snapshot(), progress, self._count,
            deepcopy(self.np_random.bit_generator.state), self._drawn, deepcopy(self._channel),
        )  # fmt: skip

    def restore(self, state: EnvState) -> Any:
        """Go on from where `save` was called; returns the observation there.

        Raises ValueError for a state of another task, scene, arm or randomisation, and TypeError for anything else.
        """
        self._check_open()
        if not isinstance(state, EnvState):
            raise TypeError(f"a {type(state).__name__} is not a state of an environment; restore what 'save' returned")
        for name in ("task", "scene", "arm", "randomise"):
            theirs, own = state.options[name], self._options[name]
            if theirs != own:
                raise ValueError(f"the state has {difference(name, theirs, own)}")
        if state.drawn is not None:
            self._take(state.drawn)
        self._simulation.restore(state.snapshot)
        self._goal.restore(dict(state.goal))
        self._progress, self._count = state.progress, state.count
        self.np_random.bit_generator.state = deepcopy(dict(state.random))
        self._channel = deepcopy(state.channel)
        return self._observe() if self._channel is None else self._channel.last

    def __deepcopy__(self, memo: dict[int, Any]) -> SuturingEnv:
        """A copy of the simulation that continues identically."""
        return _made(*self.__reduce__()[1])

    def __copy__(self) -> SuturingEnv:
        raise TypeError("two environments cannot share one simulation: use copy.deepcopy, or save and restore")

    def __reduce__(self) -> tuple[Any, ...]:
        self._check_open()
        return _made, (self._options, None if self._progress is None else self.save())

    def _seen(self) -> Any:
        """What the agent sees after an action: by default what is."""
        now = self._observe()
        return now if self._channel is None else self._channel.late(now)

    def _observe(self) -> Any:
        if self._observation == "both":
            return {"image": self._picture(self._size), "state": self._numbers()}
        return self._numbers() if self._observation == "state" else self._picture(self._size)

    def _numbers(self) -> Array:
        found = self._state()
        return found if self._channel is None else self._channel.sense(found)

    def _state(self) -> Array:
        """The state, as the table of the class has it."""
        assert self._progress is not None
        state, goal = self._simulation.state, self._goal
        found = np.empty(layout.state_width(len(self._arms)))
        for k, (arm, side) in enumerate(zip(self._readings, self._tip_sides, strict=True)):
            arm.write(layout.places(k), side, found)
            if k:
                found[layout.held_at(k)] = goal.holds(k)
        write_on_side(state["body_pose"][0, self.needle], self._side, found[layout.POSE])
        found[layout.TWIST] = state["body_twist"][0, self.needle]
        found[layout.TARGET], found[layout.LEFT], found[layout.MARKS] = goal.target(), self._progress.left, goal.marks()
        return found

    def _info(self) -> dict[str, Any]:
        assert self._progress is not None
        left, done, lost = self._progress
        info = {
            "distance": left, "is_success": done, "lost": lost, "sim_time": self._simulation.time,
            "refused": self._refused, "bounded": self._bounded,
        }  # fmt: skip
        if self._simulation.scene.tissues:
            state = self._simulation.state
            info["tissue_force"] = float(np.linalg.norm(state["tissue_wrench"][0, 0, :3]))
            info["tissue_peak_force"] = float(state["tissue_peak"][0, 0])
            info["punctures"] = int(state["puncture_count"][0, 0])
        return info

    def render(self) -> Any:
        """A picture (480, 640, 3) of the camera."""
        self._check_open()
        return self._picture((640, 480)) if self.render_mode == "rgb_array" else None

    def dress(self) -> None:
        """Have cameras of `simulation` show lights, colours and the field of view that were drawn, as `render` does."""
        self._check_open()
        if self._drawn is not None and not self._dressed:
            dress(self._simulation, self._drawn, self._camera)
            self._dressed = True

    def _picture(self, size: tuple[int, int]) -> NDArray[np.uint8]:
        self.dress()
        camera = self._simulation.cameras[self._camera]
        picture = camera.capture(size, passes=("rgb",), **self._sensor()).rgb
        assert picture is not None
        return picture

    def _sensor(self) -> dict[str, Any]:
        """What the camera's sensor does to a picture, where something was drawn."""
        drawn = self._drawn
        if drawn is None or not (drawn.exposure or drawn.picture_noise):
            return {}
        from ligature.render.sensor import ImageSensor

        return {"sensor": ImageSensor(drawn.exposure or 0.0, drawn.picture_noise or 0.0, seed=drawn.noise_seed)}

    def close(self) -> None:
        """Give the physics back; a second time does nothing."""
        if not self._closed:
            self._closed = True
            self._simulation.close()


_STARTS: WeakKeyDictionary[Scene, dict[tuple[type[Goal], tuple[str, ...], int], Snapshot]] = WeakKeyDictionary()
"""Settled starts by scene, task, arms and number; the processes of a vector have them from the one that forks."""


@compiled
def _bound(action: Array) -> None:
    """Make an ``action`` numbers from -1 to 1: 0 of NaN, the nearer end of what is beyond."""
    for k in range(action.shape[0]):
        value = action[k]
        action[k] = 0.0 if value != value else min(max(value, -1.0), 1.0)


def _made(options: Mapping[str, Any], state: EnvState | None) -> SuturingEnv:
    """An environment of ``options`` that continues from ``state``."""
    env = SuturingEnv(**options)
    if state is not None:
        env.restore(state)
    return env
