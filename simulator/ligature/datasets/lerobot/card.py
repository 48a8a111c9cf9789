"""The card of an exported dataset: what it holds, in which units, how it was made, and what it is not."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import h5py
import yaml

from ligature.datasets.lerobot.features import EXTRA
from ligature.datasets.quality import pace

MEANING: Mapping[str, str] = {
    "observation.state": "measured joints, the jaw after those of its arm (rad, m)",
    "observation.setpoint": "joint set-points at the time of the sample (rad, m)",
    "observation.velocity": "measured joint velocities (rad/s, m/s)",
    "observation.effort": "joint efforts (N m, N)",
    "observation.cartesian": "measured pose of the tool's tip in the base of its arm (m, quaternion)",
    "observation.meta.force_torque": "wrench that the world exerts on the tip, in axes of the arm's base (N, N m)",
    "observation.meta.jaw_force": "force that presses the fingers together on what they hold (N)",
    "observation.meta.sim_time": "seconds since the episode began, simulated ones in a simulation",
    "observation.meta.tool": "instruments of the arms",
    "instruction.text": "the task and its phase, in words",
    "observation.environment_state": "the observation of the learning environment, as its class documents it",
    "extra.expert_action": "the action of the learning environment's expert for this observation",
    "action": "joint set-points of the next sample, absolute (rad, m)",
    "delta_action": "the same less the set-points of this sample",
    "cartesian_action": "the same as poses of the tip in the base of its arm (m, quaternion), and the jaw (rad)",
    "cartesian_delta_action": "step to it: along the base's axes (m), rotation vector about the tip's (rad)",
    "ground_truth.needle_pose": "pose of the needle in the world (m, quaternion)",
    "ground_truth.needle_twist": "twist of the needle in the world (m/s, rad/s)",
    "ground_truth.needle_force": "force of the tissue on the needle in the world (N)",
    "ground_truth.thread_points": "nodes of the thread in the world (m)",
    "ground_truth.thread_tension": "tension along the thread (N)",
    "label.phase": "phase of the work, by its number below",
    "label.arm_phase": "the same for each arm, 0 where it has no part in it",
    "label.arm_activity": "what each arm does by the ground truth, by its number below",
    "next.done": "the episode ends with this sample",
    "timestamp": "counter of LeRobot: number of the sample over the rate (s)",
    "frame_index": "counter of LeRobot: number of the sample in its episode",
    "episode_index": "counter of LeRobot: number of the episode",
    "index": "counter of LeRobot: number of the sample in the dataset",
    "task_index": "counter of LeRobot: number of the task",
    "next.success": "it ends with this sample, and is a success",
}


def card(
    file: h5py.File, info: Mapping[str, Any], episodes: Sequence[str], constant: Sequence[str], license: str
) -> str:
    """The card in Markdown, with the front matter of the Hugging Face Hub; ``constant`` features are left out."""
    attributes, origin = file.attrs, _origin(file)
    hours = info["total_frames"] / info["fps"] / 3600.0
    jitter = max(pace(file[name]["time"][:], info["fps"]).off for name in episodes)
    tasks = sorted({str(file[name].attrs["task"]) for name in episodes})
    done = sum(bool(file[name].attrs["success"]) for name in episodes)
    lines = [
        "---", *_front_matter(license or "unknown"), "---", "",
        f"# {origin.title}", "",
        f"Made with Ligature {attributes['version']} {origin.place}; format LeRobot {info['codebase_version']}.", "",
        "| | |", "|---|---|", f"| episodes | {info['total_episodes']}, {done} of them successful |",
        f"| frames | {info['total_frames']} at {info['fps']} Hz, {hours:.2f} h |", f"| data type | {origin.kind} |",
        f"| collected by | {_cell(attributes.get('source', 'unknown'))} |",
        f"| licence | {_cell(license or 'unknown')} |",
        f"| splits (episodes from:to) | {', '.join(f'{name} {ends}' for name, ends in info['splits'].items())} |", "",
        "## Tasks", "", *(f"- {_cell(text) or 'without an instruction'}" for text in tasks), "",
        "## Robot", "", "| arm | instrument | base in the world (x y z qx qy qz qw) |", "|---|---|---|",
        *(f"| {_cell(name)} | {_cell(arm.attrs['tool'])} | {_pose(arm)} |" for name, arm in _arms(file)), "",
        "## Synchronisation", "",
        f"{origin.synchronised} `timestamp` is the number of the sample over {info['fps']} Hz; the time is up to "
        f"{1e3 * jitter:.1f} ms later (`observation.meta.sim_time`).", "",
        "## Features", "", "| name | shape | meaning |", "|---|---|---|",
        *(f"| `{_cell(k)}` | {tuple(each['shape'])} | {_meaning(k)} |" for k, each in info["features"].items()), "",
        "Depth, object ids and what else the simulation knows stay in the HDF5 file. Calibrations of cameras and bases "
        "of arms are in `meta/calibration.json`.", "",
        *_left_out(constant),
        "## Labels", "", "| number | phase | gesture of JIGSAWS |", "|---|---|---|",
        *(f"| {k} | {_cell(phase) or 'none'} | {gesture} |" for k, (phase, gesture) in enumerate(_phases(file))), "",
        "| number | activity of an arm |", "|---|---|",
        *(f"| {k} | {_cell(name)} |" for k, name in enumerate(map(str, attributes["activities"]))), "",
        "Grasps, releases, contacts, punctures, exits and drops are in `meta/events.jsonl`, where the dataset has "
        "them: a line each, at the first sample at or after them.", "",
        "## Limits", "",
        origin.limits, "",
    ]  # fmt: skip
    return "\n".join(lines)


class _Origin(NamedTuple):
    """The part of a dataset card that states the origin of the data."""

    title: str
    place: str
    kind: str
    synchronised: str
    limits: str


def _origin(file: h5py.File) -> _Origin:
    scene = str(file.attrs["scene"])
    if file.attrs.get("recorded", False):
        return _Origin(
            "arms recorded on ROS", "from a bag", "recorded on ROS",
            "A sample has the newest message of each topic at its time: rows differ by up to a period of their topics.",
            "What the bag has: nothing tells whether robot and tissue were real.",
        )  # fmt: skip
    return _Origin(
        f"{scene}: simulated suturing", f"in the scene `{scene}`", "simulated",
        "All of a sample is taken at one instant of simulated time: pictures and motion are synchronised.",
        "Simulated robots, tissue and light: a policy trained on them alone is not one for a robot. The scripted "
        "expert, where it is the source, is precise and does not hesitate, search or recover as people do.",
    )  # fmt: skip


def _front_matter(license: str) -> list[str]:
    """What the Hugging Face Hub reads of a card, as lines of YAML."""
    front = {
        "license": license, "task_categories": ["robotics"], "tags": ["LeRobot", "surgical", "simulation"],
        "configs": [{"config_name": "default", "data_files": "data/*/*.parquet"}],
    }  # fmt: skip
    return str(yaml.safe_dump(front, sort_keys=False, allow_unicode=True, width=sys.maxsize)).splitlines()


def _cell(text: object) -> str:
    """A text of others on one line of a table."""
    return " ".join(str(text).split()).replace("|", "\\|")


def _left_out(constant: Sequence[str]) -> list[str]:
    names = ", ".join(f"`{_cell(name)}`" for name in constant)
    return [f"Left out, since they never change here: {names}.", ""] if constant else []


def _arms(file: h5py.File) -> list[tuple[str, h5py.Group]]:
    return sorted(file["arms"].items())


def _phases(file: h5py.File) -> list[tuple[str, str]]:
    return list(zip(map(str, file.attrs["phases"]), map(_cell, file.attrs["gestures"]), strict=True))


def _pose(arm: h5py.Group) -> str:
    if "base_pose" not in arm.attrs:
        return "none"
    return " ".join(f"{x:.5g}" for x in arm.attrs["base_pose"])


def _meaning(name: str) -> str:
    if name.startswith("observation.images."):
        return f"camera {name.rsplit('.', 1)[1]}"
    if name.startswith(EXTRA):
        return MEANING.get(name, "an array of the caller, as whoever recorded the dataset documents it")
    return MEANING[name]
