"""Bodies of tissue on ROS: their force, punctures and surface as topics, and what /diagnostics reports of them."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import ligature
import numpy as np
import pytest
import rospy
from geometry_msgs.msg import PoseArray, WrenchStamped
from ligature.model.frames import quaternion_matrix
from ligature.model.state import new_state
from ligature.ros import tissue
from rospy.msg import serialize_message
from visualization_msgs.msg import Marker

from tests.ros.conftest import BIN, Program

PAD = """
bodies: [BODY Pad, BODY Weight]
joints: []
namespace: /ambf/env/
BODY Pad:
  name: Pad
  mass: 0.0
  shape: BOX
  geometry: {x: 0.06, y: 0.04, z: 0.01}
  location: {position: {x: 0.1, y: 0.2, z: 0.3}, orientation: {r: 0, p: 0, y: 0.5}}
  ligature tissue: {material: silicone pad, cell size: 0.005, fixed: [-z]}
BODY Weight:
  name: Weight
  mass: 0.02
  collision shape: BOX
  collision geometry: {x: 0.02, y: 0.02, z: 0.01}
  location: {position: {x: 0.1, y: 0.2, z: 0.3105}, orientation: {r: 0, p: 0, y: 0}}
"""


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("pad") / "pad.yaml"
    file.write_text(PAD)
    return file


@pytest.fixture(scope="module")
def scene(path: Path) -> Any:
    return ligature.load(path)


def read_back(message: Any, type_: type) -> Any:
    """What a client reads of ``message``, written as rospy writes it."""
    stream = io.BytesIO()
    serialize_message(stream, 7, message)
    return type_().deserialize(stream.getvalue()[4:])


def test_a_client_reads_the_surface_that_was_written(scene: Any) -> None:
    state = new_state(scene)[0]
    rng = np.random.default_rng(3)
    state["tissue_node"][:] = rng.standard_normal(state["tissue_node"].shape)
    form = scene.tissues[0].form
    sent = tissue.MeshTemplate(scene, scene.tissues[0]).fill(state, rospy.Time(12, 34))
    got = read_back(sent, Marker)
    assert got.type == Marker.TRIANGLE_LIST and got.action == Marker.ADD
    assert (got.header.frame_id, got.header.seq) == ("world", 7)
    assert (got.header.stamp.secs, got.header.stamp.nsecs) == (12, 34)
    assert got.ns == "/ambf/env/Pad" and got.scale.x == got.pose.orientation.w == got.color.a == 1.0
    points = np.array([(p.x, p.y, p.z) for p in got.points])
    np.testing.assert_array_equal(points, state["tissue_node"][form.triangles.reshape(-1)])
    assert got.colors == [] and got.text == got.mesh_resource == ""
    plain = Marker(header=got.header, ns=got.ns, type=got.type, pose=got.pose, scale=got.scale, color=got.color,
                   points=got.points)  # fmt: skip
    stream = io.BytesIO()
    plain.serialize(stream)
    own = io.BytesIO()
    sent.serialize(own)
    assert stream.getvalue() == own.getvalue()


def test_punctures_are_poses_whose_z_axis_leaves_the_tissue(scene: Any) -> None:
    state = new_state(scene)[0]
    rng = np.random.default_rng(4)
    normals = np.vstack([rng.standard_normal((4, 3)), [[0, 0, 1], [0, 0, -1], [1, 0, 0]]])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points = rng.standard_normal((7, 3))
    state["puncture_count"][0] = 7
    state["puncture_point"][0, :7], state["puncture_normal"][0, :7] = points, normals
    got = read_back(tissue.PuncturesTemplate(scene, scene.tissues[0]).fill(state, rospy.Time(1)), PoseArray)
    assert [(p.position.x, p.position.y, p.position.z) for p in got.poses] == [tuple(p) for p in points.tolist()]
    for pose, normal in zip(got.poses, normals, strict=True):
        q = pose.orientation
        R = quaternion_matrix(np.array([q.x, q.y, q.z, q.w]))
        np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
        np.testing.assert_allclose(R[:, 2], normal, atol=1e-12)


def test_the_force_is_the_wrench_of_the_state(scene: Any) -> None:
    state = new_state(scene)[0]
    state["tissue_wrench"][0] = range(1, 7)
    got = read_back(tissue.ForceTemplate(scene, scene.tissues[0]).fill(state, rospy.Time(1)), WrenchStamped)
    f, t = got.wrench.force, got.wrench.torque
    assert (f.x, f.y, f.z, t.x, t.y, t.z) == (1, 2, 3, 4, 5, 6)


@pytest.mark.ros
def test_a_weight_on_a_pad_is_reported(path: Path, start: Callable[..., Program], listen: Callable[..., Any]) -> None:
    from diagnostic_msgs.msg import DiagnosticArray

    program = start(BIN / "ligature", "run", path, "-p", "200", "--min-hz", "50", "--max-hz", "50")
    program.wait_for("first state published", 120.0)
    force = listen("/ambf/env/Pad/TissueForce", WrenchStamped)
    mesh = listen("/ambf/env/Pad/TissueMesh", Marker)
    force.wait(lambda m: abs(m.wrench.force.z + 0.02 * 9.81) < 0.02)
    mesh.wait()
    assert mesh.comes_at(8, 12, 2.0)
    top = max(p.z for p in mesh.messages[-1].points)
    assert 0.303 < top < 0.3055
    assert listen("/ambf/env/Pad/TissuePunctures", PoseArray).wait().poses == []
    statuses = {s.name: s for s in listen("/diagnostics", DiagnosticArray).wait().status}
    values = {pair.key: pair.value for pair in statuses["ligature: tissue /ambf/env/Pad"].values}
    nodes = len(ligature.load(path).tissues[0].form.grid.nodes)
    assert (values["nodes"], values["punctures"]) == (str(nodes), "0")
    assert 1 <= int(values["contacts"]) <= 64
    assert 0.005 < float(values["peak force (N)"]) <= float(values["total force (N)"]) < 0.25
