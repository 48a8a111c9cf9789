"""Writes a running simulation to an HDF5 dataset, episode by episode; docs/datasets.md shows the layout.

Metres, radians, seconds, newtons; poses are x y z qx qy qz qw in world axes unless a name sets otherwise. An episode
that has ended is on the disk (`ligature.datasets.store`), whatever interrupts the next one.
"""

from __future__ import annotations

import sys
import threading
from collections import deque
from collections.abc import Collection, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
from numpy.typing import NDArray

import ligature
from ligature.camera_simulation import Simulation
from ligature.datasets.events import ARM_EVENTS, NEEDLE_EVENTS, EventWatch
from ligature.datasets.intake import (
    check_gestures,
    phases_of,
    rate_of,
    remarks_of,
    size_of,
    truth_of,
    unique_names,
    values_of,
)
from ligature.datasets.labels import ACTIVITIES, ActivityWatch
from ligature.datasets.rows import EpisodeRows, Packed, add_actions
from ligature.datasets.store import DatasetError, EpisodeStore, unwritable
from ligature.kernels import released
from ligature.model.scene import ArmDescription, ArmKind, JointType, Scene
from ligature.model.soft import TissueBody
from ligature.paths import printable
from ligature.process import signals_held

if TYPE_CHECKING:  # datasets of motion need no OpenGL
    from ligature.render.cameras import CameraHandle
    from ligature.render.target import Exposure

FORMAT = "ligature dataset 2"
DEPTH_UNIT = 1e-4
"""Metres of one step of depth: 0.1 mm, so that two bytes reach 6.5 m. 0 means background."""

WAITING = 2
"""Samples of which pictures may still be developed when the next one begins; each takes megabytes."""

IMPATIENT = 2e-4
"""Seconds for which the thread that develops pictures waits until it may go on."""

EARLY = 1e-6
"""Seconds before its time at which a sample is taken, for the rounding of simulated time."""

JOINT_ROWS, POSE, TWIST, WRENCH = "position, velocity, effort", "x y z qx qy qz qw", "v w", "f t"

Value = tuple[str, Any, dict[str, Any]]
"""Name and value of what one sample has, and how `EpisodeRows.append` keeps it."""

Picture = tuple[str, Packed, dict[str, str]]
"""Name of an array, its next picture, and the array's attributes."""


