"""Runs the plug-ins of a scene as subsystems of the simulation, and switches off those that fail."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from itertools import islice
from types import MappingProxyType
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ligature.adf import Diagnostic, Severity
from ligature.model.commands import PluginCommand
from ligature.model.plugins import PluginEntry, row_count, topic_rows
from ligature.model.state import MAX_LINES, StateRecord
from ligature.model.subsystem import Subsystem
from ligature.plugins.host import Host
from ligature.plugins.loading import plugin_class
from ligature.plugins.plugin import Plugin

Array = NDArray[np.float64]
Result = TypeVar("Result")

MOST_CHARACTERS = 300
"""Most characters of an exception in a finding."""


class Plugins(Subsystem):
    """The plug-ins of a scene, as the first subsystem of a tick; `AfterStep` is the last.

    ``host`` is what all of them share.
    """

    def __init__(self, host: Host) -> None:
        self._host = host
        self._entries = host.scene.plugins
        self._slices = topic_rows([entry.publishes for entry in self._entries])
        self._topics = topic_rows([entry.subscribes for entry in self._entries])
        self._values, self._received = (np.zeros(row_count(rows)) for rows in (self._slices, self._topics))
        self._plugins: list[Plugin | None] = [None] * len(self._entries)
        self._off = [False] * len(self._entries)
        self._problems: list[Diagnostic] = []
        self._closed = False

    def load(self) -> None:
        """Import and begin all plug-ins; one that fails is off."""
        for number, entry in enumerate(self._entries):
            self._call(number, "on_load", partial(self._load, number, entry))

    def _load(self, number: int, entry: PluginEntry) -> None:
        plugin = plugin_class(entry, number)()
        plugin.entry, plugin.parameters, plugin.host = entry, entry.parameters, self._host
        plugin.body = self._host.scene.bodies[entry.body] if entry.body >= 0 else None
        plugin._published = _views(self._values, self._slices[number])
        received = _views(self._received, self._topics[number])
        for values in received.values():
            values.flags.writeable = False
        plugin.received = received
        self._plugins[number] = plugin
        plugin.on_load()

    def _running(self, hook: str) -> Iterator[tuple[int, Plugin]]:
        """The plug-ins that are on and have a hook of their own."""
        for number, plugin in enumerate(self._plugins):
            if (
                plugin is not None
                and not self._off[number]
                and getattr(type(plugin), hook) is not getattr(Plugin, hook)
            ):
                yield number, plugin

    def _call(self, number: int, hook: str, work: Callable[[], Result]) -> Result | None:
        """Do the work of a hook; whatever it raises switches the plug-in off."""
        try:
            return work()
        except (Exception, SystemExit) as error:
            self._off[number] = True
            entry = self._entries[number]
            text = f"{type(error).__name__}: {str(error)[:MOST_CHARACTERS]}"
            message = f"plug-in '{entry.name}' failed in {hook} and is switched off: {text}{_line(error, entry)}"
            self._problems.append(Diagnostic(Severity.ERROR, message, entry.mark, code="plugin"))
            return None

    def _call_all(self, hook: str) -> None:
        for number, plugin in self._running(hook):
            self._call(number, hook, getattr(plugin, hook))

    def step(self, tick: int) -> None:
        """Let plug-ins act before the others."""
        with self._host.before_step():
            self._call_all("before_step")

    def after_step(self) -> None:
        """Let plug-ins look at what the tick has made."""
        with self._host.after_step():
            self._call_all("after_step")

    def take_pushed(self) -> set[int]:
        """The bodies that plug-ins have pushed since the last call."""
        return self._host.take_pushed()

    def receive(self, command: PluginCommand) -> None:
        """Take a message for a topic of a plug-in.

        Raises ValueError for an unknown topic or the wrong number of values.
        """
        topics = list(self._topics[command.plugin].items())
        name = self._entries[command.plugin].name
        if not 0 <= command.topic < len(topics):
            raise ValueError(f"plug-in '{name}' subscribes no topic number {command.topic}")
        topic, rows = topics[command.topic]
        if len(command.values) != rows.stop - rows.start:
            raise ValueError(
                f"topic '{topic}' of plug-in '{name}' has {rows.stop - rows.start} numbers, not {len(command.values)}"
            )
        self._received[rows] = command.values

    def write_state(self, state: StateRecord) -> None:
        """Write what plug-ins publish and draw."""
        if not self._entries:
            return
        state["plugin_value"][0] = self._values
        lines = [line for number, plugin in self._running("draw") for line in self._drawn(number, plugin)][:MAX_LINES]
        state["plugin_line_count"] = len(lines)
        for row, (ends, colour) in enumerate(lines):
            state["plugin_line"][0, row], state["plugin_line_colour"][0, row] = ends, colour

    def _drawn(self, number: int, plugin: Plugin) -> list[tuple[Array, NDArray[np.uint8]]]:
        def work() -> list[tuple[Array, NDArray[np.uint8]]]:
            lines = [
                (np.array([a, b], dtype=float), np.clip(colour, 0, 255).astype(np.uint8))
                for a, b, colour in islice(plugin.draw(), MAX_LINES)
            ]
            if any(ends.shape != (2, 3) or colour.shape != (3,) for ends, colour in lines):
                raise ValueError("a line has two ends of three numbers each, and a colour of three")
            return lines

        return self._call(number, "draw", work) or []

    def reset(self) -> None:
        """Forget what was received and published, and tell the plug-ins; this comes after all other subsystems."""
        self._values[:], self._received[:] = 0.0, 0.0
        self._call_all("on_reset")

    def snapshot(self) -> dict[str, Any]:
        """What plug-ins published, received and keep, and which are on."""
        own = [None] * len(self._plugins)
        for number, plugin in self._running("snapshot"):
            own[number] = self._call(number, "snapshot", plugin.snapshot)
        return {"values": self._values, "received": self._received, "off": list(self._off), "own": own}

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`; this comes after all other subsystems."""
        self._values[:], self._received[:] = snapshot["values"], snapshot["received"]
        self._off = [off or plugin is None for off, plugin in zip(snapshot["off"], self._plugins, strict=True)]
        for number, plugin in self._running("restore"):
            self._call(number, "restore", partial(plugin.restore, snapshot["own"][number]))

    def take_problems(self) -> list[Diagnostic]:
        """Plug-ins that were switched off since the last call."""
        found, self._problems = self._problems, []
        return found

    def close(self) -> None:
        """Let plug-ins end, once."""
        if not self._closed:
            self._closed = True
            self._call_all("on_close")


class AfterStep(Subsystem):
    """The other end of a tick for plug-ins; all that they keep belongs to `Plugins`."""

    def __init__(self, plugins: Plugins) -> None:
        self._plugins = plugins

    def step(self, tick: int) -> None:
        """Let plug-ins look."""
        self._plugins.after_step()

    def reset(self) -> None:
        """Nothing: it is part of `Plugins`."""

    def snapshot(self) -> None:
        """Nothing: it is part of `Plugins`."""

    def restore(self, snapshot: None) -> None:
        """Nothing: it is part of `Plugins`."""


def _views(values: Array, rows: Mapping[str, slice]) -> Mapping[str, Array]:
    """The numbers of each topic, as parts of ``values``."""
    return MappingProxyType({name: values[place] for name, place in rows.items()})


def _line(error: BaseException, entry: PluginEntry) -> str:
    """Where in the file of a plug-in an exception was raised, for messages."""
    if entry.path is None:
        return ""
    place, trace = "", error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == str(entry.path):
            place = f" ({entry.path.name}:{trace.tb_lineno})"
        trace = trace.tb_next
    return place
