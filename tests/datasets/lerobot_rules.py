"""The rules of LeRobot's formats v2.1 and v3.0, and of Open-H's validator, written anew from their readers.

Sources: `lerobot.datasets` of the releases 0.3.3 (v2.1) and 0.4 (v3.0), and `validate_formatting.py` of Open-H. Nothing
of the exporter is used here: files are read by pyarrow, PyAV and json alone. Each function returns what is broken.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import av
import numpy as np
import pyarrow.parquet as pq

COUNTERS = {
    "timestamp": "float32",
    "frame_index": "int64",
    "episode_index": "int64",
    "index": "int64",
    "task_index": "int64",
}
ARROW = {"float32": "float", "int64": "int64", "bool": "bool", "string": "string", "float64": "double"}
TOLERANCE = 1e-4
"""Seconds by which LeRobot lets a timestamp differ from that of a picture."""


def broken(root: Path) -> list[str]:
    """Every rule of the dataset's own version that it breaks."""
    info = json.loads((root / "meta/info.json").read_text())
    rules = _Rules(root, info)
    return list(rules.check())


class _Rules:
    def __init__(self, root: Path, info: dict[str, Any]) -> None:
        self.root, self.info, self.features = root, info, info["features"]
        self.new = info["codebase_version"] == "v3.0"
        self.videos = [name for name, each in self.features.items() if each["dtype"] == "video"]

    def check(self) -> Iterator[str]:
        yield from self.check_info()
        episodes = self.episodes()
        yield from self.check_episodes(episodes)
        tasks = self.tasks()
        yield from self.check_tasks(tasks, episodes)
        yield from self.check_rows(episodes, tasks)
        yield from self.check_videos(episodes)
        yield from self.check_stats(episodes)

    # --- info.json ------------------------------------------------------------------------------

    def check_info(self) -> Iterator[str]:
        info = self.info
        wanted = [
            "codebase_version",
            "robot_type",
            "total_episodes",
            "total_frames",
            "total_tasks",
            "chunks_size",
            "fps",
        ]
        wanted += ["splits", "data_path", "video_path", "features"]
        wanted += ["data_files_size_in_mb", "video_files_size_in_mb"] if self.new else ["total_videos", "total_chunks"]
        for key in wanted:
            if key not in info:
                yield f"info.json lacks {key}"
        if info["codebase_version"] not in ("v2.1", "v3.0"):
            yield f"version {info['codebase_version']}"
        if not isinstance(info["fps"], int) or info["fps"] <= 0:
            yield f"fps is {info['fps']}"
        for name, each in self.features.items():
            if "/" in name:
                yield f"the name of feature {name} has a slash"
            if not {"dtype", "shape", "names"} <= set(each):
                yield f"feature {name} lacks dtype, shape or names"
            elif each["dtype"] == "video":
                if len(each["shape"]) != 3 or "info" not in each:
                    yield f"video {name} lacks its shape or info"
            elif each["dtype"] not in ARROW:
                yield f"feature {name} has the type {each['dtype']}"
            elif each["names"] is not None and len(each["names"]) != each["shape"][0]:
                yield f"feature {name} has {len(each['names'])} names for {each['shape']}"
        for name, kind in COUNTERS.items():
            if self.features.get(name, {}).get("dtype") != kind or self.features[name]["shape"] != [1]:
                yield f"counter {name} is missing or no {kind} of shape [1]"
        yield from self.check_splits()

    def check_splits(self) -> Iterator[str]:
        covered: list[int] = []
        for name, text in self.info["splits"].items():
            if not re.fullmatch(r"\d+:\d+", text):
                yield f"split {name} is {text}"
                continue
            covered += range(*map(int, text.split(":")))
        if sorted(covered) != list(range(self.info["total_episodes"])):
            yield f"splits cover {sorted(covered)} of {self.info['total_episodes']} episodes"

    # --- episodes and tasks ---------------------------------------------------------------------

    def lines(self, name: str) -> list[dict[str, Any]]:
        return [json.loads(line) for line in (self.root / "meta" / name).read_text().splitlines()]

    def episodes(self) -> list[dict[str, Any]]:
        if not self.new:
            return self.lines("episodes.jsonl")
        paths = sorted((self.root / "meta/episodes").glob("*/*.parquet"))
        rows = [row for path in paths for row in pq.read_table(path).to_pylist()]
        return sorted(rows, key=lambda row: row["episode_index"])

    def check_episodes(self, episodes: list[dict[str, Any]]) -> Iterator[str]:
        if [row["episode_index"] for row in episodes] != list(range(self.info["total_episodes"])):
            yield "episodes are not numbered from 0 to total_episodes"
        if sum(row["length"] for row in episodes) != self.info["total_frames"]:
            yield "lengths of episodes do not add up to total_frames"
        at = 0
        for row in episodes if self.new else ():
            if (row["dataset_from_index"], row["dataset_to_index"]) != (at, at + row["length"]):
                yield f"episode {row['episode_index']} has the wrong range of indices"
            at += row["length"]
            for key in ("meta/episodes/chunk_index", "meta/episodes/file_index", "data/chunk_index", "data/file_index"):
                if not isinstance(row.get(key), int):
                    yield f"episode {row['episode_index']} lacks {key}"
        for row in episodes:
            if not row["tasks"] or not all(isinstance(task, str) and task for task in row["tasks"]):
                yield f"episode {row['episode_index']} has no task in words"

    def tasks(self) -> dict[int, str]:
        if not self.new:
            return {row["task_index"]: row["task"] for row in self.lines("tasks.jsonl")}
        table = pq.read_table(self.root / "meta/tasks.parquet")
        notes = json.loads(table.schema.metadata[b"pandas"])
        assert notes["index_columns"] == ["task"], "LeRobot reads the text of a task from the index of pandas"
        return dict(zip(table["task_index"].to_pylist(), table["task"].to_pylist(), strict=True))

    def check_tasks(self, tasks: dict[int, str], episodes: list[dict[str, Any]]) -> Iterator[str]:
        if sorted(tasks) != list(range(self.info["total_tasks"])):
            yield "tasks are not numbered from 0 to total_tasks"
        if {task for row in episodes for task in row["tasks"]} != set(tasks.values()):
            yield "episodes have other tasks than the table of tasks"

    # --- rows -----------------------------------------------------------------------------------

    def data_file(self, row: dict[str, Any]) -> Path:
        if self.new:
            at = {"chunk_index": row["data/chunk_index"], "file_index": row["data/file_index"]}
        else:
            at = {
                "episode_chunk": row["episode_index"] // self.info["chunks_size"],
                "episode_index": row["episode_index"],
            }
        return self.root / self.info["data_path"].format(**at)

    def check_rows(self, episodes: list[dict[str, Any]], tasks: dict[int, str]) -> Iterator[str]:
        stored = [name for name in self.features if name not in self.videos]
        at = 0
        for episode in episodes:
            number, path = episode["episode_index"], self.data_file(episode)
            if not path.is_file():
                yield f"{path} is missing"
                continue
            table = pq.read_table(path)
            if sorted(table.column_names) != sorted(stored):
                yield f"{path.name} has other columns than info.json: {set(table.column_names) ^ set(stored)}"
                continue
            for name in stored:
                yield from self.check_type(name, table.schema.field(name).type)
            rows = table.filter(np.array(table["episode_index"]) == number)
            if len(rows) != episode["length"]:
                yield f"episode {number} has {len(rows)} rows, not {episode['length']}"
                continue
            n = np.arange(len(rows))
            if (np.array(rows["index"]) != at + n).any() or (np.array(rows["frame_index"]) != n).any():
                yield f"episode {number} has wrong indices"
            if np.abs(np.array(rows["timestamp"], float) - n / self.info["fps"]).max() > TOLERANCE:
                yield f"episode {number} has timestamps beside the grid"
            if {tasks.get(k) for k in set(rows["task_index"].to_pylist())} - set(episode["tasks"]):
                yield f"episode {number} has rows of other tasks"
            for name in stored:
                if self.features[name]["dtype"] != "string" and not np.isfinite(_numbers(rows, name)).all():
                    yield f"episode {number} has {name} that are no numbers"
            at += len(rows)

    def check_type(self, name: str, kind: Any) -> Iterator[str]:
        each = self.features[name]
        wanted = ARROW[each["dtype"]]
        if each["shape"] != [1]:
            wanted = f"fixed_size_list<element: {wanted}>[{each['shape'][0]}]"
        if str(kind).replace("item:", "element:") != wanted:
            yield f"column {name} is {kind}, not {wanted}"

    # --- videos ---------------------------------------------------------------------------------

    def video(self, row: dict[str, Any], key: str) -> tuple[Path, float, float]:
        length = row["length"] / self.info["fps"]
        if not self.new:
            at = {
                "episode_chunk": row["episode_index"] // self.info["chunks_size"],
                "episode_index": row["episode_index"],
            }
            return self.root / self.info["video_path"].format(video_key=key, **at), 0.0, length
        at = {name: row[f"videos/{key}/{name}"] for name in ("chunk_index", "file_index")}
        path = self.root / self.info["video_path"].format(video_key=key, **at)
        return path, row[f"videos/{key}/from_timestamp"], row[f"videos/{key}/to_timestamp"]

    def check_videos(self, episodes: list[dict[str, Any]]) -> Iterator[str]:
        if not self.new and self.info["total_videos"] != len(self.videos) * len(episodes):
            yield f"total_videos is {self.info['total_videos']}"
        for key in self.videos:
            for row in episodes:
                path, begin, end = self.video(row, key)
                if not path.is_file():
                    yield f"{path} is missing"
                    continue
                if abs(end - begin - row["length"] / self.info["fps"]) > 1e-9:
                    yield f"{path} lasts {end - begin} s"
                yield from self.check_video(path, key, row["length"], begin)

    def check_video(self, path: Path, key: str, length: int, begin: float) -> Iterator[str]:
        noted = self.features[key]["info"]
        with av.open(str(path)) as container:
            stream = container.streams.video[0]
            times = [float(frame.pts * stream.time_base) for frame in container.decode(stream)]
            height, width = self.features[key]["shape"][:2]
            if (stream.height, stream.width) != (height, width):
                yield f"{path} is {stream.width}x{stream.height}, not {width}x{height}"
            if float(stream.average_rate) != self.info["fps"] or noted["video.fps"] != self.info["fps"]:
                yield f"{path} has {stream.average_rate} pictures a second"
            if noted["video.pix_fmt"] != stream.codec_context.pix_fmt:
                yield f"{path} has pixels {stream.codec_context.pix_fmt}"
            if noted["video.codec"] not in (stream.codec_context.codec.canonical_name, stream.codec_context.name):
                yield f"{path} is {stream.codec_context.name}"
        wanted = begin + np.arange(length) / self.info["fps"]
        if len(times) < length or np.abs(np.array(times[:length]) - wanted).max() > TOLERANCE:
            yield f"{path} has {len(times)} pictures beside the grid of {length}"

    # --- statistics -----------------------------------------------------------------------------

    def check_stats(self, episodes: list[dict[str, Any]]) -> Iterator[str]:
        counted = [name for name, each in self.features.items() if each["dtype"] != "string"]
        total = json.loads((self.root / "meta/stats.json").read_text())
        if set(total) != set(counted):
            yield f"stats.json lacks or has too many: {set(total) ^ set(counted)}"
        rows = {name: [] for name in counted if name not in self.videos}
        for number, (episode, stats) in enumerate(zip(episodes, self.stats_of(episodes), strict=True)):
            table = pq.read_table(self.data_file(episode))
            table = table.filter(np.array(table["episode_index"]) == number)
            for name in counted:
                shape = (3, 1, 1) if name in self.videos else tuple(self.features[name]["shape"])
                yield from self.check_shape(f"episode {number}: {name}", stats[name], shape)
                if name not in self.videos:
                    numbers = _numbers(table, name)
                    rows[name].append(numbers)
                    yield from _check_values(f"episode {number}: {name}", stats[name], numbers)
        for name, parts in rows.items():
            yield from _check_values(name, total[name], np.concatenate(parts))

    def stats_of(self, episodes: list[dict[str, Any]]) -> list[dict[str, dict[str, Any]]]:
        if not self.new:
            return [row["stats"] for row in self.lines("episodes_stats.jsonl")]
        found = []
        for row in episodes:
            stats: dict[str, dict[str, Any]] = {}
            for key, value in row.items():
                if key.startswith("stats/"):
                    name, what = key.removeprefix("stats/").rsplit("/", 1)
                    stats.setdefault(name, {})[what] = value
            found.append(stats)
        return found

    def check_shape(self, what: str, stats: dict[str, Any], shape: tuple[int, ...]) -> Iterator[str]:
        for name in ("min", "max", "mean", "std", "count", *(("q01", "q10", "q50", "q90", "q99") if self.new else ())):
            wanted = (1,) if name == "count" else shape
            if name not in stats or np.shape(stats[name]) != wanted:
                yield f"{what} has no {name} of the shape {wanted}"
        if shape == (3, 1, 1) and not 0.0 <= np.min(stats["min"]) <= np.max(stats["max"]) <= 1.0:
            yield f"{what} is not between 0 and 1"


