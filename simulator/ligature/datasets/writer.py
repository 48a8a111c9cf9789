"""Writes a simulation that goes on into an HDF5 file, episode by episode; docs/learning.md shows the layout.

Metres, radians, seconds, newtons; poses are x y z qx qy qz qw in world axes unless a name sets otherwise. Until the
dataset is closed, its file is called ``NAME.part``.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Any

import h5py
import numpy as np

import ligature
from ligature.camera_simulation import Simulation
from ligature.model.scene import ArmDescription, ArmKind, Scene
from ligature.model.soft import TissueBody

FORMAT = "ligature dataset 1"
DEPTH_UNIT = 1e-4
"""Metres of one step of depth: 0.1 mm, so that two bytes reach 6.5 m. 0 is where nothing is."""

EARLY = 1e-6
"""Seconds before its time at which a sample is taken, for the rounding of simulated time."""


class DatasetError(RuntimeError):
    """A dataset that cannot be written; the message gives the reason."""


class _Disk(io.FileIO):
    """A file that keeps the first ``error`` of writing to itself: HDF5 crashes when its disk is full."""

    error: OSError | None = None

    def write(self, data: Any) -> int:
        """Write all of ``data``."""
        view = memoryview(data).cast("B")
        try:
            at = 0
            while at < len(view) and self.error is None:
                at += super().write(view[at:])
        except OSError as error:
            self.error = error
        return len(view)

    def truncate(self, size: int | None = None) -> int:
        """Make the file as long as HDF5 wants it."""
        try:
            return super().truncate(size)
        except OSError as error:
            self.error = self.error or error
            return size or 0


class DatasetWriter:
    """Samples ``simulation`` into the file ``path``; a context, which removes what was written when it fails.

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

    Raises
    ------
    DatasetError
        When the file exists, or cannot be written, also while it grows.
    """

    def __init__(
        self,
        path: Path,
        simulation: Simulation,
        cameras: Sequence[str] = ("cameraL", "cameraR"),
        size: tuple[int, int] = (320, 240),
        rate: float = 10.0,
        phases: Sequence[str] = (),
    ) -> None:
        if path.exists():
            raise DatasetError(f"'{path}' exists already; choose another name")
        self._path, self._part = path, path.with_name(f"{path.name}.part")
        self._simulation, self._size, self._period = simulation, size, 1.0 / rate
        self._cameras = {name: simulation.cameras[name] for name in cameras}
        self._phases = ("", *phases)
        self._episode: h5py.Group | None = None
        self._count = self._samples = 0
        self._due = 0.0
        self._ended = False
        with self._writing():
            self._disk = _Disk(self._part, "w+")
            self._file = h5py.File(self._disk, "w")
            self._describe(rate)

    def _describe(self, rate: float) -> None:
        """What holds for all episodes."""
        scene, attributes = self._simulation.scene, self._file.attrs
        attributes["format"], attributes["version"] = FORMAT, ligature.__version__
        attributes["scene"], attributes["rate"] = scene.name, rate
        attributes["phases"], attributes["depth_unit"] = list(self._phases), DEPTH_UNIT
        names = [body.identity.topic for body in scene.bodies] + [ghost.identity.topic for ghost in scene.ghosts]
        self._file["id_names"] = np.array(["", *names], dtype=h5py.string_dtype())

    # --- episodes ---------------------------------------------------------------------------

    def sample(self, phase: str = "") -> bool:
        """Take a sample if one is due, which begins an episode if none goes on; returns whether it did.

        Raises ValueError for a phase that was not announced.
        """
        if phase not in self._phases:
            raise ValueError(f"no phase is called '{phase}'; there are {', '.join(self._phases[1:]) or 'none'}")
        time = self._simulation.time
        if self._episode is not None and time < self._due - EARLY:
            return False
        with self._writing():
            if self._episode is None:
                self._episode = self._file.create_group(f"episode_{self._count:04d}")
                self._count, self._samples, self._due = self._count + 1, 0, time
            for name, value, options in self._values(phase):
                self._append(name, value, options)
        self._samples += 1
        self._due += self._period
        return True

    def end_episode(self, success: bool, **remarks: float | int | str) -> None:
        """End the episode, with ``success`` and ``remarks`` as its attributes.

        Without a sample there is none to end.
        """
        if self._episode is None:
            return
        with self._writing():
            self._episode.attrs["success"], self._episode.attrs["samples"] = success, self._samples
            for name, value in remarks.items():
                self._episode.attrs[name] = value
            self._file.flush()
        self._episode = None

    def _values(self, phase: str) -> Iterator[tuple[str, Any, dict[str, Any]]]:
        """Names, values and storage of one sample."""
        simulation, state = self._simulation, self._simulation.state[0]
        scene = simulation.scene
        yield "time", simulation.time, {"dtype": "f8"}
        yield "phase", self._phases.index(phase), {"dtype": "u1"}
        for arm, record in zip(scene.arms, state["arm"], strict=True):
            yield from _motion(arm, record)
        for needle in scene.needles[:1]:
            yield "needle/pose", state["body_pose"][needle.body], {"dtype": "f4"}
            yield "needle/twist", state["body_twist"][needle.body], {"dtype": "f4"}
        for rod in scene.rods[:1]:
            yield "thread/points", state["body_pose"][list(rod.bodies), :3], {"dtype": "f4"}
            yield "thread/tension", state["rod_tension"][list(rod.bodies)], {"dtype": "f4"}
        for tissue in scene.tissues:
            yield from _tissue(scene, tissue, state)
        for name, camera in self._cameras.items():
            yield from self._pictures(name, camera)

    def _pictures(self, name: str, camera: Any) -> Iterator[tuple[str, Any, dict[str, Any]]]:
        """Colour, depth and ids of a camera, each picture compressed alone so that readers take any."""
        picture, packed = camera.capture(self._size), {"compression": "gzip", "compression_opts": 1, "shuffle": True}
        steps = np.where(np.isfinite(picture.depth), picture.depth / DEPTH_UNIT, 0.0)
        yield f"cameras/{name}/rgb", picture.rgb, {"dtype": "u1", **packed}
        yield f"cameras/{name}/depth", np.minimum(steps.round(), 65535.0), {"dtype": "u2", **packed}
        yield f"cameras/{name}/ids", picture.ids, {"dtype": "u2", **packed}
        yield f"cameras/{name}/pose", camera.pose, {"dtype": "f8"}
        yield f"cameras/{name}/intrinsics", camera.view(self._size).intrinsics, {"dtype": "f8"}

    def _append(self, name: str, value: Any, options: dict[str, Any]) -> None:
        """Add a row to a dataset of the episode."""
        assert self._episode is not None
        shape = np.shape(value)
        if name not in self._episode:
            rows = 1 if len(shape) > 1 and "compression" in options else 256
            self._episode.create_dataset(name, (0, *shape), maxshape=(None, *shape), chunks=(rows, *shape), **options)
        data = self._episode[name]
        data.resize(self._samples + 1, axis=0)
        data[self._samples] = value

    # --- the end ----------------------------------------------------------------------------

    def close(self) -> None:
        """End the dataset and give the file its name; a second time does nothing."""
        if self._ended:
            return
        self.end_episode(False)
        with self._writing():
            self._file.close()
            self._disk.close()
        self._part.replace(self._path)
        self._ended = True

    def abandon(self) -> None:
        """Remove what was written."""
        if not self._ended:
            self._ended = True
            with suppress(OSError, RuntimeError, AttributeError):
                self._file.close()
                self._disk.close()
            self._part.unlink(missing_ok=True)

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Reports in one way what may go wrong with a disk, and leaves nothing behind then."""
        try:
            yield
            if self._disk.error is not None:
                raise self._disk.error
        except (OSError, RuntimeError) as error:
            self.abandon()
            raise DatasetError(f"cannot write the dataset '{self._path}': {error}") from error

    def __enter__(self) -> DatasetWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.close()
        else:
            self.abandon()


