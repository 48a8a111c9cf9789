"""``/diagnostics``: how the loop runs, what was dropped, coalesced and rejected."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from ligature.adf import Severity
from ligature.bus import Block
from ligature.ros.arms.rivals import Rival

PERIOD = 1.0
FRESH = 60.0
"""Seconds for which a finding sets the level of its status."""

SLOW = 0.95
"""Real-time factor below which the status is a warning."""


class Diagnostics:
    """Publishes the figures of the bus once a second; ``missed`` are messages that slow clients did not take.

    ``faults`` are the arms in FAULT, each with the reason; ``rivals`` publish what the simulator leaves to them;
    ``more`` adds statuses of other parts.
    """

    def __init__(self, block: Block, more: Callable[[], Sequence[DiagnosticStatus]] = tuple) -> None:
        self._block, self._more = block, more
        self._publisher = rospy.Publisher("/diagnostics", DiagnosticArray, queue_size=2)
        self._next = 0.0
        self.missed = 0
        self.faults: dict[str, str] = {}
        self.rivals: Mapping[str, Rival] = {}

    def publish(self, now: float) -> None:
        """Publish when a second has passed; ``now`` on the monotonic clock."""
        if now < self._next:
            return
        self._next = now + PERIOD
        figures = self._block.figures[0]
        factor = float(figures["real_time_factor"])
        status = DiagnosticStatus(name="ligature: physics loop", hardware_id="ligature")
        status.level = DiagnosticStatus.OK if factor >= SLOW or factor == 0.0 else DiagnosticStatus.WARN
        status.message = f"real-time factor {factor:.2f}"
        alarms, alarm = int(figures["alarms"]), bytes(figures["alarm"]).decode("utf-8", "ignore")
        if alarms:
            status.level = DiagnosticStatus.WARN
            status.message += f"; {alarm}"
        rows = {
            "loop rate (Hz)": f"{figures['loop_hz']:.1f}",
            "real-time factor": f"{factor:.3f}",
            "behind the wall clock (s)": f"{figures['behind']:.3f}",
            "update p50 (ms)": f"{1e3 * figures['tick_p50']:.3f}",
            "update p99 (ms)": f"{1e3 * figures['tick_p99']:.3f}",
            "update max (ms)": f"{1e3 * figures['tick_max']:.3f}",
            "commands received": str(figures["received"]),
            "commands coalesced": str(figures["coalesced"]),
            "commands rejected": str(int(figures["rejected"]) + int(figures["malformed"])),
            "commands dropped": str(sum(ring.dropped for ring in self._block.rings.values())),
            "messages published": str(figures["published"]),
            "publications dropped": str(figures["publish_late"]),
            "messages missed by slow clients": str(self.missed),
            "bodies faster than commanded": str(alarms),
            "camera frames drawn": str(figures["frames"]),
            "camera frames dropped": str(figures["frames_dropped"]),
            "camera frame time (ms)": f"{1e3 * figures['frame_seconds']:.1f}",
        }
        rows.update({f"{part} left to": f"{rival.node} ({rival.topic})" for part, rival in self.rivals.items()})
        status.values = [KeyValue(key=k, value=v) for k, v in rows.items()]
        faults = [
            DiagnosticStatus(
                level=DiagnosticStatus.ERROR, name=f"ligature: {arm}", hardware_id="ligature", message=f"FAULT: {why}"
            )
            for arm, why in self.faults.items()
        ]
        array = DiagnosticArray(status=[status, self._findings(now), *faults, *self._more()])
        array.header.stamp = rospy.Time.now()
        self._publisher.publish(array)

    def _findings(self, now: float) -> DiagnosticStatus:
        """What went wrong in bodies, actuators and other parts of the simulation, the newest first."""
        found = sorted(
            (row for row in self._block.figures["findings"][0] if row["time"] > 0.0), key=lambda r: -r["time"]
        )
        fresh = [row for row in found if now - row["time"] < FRESH]
        status = DiagnosticStatus(name="ligature: simulation", hardware_id="ligature", message="nothing failed lately")
        if fresh:
            failed = any(row["severity"] >= Severity.ERROR for row in fresh)
            status.level = DiagnosticStatus.ERROR if failed else DiagnosticStatus.WARN
            status.message = bytes(fresh[0]["text"]).decode("utf-8", "ignore")
        status.values = [
            KeyValue(key=f"{now - row['time']:.0f} s ago", value=bytes(row["text"]).decode("utf-8", "ignore"))
            for row in found
        ]
        return status
