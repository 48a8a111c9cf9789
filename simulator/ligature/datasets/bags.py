"""An episode of a dataset from a bag: what arms, needle and cameras reported, sampled at a steady rate.

Nothing is simulated: the bag may be of a real robot. A sample has the newest message of each topic. Metres, radians,
newtons; poses in the base of the arm, that of the needle as the bag has it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

import ligature
from ligature.datasets.interrupts import interrupted_once
from ligature.datasets.labels import ACTIVITIES, MOVING, MarkedPhases
from ligature.datasets.rows import EpisodeRows, Packed, add_actions
from ligature.datasets.store import DatasetError, EpisodeStore, unwritable
from ligature.datasets.writer import FORMAT, JOINT_ROWS, POSE, WRENCH
from ligature.ros.bags import BagError
from ligature.ros.tracks import Session, first_stamp, intrinsics, pictures, session

Array = NDArray[np.float64]

SHORTEST = 2
"""Samples of an episode."""


def record_bag(
    bag: Path,
    out: Path,
    rate: float,
    cameras: Sequence[str] | None = None,
    size: tuple[int, int] = (320, 240),
    text: str = "",
    success: bool | None = None,
    why: str = "",
) -> int:
    """Write the dataset ``out`` from a bag; returns the number of its samples.

    Parameters
    ----------
    rate
        Samples a second; simulated ones where the bag has the state of a world.
    cameras
        Names of the cameras to include; by default all of the bag.
    size
        Width and height of pictures, to which those of the bag are scaled.
    text
        What was done, as an instruction.
    success, why
        The outcome; None if it is unknown.

    Raises
    ------
    ligature.ros.bags.BagError
        For a bag that lacks what a dataset needs; ``.left_out`` of its session says why arms are not in it.
    DatasetError
        Where the file cannot be written.
    """
    found = session(bag)
    named = list(found.cameras) if cameras is None else list(cameras)
    for name in named:
        if name not in found.cameras:
            raise BagError(f"{bag}: has no pictures of '{name}', only of {', '.join(found.cameras) or 'none'}")
    marked = MarkedPhases(found.phases)
    topics = {name: found.cameras[name] for name in named}
    stamps, times = _grid(bag, found, rate, list(topics.values()))
    try:
        store = EpisodeStore(out, lambda file: _describe(file, found, marked, rate, text))
    except OSError as error:
        raise unwritable(out, error) from error
    try:
        with interrupted_once():
            episode = store.begin()
            _write_motion(episode, found, marked, stamps, times)
            _write_pictures(episode, store, bag, topics, stamps, size)
            attributes = episode.attrs
            attributes["success"], attributes["judged"] = bool(success), success is not None
            attributes["samples"], attributes["task"], attributes["why"] = len(times), text, why
            add_actions(episode)
            store.finish()
        store.close(empty=False)
    except BaseException as error:
        store.close(empty=False)
        if isinstance(error, OSError | RuntimeError) and not isinstance(error, DatasetError):
            raise unwritable(out, error) from error
        raise
    return len(times)


def _grid(bag: Path, found: Session, rate: float, topics: Sequence[str]) -> tuple[Array, Array]:
    """Stamps of the samples, and their times since the first."""
    begin, end = found.span()
    begin = max([begin, *(first_stamp(bag, topic) for topic in topics)])
    clock = found.clock
    if clock is not None:
        begin, end = max(begin, clock.times[0]), min(end, clock.times[-1])
        first, last = np.interp([begin, end], clock.times, clock.values)
    else:
        first, last = begin, end
    count = int((last - first) * rate + 1e-6) + 1 if end > begin else 0
    if count < SHORTEST:
        raise BagError(
            f"{bag}: arms and cameras report together for less than two samples at {rate:g} a second; "
            "give a higher rate, or a bag in which both report for longer"
        )
    times = np.arange(count) / rate
    return times + first if clock is None else np.interp(times + first, clock.values, clock.times), times


def _describe(file: h5py.File, found: Session, marked: MarkedPhases, rate: float, text: str) -> None:
    attributes = file.attrs
    attributes["format"], attributes["version"] = FORMAT, ligature.__version__
    attributes["scene"], attributes["rate"], attributes["task"] = "", rate, text
    attributes["phases"], attributes["activities"] = ["", *marked.names], list(ACTIVITIES[:2])
    attributes["gestures"] = ["", *(marked.gestures.get(phase, "") for phase in marked.names)]
    attributes["source"], attributes["recorded"] = "bag", True
    for name, arm in found.arms.items():
        about = file.create_group(f"arms/{name}").attrs
        about["kind"], about["tool"], about["joint_names"] = "psm", "", list(arm.joints)
        about["joint_units"] = ["m" if "insertion" in joint else "rad" for joint in arm.joints]


def _write_motion(episode: h5py.File, found: Session, marked: MarkedPhases, stamps: Array, times: Array) -> None:
    """What is sampled of arms and needle."""

    def add(name: str, values: Any, dtype: str, **notes: str) -> None:
        episode.create_dataset(name, data=values, dtype=dtype).attrs.update(notes)

    add("time", times, "f8", units="s")
    numbers = {phase: number for number, phase in enumerate(("", *marked.names))}
    phases = [numbers[marked.at(stamp)] for stamp in stamps]
    add("phase", phases, "u1")
    for name, arm in found.arms.items():
        for what, track in arm.tracks.items():
            joints, pose = what.endswith("_js"), what.endswith("_cp")
            units = "rad, m" if joints else "m" if pose else "N, N m"
            values = track.at(stamps)
            if what.startswith("jaw/"):
                values, units = values[:, :, 0], "rad"
            add(
                f"arms/{name}/{what}",
                values,
                "f4",
                units=units,
                axes=JOINT_ROWS if joints else POSE if pose else WRENCH,
            )
        add(f"arms/{name}/phase", phases, "u1")
        add(f"arms/{name}/activity", _moves(arm.tracks["local_measured_cp"].at(stamps)[:, :3], times), "u1")
    if found.needle is not None:
        add("needle/pose", found.needle.at(stamps), "f4", units="m", axes=POSE)


def _write_pictures(
    episode: h5py.File, store: EpisodeStore, bag: Path, topics: Mapping[str, str], stamps: Array, size: tuple[int, int]
) -> None:
    """The newest picture of each camera at the ``stamps``; ``topics`` are those of the cameras, by their names."""
    rows = EpisodeRows(episode)
    for name, topic in topics.items():
        K = intrinsics(bag, topic, size)
        for picture in pictures(bag, topic, stamps.tolist(), size):
            rows.append_picture(f"cameras/{name}/rgb", Packed.of(picture))
            store.check()
            if K is not None:
                rows.append(f"cameras/{name}/intrinsics", K, "f8", units="px")
    rows.finish()


def _moves(places: Array, times: Array) -> NDArray[np.bool_]:
    """Whether a tip moves, for each of its places (n, 3)."""
    return np.linalg.norm(np.gradient(places, times, axis=0), axis=1) > MOVING