def _tissue(scene: Scene, tissue: TissueBody, state: Any) -> Iterator[tuple[str, Any, dict[str, Any]]]:
    """Nodes, forces and punctures of a body of tissue, in world axes."""
    names = [scene.bodies[other.body].identity.name for other in scene.tissues]
    own = names[tissue.index] if names.count(names[tissue.index]) == 1 else f"{names[tissue.index]}{tissue.index}"
    single, k = {"dtype": "f4"}, tissue.index
    yield f"tissue/{own}/points", state["tissue_node"][tissue.rows], single
    yield f"tissue/{own}/wrench", state["tissue_wrench"][k], single
    yield f"tissue/{own}/peak_force", state["tissue_peak"][k], single
    yield f"tissue/{own}/puncture_count", state["puncture_count"][k], {"dtype": "i4"}
    yield f"tissue/{own}/puncture_points", state["puncture_point"][k], single
    yield f"tissue/{own}/puncture_normals", state["puncture_normal"][k], single


def _motion(arm: ArmDescription, record: Any) -> Iterator[tuple[str, Any, dict[str, Any]]]:
    """Joints (position, velocity, effort by joint), tip in the arm's base, and jaw of an arm."""
    single, joints = {"dtype": "f4"}, len(arm.joints)
    if not joints:
        return
    for what in ("measured", "setpoint"):
        yield f"arms/{arm.name}/{what}_js", record[f"{what}_js"][:, :joints], single
        yield f"arms/{arm.name}/local_{what}_cp", record[f"local_{what}_cp"], single
        if arm.kind is ArmKind.PSM:
            yield f"arms/{arm.name}/jaw/{what}_js", record[f"jaw_{what}_js"], single