class DatasetWriter:
    """Samples ``simulation`` into the dataset ``path``; a context, which drops an unfinished episode when it fails.

    Parameters
    ----------
    path
        The file; it must not exist.
    simulation
        What is sampled.
    cameras
        Names of the cameras; none for motion alone.
    size
        Width and height of the pictures.
    rate
        Samples per simulated second.
    phases
        Names that `sample` takes.
    task
        What is done, as an instruction in words; `end_episode` may set another.
    gestures
        Gestures of JIGSAWS (`ligature.datasets.labels.GESTURES`) that phases are, by the name of the phase.
    remarks
        Further attributes of the whole dataset, such as ``operator`` or ``source``.

    Raises
    ------
    DatasetError
        When the file exists, or cannot be written, also while it grows.
    ValueError
        For a rate, a size, a camera, a phase, a gesture or a remark that cannot be.
    RuntimeError
        For a simulation that is closed.
    """

    def __init__(
        self,
        path: str | Path,
        simulation: Simulation,
        cameras: Sequence[str] = ("cameraL", "cameraR"),
        size: tuple[int, int] = (320, 240),
        rate: float = 10.0,
        phases: Sequence[str] = (),
        task: str = "",
        gestures: Mapping[str, str] | None = None,
        remarks: Mapping[str, float | int | str] | None = None,
    ) -> None:
        if simulation.closed:
            raise RuntimeError("the simulation is closed; make a new one before its dataset")
        self._path, self._simulation = Path(path), simulation
        self._size, self._rate = size_of(size), rate_of(rate)
        self._period = 1.0 / self._rate
        self._phases, self._task = ("", *phases_of(phases)), task
        check_gestures(gestures, self._phases[1:])
        self._gestures = dict(gestures or {})
        self._remarks = remarks_of({"task": task}) | remarks_of(remarks, of_all=True)
        self._shown = unique_names("cameras", cameras)
        self._cameras = _named(simulation, self._shown)
        self._watch, self._events = ActivityWatch(simulation.scene), EventWatch(simulation)
        self._episode: h5py.File | None = None
        self._rows: EpisodeRows | None = None
        self._exposures: dict[str, Exposure] = {}
        self._developed: deque[Future[list[Picture]]] = deque()
        self._laboratory = ThreadPoolExecutor(1, "pictures")
        self._shapes: dict[str, tuple[int, ...]] = {}
        self._samples, self._due, self._seen, self._ended = 0, 0.0, 0.0, False
        try:
            self._store = EpisodeStore(self._path, self._describe)
        except OSError as error:
            raise unwritable(self._path, error) from error

    def _describe(self, file: h5py.File) -> None:
        """Write the attributes that are the same for all episodes."""
        scene, attributes = self._simulation.scene, file.attrs
        attributes["format"], attributes["version"] = FORMAT, ligature.__version__
        attributes["scene"], attributes["rate"], attributes["task"] = printable(scene.name), self._rate, self._task
        attributes["phases"], attributes["activities"] = list(self._phases), list(ACTIVITIES)
        attributes["gestures"] = [self._gestures.get(phase, "") for phase in self._phases]
        attributes["depth_unit"] = DEPTH_UNIT
        attributes.update(self._remarks)
        names = [body.identity.topic for body in scene.bodies] + [ghost.identity.topic for ghost in scene.ghosts]
        file["id_names"] = np.array(["", *names], dtype=h5py.string_dtype())
        for arm in scene.arms:
            if arm.joints:
                self._describe_arm(arm, file.create_group(f"arms/{arm.name}").attrs)

    def _describe_arm(self, arm: ArmDescription, attributes: Any) -> None:
        scene, robot = self._simulation.scene, self._simulation.arms[arm.name]
        attributes["kind"], attributes["tool"] = arm.kind.value, getattr(robot, "tool_type", "")
        attributes["joint_names"] = list(robot.joints.names)
        attributes["joint_units"] = [_unit(scene.joints[joint].type) for joint in arm.joints]
        if arm.base >= 0:
            attributes["base_pose"] = self._simulation.state["body_pose"][0, arm.base]

    def follow(self, simulation: Simulation) -> None:
        """Sample another ``simulation`` from the next episode on, such as one that a reset of an environment has made.

        Raises ValueError within an episode, and for a simulation whose bodies, arms, threads, tissues or cameras are
        others: all episodes of a dataset have the same arrays.
        """
        if simulation is self._simulation:
            return
        if self._episode is not None:
            raise ValueError("an episode goes on in another simulation: end or drop it before follow()")
        _check_alike(self._simulation.scene, simulation.scene)
        self._cameras = _named(simulation, self._shown)
        self._simulation = simulation
        self._watch, self._events = ActivityWatch(simulation.scene), EventWatch(simulation)

    # --- episodes ---------------------------------------------------------------------------

    @property
    def count(self) -> int:
        """Episodes that have ended."""
        return self._store.count

    def sample(
        self, phase: str = "", arms: Collection[str] | None = None, extra: Mapping[str, Any] | None = None
    ) -> bool:
        """Take a sample if one is due; the first begins an episode. Returns whether a sample was taken.

        ``arms`` are those that do what ``phase`` names, by default all; ``extra`` are further numbers by name, such as
        an environment's observation, with the same names and shapes in each sample of an episode. Raises ValueError for
        a phase that was not announced, for an arm that the scene lacks, for numbers that cannot be kept or are not
        finite, and where time went back or a sample is more than a period late; the episode is then as before. Raises
        RuntimeError when the simulation or the dataset is closed.
        """
        if phase not in self._phases:
            raise ValueError(f"unknown phase '{phase}'; choose one of {', '.join(self._phases[1:]) or 'none'}")
        doers, time = self._doers(arms), self._now()
        if self._episode is not None and time < self._due - EARLY:
            return False
        extras = self._extras(extra)
        with self._writing():
            if self._episode is None:
                self._begin(time)
            assert self._rows is not None
            self._widen(extras)
            self._shapes = {name: value.shape for name, value in extras.items()}
            self._append_pictures(WAITING)
            self._expose()
            for name, value, options in self._values(phase, doers):
                self._rows.append(name, value, **options)
            for name, value in extras.items():
                self._rows.append(f"extra/{name}", value, value.dtype.str, units="the caller's")
            self._store.check()
        self._samples += 1
        self._due += self._period
        return True

    def _doers(self, arms: Collection[str] | None) -> Collection[str] | None:
        """The arms that do what a phase names, all of which are in the scene."""
        if arms is None:
            return None
        known, doers = [arm.name for arm in self._simulation.scene.arms], unique_names("arms", arms)
        for name in doers:
            if name not in known:
                raise ValueError(f"arms: unknown arm '{name}'; choose from {', '.join(known) or 'none'}")
        return doers

    def _now(self) -> float:
        """The simulated time, at which a sample can be taken; raises where none can."""
        if self._ended:
            raise DatasetError(f"the dataset '{self._path}' is closed; make another writer for another file")
        if self._simulation.closed:
            raise RuntimeError("the simulation of this dataset is closed; call follow() with one that runs")
        time = self._simulation.time
        if self._episode is not None:
            self._check_time(time)
        self._seen = time
        return time

    def _check_time(self, time: float) -> None:
        """Raise ValueError where samples of the present episode would not be at its rate."""
        if time < self._seen - EARLY:
            raise ValueError(
                f"time went back from {self._seen:g} to {time:g} s within an episode; call end_episode() or "
                "drop_episode() before you restore a snapshot"
            )
        if time - self._due > self._period + EARLY:
            raise ValueError(
                f"a sample was due at {self._due:g} s, and it is {time:g} s: samples would not be {self._rate:g} a "
                f"second; call sample() at least every {self._period:.3g} simulated seconds, or give a lower rate. "
                "end_episode() keeps the samples so far"
            )

    def _extras(self, extra: Mapping[str, Any] | None) -> dict[str, NDArray[Any]]:
        """The caller's numbers; ValueError for names and shapes that are not those of the samples before."""
        found = values_of(extra)
        shapes = {name: value.shape for name, value in found.items()}
        if self._episode is not None and shapes != self._shapes:
            raise ValueError(f"extra: all samples of an episode have the arrays {self._shapes}, not {shapes}")
        return found

    def _widen(self, extras: Mapping[str, NDArray[Any]]) -> None:
        """Let the caller's arrays have the types of these numbers too, as where whole ones are followed by others."""
        assert self._rows is not None
        for name, value in extras.items():
            if not self._rows.widen(f"extra/{name}", value):
                raise ValueError(
                    f"extra: '{name}' is {value.dtype} after other types, and no type keeps all digits of both; it "
                    "must have the same type in all samples of an episode"
                )

    def _begin(self, time: float) -> None:
        self._episode = self._store.begin()
        self._rows, self._exposures, self._developed = EpisodeRows(self._episode), {}, deque()
        self._samples, self._due = 0, time
        self._events.begin()

    def end_episode(self, success: bool, **remarks: float | int | str) -> None:
        """End the episode, with ``success`` and ``remarks`` as its attributes; from now on it is on the disk.

        ``task`` among the remarks replaces that of the dataset. Without a sample there is none to end. Raises
        ValueError for a success that is not a truth value, and for a remark that is neither a number nor a text; the
        episode goes on then.
        """
        success = truth_of("success", success)
        kept = remarks_of(remarks)
        if self._episode is None:
            return
        with self._writing():
            assert self._rows is not None
            self._develop()
            self._append_pictures(0)
            self._rows.finish()
            attributes = self._episode.attrs
            attributes["success"], attributes["samples"], attributes["task"] = success, self._samples, self._task
            attributes.update(kept)
            add_actions(self._episode)
            self._forget()
            self._store.finish()

    def drop_episode(self) -> None:
        """Discard the present episode."""
        self._forget()
        self._store.drop()

    def _forget(self) -> None:
        self._episode, self._rows, self._exposures, self._developed = None, None, {}, deque()

    def _values(self, phase: str, doers: Collection[str] | None) -> Iterator[Value]:
        """The values of one sample."""
        simulation, state = self._simulation, self._simulation.state[0]
        scene, label = simulation.scene, self._phases.index(phase)
        yield "time", simulation.time, {"dtype": "f8", "units": "s"}
        yield "phase", label, {"dtype": "u1"}
        activities, events = self._watch.activities(state), self._events.observe()
        each = zip(scene.arms, state["arm"], activities, events.arms, strict=True)
        for arm, record, activity, happened in each:
            if arm.joints:
                yield from self._motion(arm, record)
                yield f"arms/{arm.name}/phase", label if doers is None or arm.name in doers else 0, {"dtype": "u1"}
                yield f"arms/{arm.name}/activity", activity, {"dtype": "u1"}
                yield f"arms/{arm.name}/events", happened, {"dtype": "u1", "units": "1", "axes": ", ".join(ARM_EVENTS)}
        for index, jaw in enumerate(scene.jaws):
            if jaw.name in simulation.arms:
                yield f"arms/{jaw.name}/jaw/force", state["jaw_force"][index], {"dtype": "f4", "units": "N"}
        for needle in scene.needles[:1]:
            yield "needle/pose", state["body_pose"][needle.body], {"dtype": "f4", "units": "m", "axes": POSE}
            yield (
                "needle/twist",
                state["body_twist"][needle.body],
                {"dtype": "f4", "units": "m/s, rad/s", "axes": TWIST},
            )
            n = int(state["insertion_count"])
            force = state["insertion_force"][:n][state["insertion_body"][:n] == needle.body].sum(axis=0)
            yield "needle/tissue_force", force, {"dtype": "f4", "units": "N"}
            yield "needle/events", events.needle, {"dtype": "u1", "units": "1", "axes": ", ".join(NEEDLE_EVENTS)}
        for rod in scene.rods[:1]:
            yield "thread/points", state["body_pose"][list(rod.bodies), :3], {"dtype": "f4", "units": "m"}
            yield "thread/tension", state["rod_tension"][list(rod.bodies)], {"dtype": "f4", "units": "N"}
        for tissue in scene.tissues:
            yield from _tissue(scene, tissue, state)
        for name, camera in self._cameras.items():
            yield f"cameras/{name}/pose", camera.pose, {"dtype": "f8", "units": "m", "axes": POSE}
            yield f"cameras/{name}/intrinsics", camera.view(self._size).intrinsics, {"dtype": "f8", "units": "px"}

    def _motion(self, arm: ArmDescription, record: Any) -> Iterator[Value]:
        """Joints (position, velocity, effort by joint), tip and its wrench in the arm's base, and jaw of an arm."""
        joints, units = len(arm.joints), ", ".join(_unit(self._simulation.scene.joints[j].type) for j in arm.joints)
        rows = {"dtype": "f4", "units": units, "axes": JOINT_ROWS}
        pose = {"dtype": "f4", "units": "m", "axes": POSE}
        for what in ("measured", "setpoint"):
            yield f"arms/{arm.name}/{what}_js", record[f"{what}_js"][:, :joints], rows
            yield f"arms/{arm.name}/local_{what}_cp", record[f"local_{what}_cp"], pose
            if arm.kind is ArmKind.PSM:
                jaw = {"dtype": "f4", "units": "rad", "axes": JOINT_ROWS}
                yield f"arms/{arm.name}/jaw/{what}_js", record[f"jaw_{what}_js"], jaw
        wrench = {"dtype": "f4", "units": "N, N m", "axes": WRENCH}
        yield f"arms/{arm.name}/spatial_measured_cf", record["spatial_measured_cf"], wrench

    def _expose(self) -> None:
        """Begin the pictures of this sample; those of the last one were drawn since then, and are developed now."""
        self._develop()
        self._exposures = {name: camera.expose(self._size) for name, camera in self._cameras.items()}

    def _develop(self) -> None:
        """Have the pictures that are drawn developed and packed in another thread, beside what comes next."""
        for exposure in self._exposures.values():
            exposure.fetch()  # needs the thread of OpenGL
        if self._exposures:
            self._developed.append(self._laboratory.submit(_developed, self._exposures))
            self._exposures = {}

    def _append_pictures(self, most: int) -> None:
        """Add the pictures that have been developed; those of ``most`` samples may wait for it."""
        while self._developed and (len(self._developed) > most or self._developed[0].done()):
            assert self._rows is not None
            for name, picture, notes in self._developed.popleft().result():
                self._rows.append_picture(name, picture, **notes)

    # --- the end ----------------------------------------------------------------------------

    def close(self) -> None:
        """End the dataset and make one file of it; a second time does nothing.

        An unfinished episode counts as failed.
        """
        if self._ended:
            return
        self.end_episode(False)
        with self._writing():
            self._store.close(empty=True)
        self._ended = True
        self._laboratory.shutdown()

    def abandon(self) -> None:
        """End the dataset without the unfinished episode; without any other, delete it."""
        if not self._ended:
            self._ended = True
            self._forget()
            self._store.close(empty=False)
            self._laboratory.shutdown()

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Reports errors of the disk in one way, and discards the present episode then.

        Signals wait: HDF5 calls back into Python to write, and swallows what a handler raises there.
        """
        with signals_held():
            try:
                yield
            except (OSError, RuntimeError) as error:
                self._ended = True
                self._forget()
                kept = f"; {self.count} episode{'s are' if self.count > 1 else ' is'} whole" if self.count else ""
                try:
                    self._store.close(empty=False)
                except (OSError, RuntimeError) as second:
                    kept += f" ({second})" if self.count and str(second) != str(error) else ""
                raise unwritable(self._path, error, kept) from error

    def __enter__(self) -> DatasetWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        else:
            self.abandon()


def _developed(exposures: Mapping[str, Exposure]) -> list[Picture]:
    """The pictures of one sample."""
    found: list[Picture] = []
    with _IMPATIENCE:
        for name, exposure in exposures.items():
            frame = exposure.frame()
            depth, ids = (np.empty(frame.depth.shape, dtype=np.uint16) for _ in range(2))
            _count(frame.depth, frame.ids, depth, ids)
            found.append((f"cameras/{name}/rgb", Packed.of(frame.rgb), {}))
            found.append((f"cameras/{name}/depth", Packed.of(depth), {"units": "depth_unit"}))
            found.append((f"cameras/{name}/ids", Packed.of(ids), {}))
    return found


class _Impatience:
    """A context in which a thread of Python waits for another one for `IMPATIENT` seconds instead of 5 ms.

    A thread that compresses pictures leaves Python and comes back dozens of times, and waited longer than it worked.
    """

    def __init__(self) -> None:
        self._lock, self._users, self._usual = threading.Lock(), 0, 0.0

    def __enter__(self) -> None:
        with self._lock:
            if not self._users:
                self._usual = sys.getswitchinterval()
                sys.setswitchinterval(min(IMPATIENT, self._usual))
            self._users += 1

    def __exit__(self, *_error: object) -> None:
        with self._lock:
            self._users -= 1
            if not self._users:
                sys.setswitchinterval(self._usual)


_IMPATIENCE = _Impatience()


@released
def _count(
    metres: NDArray[np.float32], numbers: NDArray[np.int32], depth: NDArray[np.uint16], ids: NDArray[np.uint16]
) -> None:
    """Fill ``depth`` with whole depth units, 0 for infinity, and ``ids`` with ``numbers``; all (h, w)."""
    unit = np.float32(DEPTH_UNIT)
    for y in range(metres.shape[0]):
        for x in range(metres.shape[1]):
            steps = np.rint(metres[y, x] / unit)
            depth[y, x] = np.uint16(min(steps, np.float32(65535.0))) if np.isfinite(metres[y, x]) else 0
            ids[y, x] = numbers[y, x]


def _named(simulation: Simulation, cameras: Sequence[str]) -> dict[str, CameraHandle]:
    """Cameras by the last part of their names: arrays of a dataset lie under names without slashes."""
    found: dict[str, CameraHandle] = {}
    for name in cameras:
        handle, short = simulation.cameras[name], name.rpartition("/")[2]
        if found.get(short) is handle:
            raise ValueError(f"cameras: '{name}' is asked for twice; name each camera once")
        if short in found:
            raise ValueError(f"cameras: two are called '{short}'; a dataset can have one of them")
        found[short] = handle
    return found


def _check_alike(before: Scene, now: Scene) -> None:
    """Raise ValueError where two scenes do not have the same arrays in a dataset."""
    for what, first, second in zip(("bodies", "arms", "threads", "tissues"), _kinds(before), _kinds(now), strict=True):
        if first != second:
            raise ValueError(f"the simulation has other {what} than the dataset; write another dataset")


def _kinds(scene: Scene) -> tuple[Any, ...]:
    """Bodies, arms, threads and tissues of a scene, as far as a dataset's arrays depend on them."""
    return (
        (
            [body.identity.topic for body in scene.bodies],
            [ghost.identity.topic for ghost in scene.ghosts],
            [needle.body for needle in scene.needles],
        ),
        [(arm.name, arm.kind, [scene.joints[joint].type for joint in arm.joints]) for arm in scene.arms],
        [rod.bodies for rod in scene.rods],
        [(tissue.body, tissue.rows) for tissue in scene.tissues],
    )


def _unit(kind: JointType) -> str:
    return "m" if kind is JointType.PRISMATIC else "rad"


def _tissue(scene: Scene, tissue: TissueBody, state: Any) -> Iterator[Value]:
    """Nodes, forces and punctures of a body of tissue, in world axes."""
    names = [scene.bodies[other.body].identity.name for other in scene.tissues]
    own = names[tissue.index] if names.count(names[tissue.index]) == 1 else f"{names[tissue.index]}{tissue.index}"
    own = own.replace("/", "_")
    k, places = tissue.index, {"dtype": "f4", "units": "m"}
    yield f"tissue/{own}/points", state["tissue_node"][tissue.rows], places
    yield f"tissue/{own}/wrench", state["tissue_wrench"][k], {"dtype": "f4", "units": "N, N m", "axes": WRENCH}
    yield f"tissue/{own}/peak_force", state["tissue_peak"][k], {"dtype": "f4", "units": "N"}
    yield f"tissue/{own}/puncture_count", state["puncture_count"][k], {"dtype": "i4", "units": "1"}
    yield f"tissue/{own}/puncture_points", state["puncture_point"][k], places
    yield f"tissue/{own}/puncture_normals", state["puncture_normal"][k], {"dtype": "f4", "units": "1"}
