"""A plug-in that writes where bodies are to a CSV file: one line for each body and sample.

In the scene's file::

    plugins:
      - {name: recorder, filename: recorder.py, bodies: [Ball, Cube], every: 10, publishes: {samples: 1}}

``every`` counts ticks; ``file`` is motion.csv unless given. A relative one is put into the folder of the program that
simulates.
"""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

from ligature.plugins import Plugin


class Recorder(Plugin):
    """Takes samples after steps; all of them are written when the run ends."""

    def on_load(self) -> None:
        """Find the bodies; a name that does not exist switches the plug-in off, with the reason."""
        self.file = Path(self.parameters.get("file", "motion.csv"))
        self.every = int(self.parameters.get("every", "1"))
        self.bodies = [(name, self.host.body(name)) for name in self.parameters["bodies"]]
        self.rows: list[list[float | str]] = []
        self.ticks = 0

    def after_step(self) -> None:
        """Take a sample every few ticks."""
        self.ticks += 1
        if self.ticks % self.every == 0:
            for name, body in self.bodies:
                self.rows.append([round(self.host.time, 6), name, *self.host.pose(body).tolist()])
            self.publish("samples", [len(self.rows)])

    def on_reset(self) -> None:
        """Begin a new recording."""
        self.rows, self.ticks = [], 0

    def snapshot(self) -> Any:
        """What was recorded so far goes into snapshots, so that a restored run records no moment twice."""
        return {"rows": self.rows, "ticks": self.ticks}

    def restore(self, snapshot: Any) -> None:
        """Go on from there."""
        self.rows, self.ticks = snapshot["rows"], snapshot["ticks"]

    def on_close(self) -> None:
        """Write the file."""
        with self.file.open("w", newline="") as out:
            writer = csv.writer(out)
            writer.writerow(["time", "body", "x", "y", "z", "qx", "qy", "qz", "qw"])
            writer.writerows(self.rows)
