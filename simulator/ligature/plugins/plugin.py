"""The base class of plug-ins. World axes, SI units; poses are x y z qx qy qz qw."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.model.plugins import PluginEntry
from ligature.model.scene import Body
from ligature.plugins.host import Host

Array = NDArray[np.float64]
Line = tuple[Sequence[float], Sequence[float], tuple[int, int, int]]
"""Two ends (3,) in world axes, and red, green, blue from 0 to 255."""


class Plugin:
    """What a plug-in derives from: it overrides the hooks that it needs.

    A hook that raises switches its plug-in off; the run continues. Hooks run in the physics process, one after the
    other, in the time of a tick: 1 ms for everything.

    Attributes
    ----------
    entry
        What the scene file states: name, topics, the kind of object that has the plug-in.
    parameters
        Further keys of the entry, as nested dicts, lists and texts.
    host
        What the plug-in sees of the simulation and does to it.
    body
        The body that has the plug-in; None for a plug-in of a file.
    received
        Newest numbers of each topic that it subscribes, zeros until a message arrives.
    """

    entry: PluginEntry
    parameters: Mapping[str, Any]
    host: Host
    body: Body | None
    received: Mapping[str, Array]
    _published: Mapping[str, Array]

    def publish(self, topic: str, values: Sequence[float] | Array) -> None:
        """Set the ``values`` of a ``topic`` in the entry's ``publishes``; they are sent with the next state."""
        self._published[topic][:] = values

    def on_load(self) -> None:
        """Called once: all attributes are set, and the simulation is at the start of the scene."""

    def before_step(self) -> None:
        """Act before a tick: `Host.push` and `Host.apply` have their effect in this tick."""

    def after_step(self) -> None:
        """Look at what a tick has made."""

    def on_reset(self) -> None:
        """Reset the plug-in; bodies, threads and joints have been reset already."""

    def on_close(self) -> None:
        """End: the run is over."""

    def draw(self) -> Iterable[Line]:
        """Lines for windows; called whenever a state is written, so it changes nothing."""
        return ()

    def snapshot(self) -> Any:
        """All that the plug-in keeps from tick to tick, as plain data: numbers, texts, arrays, lists, dicts of them."""
        return None

    def restore(self, snapshot: Any) -> None:
        """Continue from a copy of a `snapshot`."""
