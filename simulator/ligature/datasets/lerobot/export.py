"""Turns an HDF5 dataset into one of LeRobot: v3.0, which LeRobot reads since 0.4, or v2.1, which Open-H asks for.

The formats are those of LeRobot's own reader and writer (`lerobot.datasets`, releases 0.3.3 and 0.4). Each camera and
episode has a video of its own in both. The folder gets its name when it is whole.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from ligature.datasets.events import listed
from ligature.datasets.lerobot import statistics
from ligature.datasets.lerobot.card import card
from ligature.datasets.lerobot.features import Column, columns, types_of_extras
from ligature.datasets.lerobot.fit import check, left_out
from ligature.datasets.lerobot.tables import GrowingTables, json_of, table_of, write_lines, write_rows, write_tasks
from ligature.datasets.lerobot.video import CODECS, Codec, description, encode
from ligature.datasets.quality import EXACT, pace
from ligature.datasets.soundness import episode_names
from ligature.datasets.store import DatasetError, opened
from ligature.paths import printable, reason

FORMATS = ("lerobot-3.0", "lerobot-2.1")
CHUNK, DATA_MEGABYTES, VIDEO_MEGABYTES = 1000, 100, 200
"""Files of a folder, and most megabytes of a file, as LeRobot's own writer has them."""

SHARES = (0.8, 0.1)
"""Shares of the successful episodes that are for training and for validation; the rest is for testing."""

ALWAYS = ("observation.state", "action", "next.done", "next.success")
"""Features that an export has even where they never change."""

Log = Callable[[str], object]


@dataclass
class _Written:
    """Totals, tasks and statistics of the episodes written so far."""

    episodes: list[dict[str, Any]] = field(default_factory=list)
    stats: list[dict[str, statistics.Statistics]] = field(default_factory=list)
    numbers: dict[str, list[NDArray[Any]]] = field(default_factory=dict)
    tasks: list[str] = field(default_factory=list)
    features: dict[str, dict[str, Any]] = field(default_factory=dict)
    events: list[dict[str, Any]] = field(default_factory=list)
    frames: int = 0

    def task(self, text: str) -> int:
        """The number of a task."""
        if text not in self.tasks:
            self.tasks.append(text)
        return self.tasks.index(text)


def export(
    source: str | Path,
    target: str | Path,
    format: str,
    codec: str = "h264",
    license: str = "",
    log: Log = print,
    bad: Mapping[str, str] | None = None,
) -> None:
    """Write the dataset ``source`` as the folder ``target``, which must not exist.

    Episodes that cannot be read, and those of fewer than two samples, are left out.

    Parameters
    ----------
    format
        One of `FORMATS`.
    codec
        Of the videos, one of `ligature.datasets.lerobot.video.CODECS`.
    license
        Of the data, for the card; an identifier of the Hugging Face Hub such as ``cc-by-4.0``.
    log
        Takes a line for each episode, also for one that is left out.
    bad
        Episodes that are known not to be readable, with the reasons.

    Raises
    ------
    DatasetError
        For a dataset that cannot be read, or that the format cannot hold.
    ValueError
        For an unknown format or codec, and for a license that is not a line of text.
    """
    for what, value, known in (("format", format, FORMATS), ("codec", codec, tuple(CODECS))):
        if value not in known:
            raise ValueError(f"{what} must be one of {', '.join(known)}, not '{value}'")
    if not license.isprintable():
        raise ValueError(f"license is {license!r}; it must be a line of printable text, such as cc-by-4.0")
    source, target, unread = Path(source), Path(target), dict(bad or {})
    if target.exists():
        raise DatasetError(f"'{target}' exists already; choose another name")
    part = target.with_name(f"{target.name}.part")
    with opened(source, unread) as file:
        out = left_out(file, unread)
        check(file, source, out)
        for name, why in out.items():
            log(f"{printable(name)} is left out: {why}")
        try:
            part.mkdir(parents=True)
        except FileExistsError:
            raise DatasetError(
                f"'{part}' belongs to an export that is still running or was killed; delete it or choose another name"
            ) from None
        except OSError as error:
            raise DatasetError(f"cannot write '{target}': {reason(error)}") from error
        try:
            _Export(file, episode_names(file, out), part, format, CODECS[codec], license, log).run()
            part.replace(target)
        except OSError as error:
            raise DatasetError(f"cannot write '{target}': {reason(error)}") from error
        finally:
            shutil.rmtree(part, ignore_errors=True)