def _numbers(table: Any, name: str) -> np.ndarray:
    values = np.array(table[name].to_pylist(), dtype=float)
    return values[:, None] if values.ndim == 1 else values


def _check_values(what: str, stats: dict[str, Any], numbers: np.ndarray) -> Iterator[str]:
    for name, found in (
        ("min", numbers.min(0)), ("max", numbers.max(0)), ("mean", numbers.mean(0)), ("std", numbers.std(0)),
        ("count", [len(numbers)]),
    ):  # fmt: skip
        if not np.allclose(stats[name], found, rtol=1e-4, atol=1e-6):
            yield f"{what}: {name} is {stats[name]}, not {found}"


# --- Open-H ---------------------------------------------------------------------------------------


def broken_for_open_h(root: Path) -> list[str]:
    """Errors and warnings of Open-H's validator, rule for rule, but for loading the dataset by LeRobot."""
    return list(_open_h(root))


def _open_h(root: Path) -> Iterator[str]:
    meta = root / "meta"
    for name in ("videos", "meta", "data"):
        if not (root / name).is_dir():
            yield f"folder {name} is missing"
    if not list(root.glob("data/chunk-*/episode_*.parquet")):
        yield "no data/chunk-*/episode_*.parquet"
    for name in ("info.json", "episodes_stats.jsonl", "tasks.jsonl", "episodes.jsonl", "README.md"):
        if not (meta / name).is_file():
            yield f"meta/{name} is missing"
            return
    info = json.loads((meta / "info.json").read_text())
    if info["fps"] < 20:
        yield f"fps {info['fps']} is below 20"
    for key in ("robot_type", "splits"):
        if key not in info:
            yield f"info.json lacks {key}"
    for split in ("train", "val", "test"):
        if split not in info["splits"]:
            yield f"split {split} is missing"
    for name in ("action", "observation.state"):
        if name not in info["features"]:
            yield f"feature {name} is missing"
    images = {name: each for name, each in info["features"].items() if name.startswith("observation.images.")}
    if not images:
        yield "no observation.images.*"
    for name, each in images.items():
        if min(each["shape"][:2]) < 480:
            yield f"{name} is smaller than 480 pixels"
    for path in sorted(root.glob("videos/**/*.mp4"))[:3]:
        with av.open(str(path)) as container:
            stream = container.streams.video[0]
            if float(stream.average_rate) < 20 or stream.height < 480 or not stream.frames:
                yield f"{path} is too small, too slow or empty"
    if not list(root.glob("videos/**/*.mp4")):
        yield "no videos"
    episodes = [json.loads(line) for line in (meta / "episodes.jsonl").read_text().splitlines()]
    if not episodes or not any(row.get("tasks") for row in episodes):
        yield "no episodes, or none with a task"
    text = (meta / "README.md").read_text().lower()
    if "synchron" not in text and "timestamp" not in text:
        yield "the README does not document synchronisation"
