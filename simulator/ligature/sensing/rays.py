"""Ray sensors: proximity measurements, and the penalty forces of resistance sensors.

World axes, SI units. A ray's measurement is 1 minus the hit fraction: 0 for nothing or at the far
end, 1 at the origin (as in AMBF).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import pose7_matrix
from ligature.model.hits import RayHits
from ligature.model.scene import Scene, Sensor, SensorType
from ligature.model.state import StateRecord
from ligature.model.subsystem import ALWAYS, Subsystem, kept, put_back
from ligature.sensing.targets import Targets

Array = NDArray[np.float64]


class Rays(Subsystem):
    """The rays of all sensors of a scene, one after the other, in the order of the state record.

    Resistance sensors push in every tick; rays are measured when the state is written.
    """

    def __init__(self, scene: Scene, targets: Targets) -> None:
        self._targets = targets
        self.sensors = [s for s in scene.sensors if s.type is not SensorType.CONTACT]
        counts = [len(s.rays) for s in self.sensors]
        ends = np.cumsum([0, *counts])
        self.slices = [slice(int(a), int(b)) for a, b in zip(ends[:-1], ends[1:], strict=True)]
        n = int(ends[-1])
        self.hits = RayHits(np.full(n, -1, dtype=np.int32), np.ones(n), np.zeros((n, 3)), np.zeros((n, 3)))
        pushing = [s for s in self.sensors if s.type is SensorType.RESISTANCE]
        self._stick = [_Stick(sensor) for sensor in pushing]

    def step(self, tick: int) -> None:
        """Apply the forces of every resistance sensor in the coming step of the bodies."""
        for stick in self._stick:
            stick.step(self._targets)

    def idle_ticks(self, tick: int) -> int:
        """Always without resistance sensors, else none."""
        return 0 if self._stick else ALWAYS

    def sense(self, state: StateRecord) -> None:
        """Cast every ray among the bodies of the state, and write the hits."""
        if not self.sensors:
            return
        self.update(state["body_pose"][0])
        hits = self.hits
        state["ray_measurement"][0] = self.measurement
        state["ray_body"][0], state["ray_point"][0], state["ray_normal"][0] = hits.body, hits.point, hits.normal

    def reset(self) -> None:
        """Release every stuck ray."""
        for stick in self._stick:
            stick.reset()

    def snapshot(self) -> dict[str, Any]:
        """The last hits, and the points where rays of resistance sensors stick."""
        return {"hits": self.hits._asdict(), "stick": [kept(stick, STICK_KEPT) for stick in self._stick]}

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`."""
        self.hits = RayHits(**snapshot["hits"])
        for stick, state in zip(self._stick, snapshot["stick"], strict=True):
            put_back(stick, state)

    @property
    def measurement(self) -> Array:
        """Measurement (n,) of every ray."""
        return np.where(self.hits.body >= 0, 1.0 - self.hits.fraction, 0.0)

    def update(self, body_pose: Array) -> None:
        """Cast every ray with the bodies at ``body_pose`` (bodies, 7)."""
        segments = np.concatenate([_segments(s, pose7_matrix(body_pose[s.parent])) for s in self.sensors])
        self.hits = self._targets.ray_test(segments[:, 0], segments[:, 1])


def _segments(sensor: Sensor, T_world_parent: Array) -> Array:
    """Start and end points (n, 2, 3) of one sensor's rays in world axes."""
    T = T_world_parent @ sensor.T_body_sensor
    segments: Array = sensor.rays @ T[:3, :3].T + T[:3, 3]
    return segments


class _Stick:
    """Where each ray of a resistance sensor last stuck, and the forces that follow."""

    def __init__(self, sensor: Sensor) -> None:
        self._sensor = sensor
        n = len(sensor.rays)
        self._body = np.full(n, -1, dtype=np.int64)
        self._on_sensed, self._on_parent = np.zeros((n, 3)), np.zeros((n, 3))
        self._error = np.zeros((n, 3))
        self._offset = np.zeros((n, 3))

    def reset(self) -> None:
        """Release all stuck points."""
        self._body[:] = -1
        for array in (self._on_sensed, self._on_parent, self._error, self._offset):
            array[:] = 0.0

    def step(self, targets: Targets) -> None:
        """Push the bodies that the rays hit, and the parent back."""
        parent = self._sensor.parent
        T_parent = pose7_matrix(targets.pose7(parent))
        segments = _segments(self._sensor, T_parent)
        hits = targets.ray_test(segments[:, 0], segments[:, 1])
        poses = {body: pose7_matrix(targets.pose7(body)) for body in set(hits.body.tolist()) if body >= 0}
        for ray, body in enumerate(hits.body.tolist()):
            if body < 0:
                self._body[ray] = -1
                continue
            force, stiffness = self._force(ray, segments[ray], hits, T_parent, poses[body])
            targets.push(body, force, hits.point[ray], stiffness)
            targets.push(parent, -force, hits.point[ray], stiffness)

    def _force(self, ray: int, segment: Array, hits: RayHits, T_parent: Array, T_sensed: Array) -> tuple[Array, Array]:
        """Force (3,) on the sensed body from one ray: normal, sticking and sliding parts; and its stiffness (3, 3)."""
        law = self._sensor.resistance
        direction = segment[1] - segment[0]
        length = float(np.linalg.norm(direction))
        direction = direction / length
        normal = law.contact_stiffness * (1.0 - hits.fraction[ray]) * direction
        weight = float(np.linalg.norm(normal)) if law.variable else 1.0
        if self._body[ray] != hits.body[ray]:
            self._latch(ray, hits, T_parent, T_sensed)
        offset, sliding = self._tangential_offset(ray, direction, T_parent, T_sensed)
        previous, self._error[ray] = self._error[ray].copy(), offset
        force: Array = normal + law.dynamic_friction * weight * sliding
        across = law.dynamic_friction * weight
        if np.linalg.norm(offset) <= law.contact_area:
            force = force + law.static_friction * weight * offset + law.damping * (offset - previous)
            across += law.static_friction * weight + law.damping
        else:
            self._latch(ray, hits, T_parent, T_sensed)
        along = np.outer(direction, direction)
        return force, law.contact_stiffness / length * along + across * (np.eye(3) - along)

    def _tangential_offset(self, ray: int, direction: Array, T_parent: Array, T_sensed: Array) -> tuple[Array, Array]:
        """Offset of the stuck points across the ray, and its change since the last tick, each (3,)."""
        on_parent = T_parent @ np.append(self._on_parent[ray], 1.0)
        on_sensed = T_sensed @ np.append(self._on_sensed[ray], 1.0)
        offset = (on_parent - on_sensed)[:3]
        offset = offset - (offset @ direction) * direction
        sliding = offset - self._offset[ray]
        self._offset[ray] = offset
        return offset, sliding

    def _latch(self, ray: int, hits: RayHits, T_parent: Array, T_sensed: Array) -> None:
        """Store the point of a hit as stuck to both bodies."""
        self._body[ray] = hits.body[ray]
        world = np.append(hits.point[ray], 1.0)
        self._on_sensed[ray] = (np.linalg.inv(T_sensed) @ world)[:3]
        self._on_parent[ray] = (np.linalg.inv(T_parent) @ world)[:3]
        self._error[ray] = 0.0
        self._offset[ray] = 0.0


STICK_KEPT = ("_body", "_on_sensed", "_on_parent", "_error", "_offset")
"""Attributes of a `_Stick` that last from tick to tick."""