class _Export:
    """One export of the episodes ``names`` into the folder ``root``."""

    def __init__(
        self, file: h5py.File, names: Sequence[str], root: Path, format: str, codec: Codec, license: str, log: Log
    ) -> None:
        self._file, self._root, self._codec, self._license, self._log = file, root, codec, license, log
        self._names, self._splits = _in_splits(file, names)
        self._types = types_of_extras([file[name] for name in names])
        self._new, self._fps = format == "lerobot-3.0", round(float(file.attrs["rate"]))
        self._written = _Written()
        self._tables = GrowingTables(self._data_path, DATA_MEGABYTES << 20 if self._new else 0)

    # --- where files are --------------------------------------------------------------------

    def _data_path(self, number: int) -> Path:
        name = f"file-{number % CHUNK:03d}" if self._new else f"episode_{number:06d}"
        return self._root / f"data/chunk-{number // CHUNK:03d}/{name}.parquet"

    def _video_path(self, key: str, episode: int) -> Path:
        chunk = f"chunk-{episode // CHUNK:03d}"
        if self._new:
            return self._root / f"videos/{key}/{chunk}/file-{episode % CHUNK:03d}.mp4"
        return self._root / f"videos/{chunk}/{key}/episode_{episode:06d}.mp4"

    # --- the work ---------------------------------------------------------------------------

    def run(self) -> None:
        """Write everything."""
        self._constant = self._find_constant(self._names)
        for number, name in enumerate(self._names):
            self._add(number, name)
            off = pace(self._file[name]["time"][:], self._fps).off
            late = f", up to {1e3 * off:.3g} ms off the rate" if off > EXACT else ""
            self._log(f"{name}: {self._written.episodes[-1]['length']} samples{late}")
        self._tables.close()
        meta = self._root / "meta"
        meta.mkdir(exist_ok=True)
        info = self._info(self._splits)
        (meta / "info.json").write_text(json_of(info, 4), encoding="utf-8")
        (meta / "calibration.json").write_text(json_of(self._calibration(), 1), encoding="utf-8")
        write_lines(meta / "events.jsonl", self._written.events)
        self._write_meta(meta)
        text = card(self._file, info, self._names, self._constant, self._license)
        (self._root / "README.md").write_text(text, encoding="utf-8")
        if not self._new:
            (meta / "README.md").write_text(text, encoding="utf-8")

    def _columns(self, episode: h5py.Group) -> Iterator[Column]:
        return columns(self._file, episode, not self._new, self._types)

    def _find_constant(self, names: Sequence[str]) -> list[str]:
        """Features that are constant over all samples: they carry no information and have no scale to normalise by."""
        seen: dict[str, list[NDArray[Any]]] = {}
        for name in names:
            for column in self._columns(self._file[name]):
                if column.dtype != "string" and column.name not in ALWAYS:
                    ends = [column.values.min(axis=0), column.values.max(axis=0)]
                    seen[column.name] = [*seen.get(column.name, []), *ends]
        return [name for name, ends in seen.items() if all((end == ends[0]).all() for end in ends)]

    def _add(self, number: int, name: str) -> None:
        """Write one episode: rows, videos and statistics."""
        written, episode = self._written, self._file[name]
        found = [c for c in self._columns(episode) if c.name not in self._constant]
        length = int(episode.attrs["samples"])
        task = str(episode.attrs["task"]) or "do what the recording shows"
        counters = {
            "timestamp": (np.arange(length) / self._fps).astype(np.float32), "frame_index": np.arange(length),
            "episode_index": np.full(length, number), "index": written.frames + np.arange(length),
            "task_index": np.full(length, written.task(task)),
        }  # fmt: skip
        data_file = self._tables.add(table_of(found, counters))
        stats = {c.name: statistics.of_numbers(c.values, self._new) for c in found if c.dtype != "string"}
        stats |= {key: statistics.of_numbers(values[:, None], self._new) for key, values in counters.items()}
        row: dict[str, Any] = {"episode_index": number, "tasks": [task], "length": length}
        place: dict[str, Any] = {
            "data/chunk_index": data_file // CHUNK, "data/file_index": data_file % CHUNK,
            "dataset_from_index": written.frames, "dataset_to_index": written.frames + length,
        }  # fmt: skip
        for column in found:
            written.numbers.setdefault(column.name, []).append(column.values)
        for key, values in counters.items():
            written.numbers.setdefault(key, []).append(values[:, None])
        self._describe(found, counters)
        written.events += [
            {"episode_index": number, "frame_index": k, "timestamp": k / self._fps, "event": event, "of": who}
            for k, event, who in listed(episode)
        ]
        for camera in sorted(episode.get("cameras", {})):
            key = f"observation.images.{camera}"
            stats[key] = self._add_video(key, number, episode[f"cameras/{camera}/rgb"])
            place |= {
                f"videos/{key}/chunk_index": number // CHUNK, f"videos/{key}/file_index": number % CHUNK,
                f"videos/{key}/from_timestamp": 0.0, f"videos/{key}/to_timestamp": length / self._fps,
            }  # fmt: skip
        if self._new:
            row |= place
            row |= {f"stats/{key}/{what}": value for key, each in stats.items() for what, value in each.items()}
            row |= {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0}
        written.episodes.append(row)
        written.stats.append(stats)
        written.frames += length

    def _describe(self, found: Sequence[Column], counters: Mapping[str, NDArray[Any]]) -> None:
        features = {c.name: {"dtype": c.dtype, "shape": [c.values.shape[1]], "names": list(c.names)} for c in found} | {
            name: {"dtype": str(values.dtype), "shape": [1], "names": None} for name, values in counters.items()
        }
        known = {key: value for key, value in self._written.features.items() if value["dtype"] != "video"}
        if known and known != features:
            other = sorted(known.keys() ^ features.keys() or {key for key in known if known[key] != features[key]})
            raise DatasetError(
                f"the episodes differ in {', '.join(other)}; all episodes of a LeRobot dataset must have the same "
                "features: record them in one scene, with the same arms and cameras"
            )
        self._written.features |= features

    def _add_video(self, key: str, number: int, pictures: h5py.Dataset) -> statistics.Statistics:
        """Encode the pictures (n, h, w, 3) of an episode; returns their statistics."""
        size = (pictures.shape[2], pictures.shape[1])
        looked_at, pixels = set(statistics.chosen(len(pictures)).tolist()), list[NDArray[np.uint8]]()

        def each() -> Iterator[NDArray[np.uint8]]:
            for k in range(len(pictures)):
                picture = pictures[k]
                if k in looked_at:
                    pixels.append(statistics.thinned(picture).reshape(-1, 3))
                yield picture

        encode(self._video_path(key, number), each(), size, self._fps, self._codec)
        self._written.features[key] = {
            "dtype": "video", "shape": [size[1], size[0], 3], "names": ["height", "width", "channels"],
            "info": description(size, self._fps, self._codec),
        }  # fmt: skip
        return statistics.of_pictures(np.concatenate(pixels), len(pixels), self._new)

    # --- what holds for all -----------------------------------------------------------------

    def _info(self, splits: Mapping[str, str]) -> dict[str, Any]:
        written, new = self._written, self._new
        videos = sum(each["dtype"] == "video" for each in written.features.values())
        info: dict[str, Any] = {
            "codebase_version": "v3.0" if new else "v2.1", "robot_type": "dvrk",
            "total_episodes": len(written.episodes), "total_frames": written.frames, "total_tasks": len(written.tasks),
        }  # fmt: skip
        if new:
            info |= {"data_files_size_in_mb": DATA_MEGABYTES, "video_files_size_in_mb": VIDEO_MEGABYTES}
            data, video = "data/chunk-{chunk_index:03d}/file-{file_index:03d}", "{video_key}/chunk-{chunk_index:03d}"
            paths = {"data_path": f"{data}.parquet", "video_path": f"videos/{video}/file-{{file_index:03d}}.mp4"}
        else:
            info |= {
                "total_videos": videos * len(written.episodes), "total_chunks": -(-len(written.episodes) // CHUNK),
                "tolerance_s": 1e-4,
            }  # fmt: skip
            place = "chunk-{episode_chunk:03d}"
            paths = {
                "data_path": f"data/{place}/episode_{{episode_index:06d}}.parquet",
                "video_path": f"videos/{place}/{{video_key}}/episode_{{episode_index:06d}}.mp4",
            }
        if not videos:
            paths["video_path"] = None  # type: ignore[assignment]
        return info | {
            "chunks_size": CHUNK, "fps": self._fps, "splits": dict(splits), **paths, "features": written.features,
        }  # fmt: skip

    def _write_meta(self, meta: Path) -> None:
        written = self._written
        if self._new:
            write_tasks(meta / "tasks.parquet", written.tasks)
            write_rows(meta / "episodes/chunk-000/file-000.parquet", written.episodes)
        else:
            write_lines(meta / "tasks.jsonl", [{"task_index": k, "task": text} for k, text in enumerate(written.tasks)])
            write_lines(meta / "episodes.jsonl", written.episodes)
            numbered = enumerate(written.stats)
            write_lines(meta / "episodes_stats.jsonl", [{"episode_index": k, "stats": each} for k, each in numbered])
        (meta / "stats.json").write_text(json_of(self._all_stats(), 1), encoding="utf-8")

    def _all_stats(self) -> dict[str, statistics.Statistics]:
        """Statistics of all features: of numbers over all samples, of pictures combined from those of the episodes."""
        written, found = self._written, dict[str, statistics.Statistics]()
        for key, feature in written.features.items():
            if feature["dtype"] == "video":
                found[key] = statistics.joined([each[key] for each in written.stats])
            elif feature["dtype"] != "string":
                found[key] = statistics.of_numbers(np.concatenate(written.numbers[key]), self._new)
        return found

    def _calibration(self) -> dict[str, Any]:
        """Cameras of each episode (pose where it begins, pinhole matrix), and where the arms stand, in the world."""
        arms = {
            name: {
                "base_pose": np.asarray(arm.attrs["base_pose"]).tolist() if "base_pose" in arm.attrs else None,
                "joint_names": list(map(str, arm.attrs["joint_names"])),
                "joint_units": list(map(str, arm.attrs["joint_units"])), "tool": str(arm.attrs["tool"]),
            }
            for name, arm in self._file["arms"].items()
        }  # fmt: skip
        cameras = [
            {
                name: {key: camera[key][0].tolist() if key in camera else None for key in ("pose", "intrinsics")}
                for name, camera in self._file[episode].get("cameras", {}).items()
            }
            for episode in self._names
        ]
        return {"poses": "x y z qx qy qz qw in world axes, metres", "arms": arms, "episodes": cameras}


def _in_splits(file: h5py.File, names: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """Names of the episodes in the order in which they are written, and the ranges that the splits are.

    Successes come first, for training, validation and testing, then failures, then what nothing judged.
    """
    judged = {name: bool(file[name].attrs.get("judged", True)) for name in names}
    done = [name for name in names if judged[name] and file[name].attrs["success"]]
    failed = [name for name in names if judged[name] and not file[name].attrs["success"]]
    unknown = [name for name in names if not judged[name]]
    n = len(done)
    train = min(round(SHARES[0] * n), n - min(n - 1, 2)) if n else 0
    val = min(train + max(1, round(SHARES[1] * n)), n)
    ends = {"train": (0, train), "val": (train, val), "test": (val, n)}
    splits = {name: f"{a}:{b}" for name, (a, b) in ends.items()}
    if failed:
        splits["failure"] = f"{n}:{n + len(failed)}"
    if unknown:
        splits["unjudged"] = f"{n + len(failed)}:{len(names)}"
    return [*done, *failed, *unknown], splits
