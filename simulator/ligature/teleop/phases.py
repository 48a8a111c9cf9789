"""Phases of the work, which the operator marks one after the other: labels of what is recorded."""

from __future__ import annotations

from collections.abc import Sequence

import rospy
from std_msgs.msg import String

from ligature.model.commands import PHASE_TOPIC


class Phases:
    """Publishes which of the phases ``names`` begins; after the last one comes the first again."""

    def __init__(self, names: Sequence[str], prefix: str) -> None:
        self._names = tuple(names)
        self._number = -1
        self._topic = rospy.Publisher(f"{prefix}{PHASE_TOPIC}", String, latch=True, queue_size=10) if names else None

    def go(self, step: int) -> None:
        """Mark that the phase ``step`` places further in the list begins now; the first mark is the first phase."""
        if self._topic is None:
            rospy.logwarn("the operator marks a phase, but there are none; list them: 'phases: [reach, grasp, drive]'")
            return
        self._number = 0 if self._number < 0 else (self._number + step) % len(self._names)
        phase = self._names[self._number]
        self._topic.publish(phase)
        rospy.loginfo(f"phase {self._number + 1} of {len(self._names)}: {phase}")
