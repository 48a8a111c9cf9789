"""Teleoperation without a file: one configuration for each device, and the combination of several."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ligature.bundle import EXAMPLES
from ligature.teleop import config
from ligature.teleop.config import DeviceSpec, TeleopConfig

FOLDER = EXAMPLES / "teleop"


def names() -> list[str]:
    """Names of the devices that are ready."""
    return sorted(path.stem for path in FOLDER.glob("*.yaml"))


def of_devices(wanted: Sequence[str]) -> TeleopConfig:
    """The teleoperation of devices such as ``touch`` or, with other topics, ``touch=/arm1/``.

    Each begins with the next instrument that none before it has; one for which none is left waits until it is selected.
    Raises ValueError for a name that is not ready.
    """
    devices: dict[str, DeviceSpec] = {}
    pairs: dict[str, tuple[str, ...]] = {}
    waiting: set[str] = set()
    first: TeleopConfig | None = None
    phases: tuple[str, ...] = ()
    for text in wanted:
        found, topic = _one(text)
        first, phases = first or found, phases or found.phases
        for name, spec in found.devices.items():
            own = next(each for each in (name, *(f"{name}{n}" for n in range(2, 100))) if each not in devices)
            devices[own] = replace(spec, name=own, topic=topic or spec.topic)
            followers = found.pairs[name]
            taken = {pairs[other][0] for other in pairs if other not in waiting}
            free = [arm for arm in followers if arm not in taken]
            if not free:
                waiting.add(own)
            pairs[own] = (*free, *(arm for arm in followers if arm not in free))
    if first is None:
        raise ValueError(f"name a device; choose one of {', '.join(names())}")
    return replace(first, devices=devices, pairs=pairs, waiting=frozenset(waiting), phases=phases)


def _one(text: str) -> tuple[TeleopConfig, str]:
    """The teleoperation of one device, with the topic that the user named."""
    name, equals, topic = text.partition("=")
    if name not in names() or (equals and not topic):
        raise ValueError(
            f"no device '{text}' works without a file; choose one of {', '.join(names())}, "
            "each also with a topic, such as touch=/arm1/"
        )
    if equals and name in ("touch", "mtm"):  # topics begin with it
        topic = topic.rstrip("/") + "/"
    return config.read(FOLDER / f"{name}.yaml"), topic
