"""Messages of bodies of tissue: what acts on them, where they are punctured, their surface for rviz.

They hang below the topics of the rigid body, in the frame ``world`` after the prefix of the scene. SI units.
"""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import rospy
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point, Pose, PoseArray, WrenchStamped
from numpy.typing import NDArray
from visualization_msgs.msg import Marker

from ligature.model.frames import matrix_quaternion
from ligature.model.scene import Scene
from ligature.model.soft import TissueBody
from ligature.ros.conversion import Record
from ligature.ros.names import WORLD_FRAME

Array = NDArray[np.float64]

MESH_RATE = 10.0
"""Surfaces a second."""

FLESH = (0.85, 0.55, 0.5)
"""Colour of a body whose file gives none."""


class _Template:
    """One message of a body of tissue that is filled again for every publication."""

    kind = ""
    message: Any

    def __init__(self, scene: Scene, tissue: TissueBody) -> None:
        self.index, self._tissue = tissue.index, tissue
        self.identity = scene.bodies[tissue.body].identity
        self._frame = scene.world.frame_prefix + WORLD_FRAME

    def fill(self, state: Record, stamp: rospy.Time) -> Any:
        """The message of ``state`` (a record scalar)."""
        header = self.message.header
        header.stamp, header.frame_id = stamp, self._frame
        self.content(state)
        return self.message

    def content(self, state: Record) -> None:
        """Fill the fields that this kind of message has."""


class ForceTemplate(_Template):
    """``WrenchStamped``: all that needles, threads and bodies do to the tissue, about the origin of its body."""

    kind = "tissue force"

    def __init__(self, scene: Scene, tissue: TissueBody) -> None:
        super().__init__(scene, tissue)
        self.message = WrenchStamped()

    def content(self, state: Record) -> None:
        """Force and moment."""
        force, torque = self.message.wrench.force, self.message.wrench.torque
        force.x, force.y, force.z, torque.x, torque.y, torque.z = state["tissue_wrench"][self.index].tolist()


class PuncturesTemplate(_Template):
    """``PoseArray``: places on the surface where needles went in or out, the z axis out of the tissue."""

    kind = "tissue punctures"

    def __init__(self, scene: Scene, tissue: TissueBody) -> None:
        super().__init__(scene, tissue)
        self.message = PoseArray()

    def content(self, state: Record) -> None:
        """One pose for each puncture."""
        count = int(state["puncture_count"][self.index])
        places = state["puncture_point"][self.index, :count].tolist()
        self.message.poses = []
        for (x, y, z), normal in zip(places, state["puncture_normal"][self.index, :count], strict=True):
            pose = Pose()
            pose.position.x, pose.position.y, pose.position.z = x, y, z
            q = pose.orientation
            q.x, q.y, q.z, q.w = matrix_quaternion(_upright(normal)).tolist()
            self.message.poses.append(pose)


def _upright(normal: Array) -> Array:
    """A rotation (3, 3) whose z axis is the unit vector ``normal``."""
    x = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    x /= max(float(np.linalg.norm(x)), 1e-12)
    return np.column_stack([x, np.cross(normal, x), normal])


class SurfaceMarker(Marker):  # type: ignore[misc]
    """A `Marker` whose points are written at once: ``corners`` (n, 3) stand for ``points``, which stays empty."""

    corners: Array = np.zeros((0, 3))

    def serialize(self, buff: Any) -> None:
        """Write the message; ten thousand points take a tenth of a millisecond rather than ten."""
        whole = io.BytesIO()
        super().serialize(whole)
        data, end = whole.getvalue(), len(whole.getvalue()) - _AFTER_POINTS
        buff.write(data[: end - 4])
        buff.write(np.uint32(len(self.corners)).tobytes())
        buff.write(np.ascontiguousarray(self.corners, dtype="<f8").tobytes())
        buff.write(data[end:])


def _after_points() -> int:
    """Bytes of a marker without texts after its points."""
    written = []
    for points in ([], [Point()]):
        stream = io.BytesIO()
        Marker(points=points).serialize(stream)
        written.append(stream.getvalue())
    count = next(at for at, (a, b) in enumerate(zip(*written, strict=False)) if a != b)
    return len(written[0]) - count - 4


_AFTER_POINTS = _after_points()


class MeshTemplate(_Template):
    """``Marker``: the surface of the grid as a list of triangles."""

    kind = "tissue mesh"

    def __init__(self, scene: Scene, tissue: TissueBody) -> None:
        super().__init__(scene, tissue)
        self.message = marker = SurfaceMarker()
        marker.ns, marker.id = self.identity.topic, 0
        marker.type, marker.action, marker.frame_locked = Marker.TRIANGLE_LIST, Marker.ADD, False
        marker.pose.orientation.w = marker.scale.x = marker.scale.y = marker.scale.z = 1.0
        colour = scene.bodies[tissue.body].visual.colour
        marker.color.r, marker.color.g, marker.color.b = FLESH if colour is None else colour.diffuse
        marker.color.a = 1.0
        self._corners = tissue.form.triangles.reshape(-1)

    def content(self, state: Record) -> None:
        """Three corners for each triangle."""
        self.message.corners = state["tissue_node"][self._tissue.rows][self._corners]


TOPICS: dict[str, tuple[type[_Template], type, float | None]] = {
    "TissueForce": (ForceTemplate, WrenchStamped, None),
    "TissuePunctures": (PuncturesTemplate, PoseArray, None),
    "TissueMesh": (MeshTemplate, Marker, MESH_RATE),
}
"""Below the topic of a body of tissue: what fills the message, its type, its rate in Hz, None for the body's own."""


def statuses(scene: Scene, state: Record) -> list[DiagnosticStatus]:
    """What ``/diagnostics`` reports of each body of tissue."""
    found = []
    for tissue in scene.tissues:
        k, name = tissue.index, scene.bodies[tissue.body].identity.topic
        peak, punctures = float(state["tissue_peak"][k]), int(state["puncture_count"][k])
        rows = {
            "nodes": str(len(tissue.form.grid.nodes)),
            "contacts": str(int(state["tissue_contacts"][k])),
            "punctures": str(punctures),
            "peak force (N)": f"{peak:.4f}",
            "total force (N)": f"{np.linalg.norm(state['tissue_wrench'][k, :3]):.4f}",
        }
        finite = bool(np.isfinite(state["tissue_node"][tissue.rows]).all())
        found.append(
            DiagnosticStatus(
                level=DiagnosticStatus.OK if finite else DiagnosticStatus.ERROR, name=f"ligature: tissue {name}",
                hardware_id="ligature", values=[KeyValue(key=key, value=value) for key, value in rows.items()],
                message=f"at most {peak:.3f} N at a point, {punctures} punctures" if finite else "nodes are not finite",
            )
        )  # fmt: skip
    return found
