"""A plug-in that drills a volume: a spinning burr removes voxels, and the bone presses it back.

In the scene's file::

    plugins:
      - {name: drilling, filename: drilling.py, volume: Bone, drill: Drill, radius: 0.002,
         subscribes: {spin: 1}, publishes: {force: 3, removed: 1, depth: 1}}

The burr is a ball about the origin of the body ``drill``, which has no shape that collides with the bone. It spins
while the topic ``spin`` is above 0; ``spin: 1`` among the parameters has it spin from the start.

The force takes its place and direction from moments of what burr and bone share (Agus, Giachetti, Gobbetti, Zanetti and
Zorcolo, "Real-time haptic and visual simulation of bone dissection", Presence 12, 2003, 110): it points from the middle
of the overlap to the middle of the burr. Its size is ``stiffness`` times the depth of the cap of the burr that has the
same volume, plus ``damping`` times the speed inwards, at most ``largest``. So a burr at rest that is pressed on a plane
feels a spring, and one in a corner or in a hole what is around it.

A spinning burr cuts towards where it is, as fast as it is pressed: ``cutting`` metres a second for each newton, as wear
goes with load. What it has not cut yet holds it back, so that the force grows with the speed at which it is fed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from ligature.plugins import Plugin
from numpy.typing import NDArray

Array = NDArray[np.float64]

DEFAULTS = {"radius": 2e-3, "stiffness": 3000.0, "damping": 2.0, "largest": 15.0, "cutting": 4e-3, "spin": 0.0}
"""m, N/m, N s/m, N, m/(N s)."""


class Drilling(Plugin):
    """Cuts before each tick with where the burr is, and pushes it."""

    def on_load(self) -> None:
        """Find the volume and the drill; a name that does not exist switches the plug-in off, with the reason."""
        values = {name: float(self.parameters.get(name, default)) for name, default in DEFAULTS.items()}
        if not all(np.isfinite(value) and value >= 0.0 for value in values.values()) or values["radius"] == 0.0:
            raise ValueError(f"numbers of a drill are 0 or more, and its radius above 0, not {values}")
        self.radius, self.stiffness, self.damping = values["radius"], values["stiffness"], values["damping"]
        self.largest, self.cutting, self.on = values["largest"], values["cutting"], values["spin"] > 0.0
        self.volume = self.host.volume(self.parameters["volume"])
        self.drill = self.host.body(self.parameters["drill"])
        # what presses ends half a voxel within what cuts: a burr that has cut all that it meets feels nothing
        self.pressing = self.radius - 0.5 * float(self.volume.spacing.max())
        if self.pressing <= 0.0:
            raise ValueError(f"a burr of {self.radius:g} m is smaller than the voxels of '{self.parameters['volume']}'")
        self.on_reset()

    def on_reset(self) -> None:
        """Start where the drill is."""
        self.cutter: Array = self.host.pose(self.drill)[:3].copy()
        self.force: Array = np.zeros(3)

    def before_step(self) -> None:
        """Cut towards the burr as far as it was pressed for, and push it out of what is left."""
        burr = self.host.pose(self.drill)[:3]
        shared, out = self.volume.overlap(burr, self.pressing)
        if shared > 0.0 and (self.on or self.received["spin"][0] > 0.0):
            self._cut(burr, self.stiffness * cap_depth(shared, self.pressing))
            shared, out = self.volume.overlap(burr, self.pressing)
        if shared == 0.0:
            self.cutter = burr.copy()
        if shared > 0.0 and not out.any():  # all around: back to where it was free
            out = unit(self.cutter - burr)
        depth = cap_depth(shared, self.pressing)
        inwards = -float(self.host.twist(self.drill)[:3] @ out)
        size = self.stiffness * depth + self.damping * inwards if depth > 0.0 else 0.0
        self.force = min(max(size, 0.0), self.largest) * out
        self.host.push(self.drill, self.force, burr)
        self.publish("force", self.force)
        self.publish("removed", [self.volume.removed])
        self.publish("depth", [depth])

    def _cut(self, burr: Array, force: float) -> None:
        """Move the cutter towards the burr, and remove what it meets."""
        way = burr - self.cutter
        length, most = float(np.linalg.norm(way)), self.cutting * min(force, self.largest) * self.host.dt
        to = burr if length <= most else self.cutter + way * (most / length)
        self.volume.cut(self.cutter, to, self.radius)
        self.cutter = to.copy()

    def draw(self) -> list[Any]:
        """The force as a line from the burr, 2 mm a newton."""
        burr = self.host.pose(self.drill)[:3]
        return [(burr, burr + 2e-3 * self.force, (255, 140, 0))]

    def snapshot(self) -> Any:
        """How far it has cut; the voxels are in snapshots by themselves."""
        return {"cutter": self.cutter, "force": self.force}

    def restore(self, snapshot: Any) -> None:
        """Go on from there."""
        self.cutter, self.force = snapshot["cutter"], snapshot["force"]


def unit(vector: Array) -> Array:
    """A vector of length 1 in the same direction; of length 0 for none."""
    length = float(np.linalg.norm(vector))
    return vector / length if length > 0.0 else np.zeros(3)


def cap_depth(volume: float, radius: float) -> float:
    """Height of the cap of a ball that has ``volume``: the root of pi h^2 (r - h / 3) between 0 and 2 r."""
    share = min(max(volume / (4.0 / 3.0 * np.pi * radius**3), 0.0), 1.0)
    # with h = r (1 - cos a) the share is (2 - 3 cos a + cos^3 a) / 4, and cos a = 2 cos(b) solves the cubic
    third = (np.arccos(2.0 * share - 1.0) + 4.0 * np.pi) / 3.0
    return max(float(radius * (1.0 - 2.0 * np.cos(third))), 0.0)
