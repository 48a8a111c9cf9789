"""Cameras on ROS, drawn by the software rasteriser: pictures, calibration, clouds, frames, parameters, and trouble."""

from __future__ import annotations

import io
import json
import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ligature.model.frames import inverse, pose7_matrix
from ligature.render.context import create_context
from PIL import Image as Pixels

from tests.opengl import opengl
from tests.ros.conftest import BIN, Program
from tests.waiting import stays, until

pytestmark = pytest.mark.ros

LENS = "field view angle: 0.9, clipping plane: {near: 0.05, far: 10}"
NS = "/ambf/env/cameras"
# flat discs that face the cameras: the centre of such a picture is the picture of the centre
BEADS = {"Bead": (-1.2, 0.3, 0.25), "Pin": (-1.5, -0.25, -0.3)}


def _bead(name: str) -> str:
    x, y, z = BEADS[name]
    return f"{name}: {{name: {name}, mass: 0, shape: CYLINDER, geometry: {{radius: 0.04, height: 0.0002, axis: x}}, location: {{position: {{x: {x}, y: {y}, z: {z}}}}}}}\n"


def _camera(name: str, y: float, more: str) -> str:
    return (
        f"{name}: {{name: {name}, namespace: cameras/, location: {{x: 0, y: {y}, z: 0}}, look at: {{x: -1, y: {y}, z: 0}}, "
        f"up: {{x: 0, y: 0, z: 1}}, {LENS}, {more}}}\n"
    )


SCENE = (
    "bodies: [Wall, Bead, Pin]\nlights: [L]\ncameras: [cameraL, cameraR, cameraS, cameraQ]\nnamespace: /ambf/env/\n"
    "Wall: {name: Wall, mass: 0, shape: BOX, geometry: {x: 0.2, y: 1.5, z: 1.5}, location: {position: {x: -2.1, y: 0, z: 0}}}\n"
    "L: {name: L, location: {x: 0, y: 0, z: 0}, direction: {x: -1, y: 0, z: 0}, cutoff angle: 1.5}\n"
    + _bead("Bead")
    + _bead("Pin")
    + _camera("cameraL", -0.03, "publish image: true, publish image interval: 12, publish depth: true, publish depth interval: 24")
    + _camera("cameraR", 0.03, "publish image: true, publish image interval: 12")
    + _camera("cameraS", 0.0, "publish depth: true, stereo: {mode: PASSIVE, eye separation: 0.06, focal length: 1}, "
              "publish image resolution: {width: 160, height: 120}")
    + _camera("cameraQ", 0.0, "publish image resolution: {width: 160, height: 120}")
)  # fmt: skip


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    with opengl():
        create_context().release()
    path = tmp_path_factory.mktemp("cameras") / "scene.yaml"
    path.write_text(SCENE)
    return path


@pytest.fixture(scope="module")
def simulator(start: Callable[..., Program], scene: Path, node: Any) -> Program:
    program = start(BIN / "ligature", "run", scene, "-p", "200")
    program.wait_for("render ready")
    return program


def pixels(message: Any) -> np.ndarray:
    """The array of an uncompressed picture."""
    dtype, channels = {"rgb8": ("u1", 3), "32FC1": ("<f4", 1), "32SC1": ("<i4", 1)}[message.encoding]
    return np.frombuffer(message.data, dtype).reshape(message.height, message.width, channels).squeeze()


def together(*listeners: Any, seconds: float = 15.0) -> list[Any]:
    """One message of each listener, all of one stamp."""

    def found() -> list[Any]:
        by_stamp = [{m.header.stamp: m for m in list(listener.messages)} for listener in listeners]
        common = set(by_stamp[0]).intersection(*by_stamp[1:])
        return [messages[max(common)] for messages in by_stamp] if common else []

    return until(found, "a common stamp", seconds)


def test_the_topics_are_those_of_the_interface_and_nothing_of_silent_cameras(simulator: Program, node: Any) -> None:
    topics = {name: type_ for name, type_ in node.get_published_topics(NS) if not name.endswith("/State")}
    every = {
        "CameraInfo": "sensor_msgs/CameraInfo",
        "DepthImage": "sensor_msgs/Image",
        "IdImage": "sensor_msgs/Image",
        "IdNames": "std_msgs/String",
        "ImageData": "sensor_msgs/Image",
        "ImageData/compressed": "sensor_msgs/CompressedImage",
    }
    cloud = {"DepthData": "sensor_msgs/PointCloud2"}
    wanted = {"cameraL": every | cloud, "cameraR": every}
    wanted |= {f"cameraS{eye}": every | cloud for eye in ("", "/left", "/right")}
    assert topics == {f"{NS}/{c}/{topic}": type_ for c, found in wanted.items() for topic, type_ in found.items()}


def test_left_and_right_carry_one_stamp_and_the_pictures_are_rgb_top_row_first(
    simulator: Program, listen: Callable[..., Any]
) -> None:
    from sensor_msgs.msg import CameraInfo, Image

    before = time.time()
    listeners = [listen(f"{NS}/camera{side}/{topic}", type_) for side in "LR" for topic, type_ in (("ImageData", Image), ("CameraInfo", CameraInfo))]  # fmt: skip
    left, left_info, right, _ = together(*listeners)
    assert before - 1.0 < left.header.stamp.to_sec() < time.time()
    assert left.header.frame_id == left_info.header.frame_id == "cameraL_optical"
    assert (left.width, left.height, left.encoding, left.step) == (640, 480, "rgb8", 1920)
    assert (right.width, right.height) == (640, 480)
    assert pixels(left)[240, 320].min() > 20, "the wall is lit"
    assert len(listeners[0].messages) < 100 and listeners[0].comes_at(0, 11)


def test_the_compressed_picture_shows_the_same(simulator: Program, listen: Callable[..., Any]) -> None:
    from sensor_msgs.msg import CompressedImage, Image

    raw, jpeg = together(listen(f"{NS}/cameraL/ImageData", Image), listen(f"{NS}/cameraL/ImageData/compressed", CompressedImage))  # fmt: skip
    assert jpeg.format == "rgb8; jpeg compressed bgr8"
    decoded = np.asarray(Pixels.open(io.BytesIO(jpeg.data)).convert("RGB"), dtype=float)
    assert np.abs(decoded - pixels(raw)).mean() < 3


def test_the_cloud_is_the_depth_picture_in_the_camera_frame(simulator: Program, listen: Callable[..., Any]) -> None:
    from sensor_msgs.msg import CameraInfo, Image, PointCloud2

    cloud, depth, rgb, info = together(
        listen(f"{NS}/cameraL/DepthData", PointCloud2), listen(f"{NS}/cameraL/DepthImage", Image),
        listen(f"{NS}/cameraL/ImageData", Image), listen(f"{NS}/cameraL/CameraInfo", CameraInfo),
    )  # fmt: skip
    assert (cloud.width, cloud.height, cloud.header.frame_id) == (640, 480, "cameraL")
    assert [f.name for f in cloud.fields] == ["x", "y", "z", "rgb"] and cloud.point_step == 16
    values = np.frombuffer(cloud.data, "<f4").reshape(480, 640, 4)[::-1]
    z, K = pixels(depth), np.reshape(info.K, (3, 3))
    solid = np.isfinite(z)
    assert solid.any() and not solid.all() and np.isnan(values[~solid][:, :3]).all()
    u, v = np.meshgrid(np.arange(640), np.arange(480))
    expected = np.stack([-z, (u - K[0, 2]) * z / K[0, 0], -(v - K[1, 2]) * z / K[1, 1]], axis=-1)
    assert np.allclose(values[solid][:, :3], expected[solid], atol=1e-5)
    packed = values[..., 3].copy().view("<u4")
    colour = pixels(rgb)
    assert (packed == (colour[..., 0].astype("u4") << 16 | colour[..., 1].astype("u4") << 8 | colour[..., 2])).all()


def _frames(listener: Any) -> dict[str, tuple[str, np.ndarray]]:
    found = {}
    for message in list(listener.messages):
        for t in message.transforms:
            p, q = t.transform.translation, t.transform.rotation
            found[t.child_frame_id] = (t.header.frame_id, pose7_matrix([p.x, p.y, p.z, q.x, q.y, q.z, q.w]))
    return found


def test_known_points_project_onto_their_pixels_through_tf_and_camera_info(
    simulator: Program, listen: Callable[..., Any]
) -> None:
    from sensor_msgs.msg import CameraInfo, Image
    from std_msgs.msg import String
    from tf2_msgs.msg import TFMessage

    tf, static = listen("/tf", TFMessage), listen("/tf_static", TFMessage)
    names = listen(f"{NS}/cameraR/IdNames", String)
    table = {name: int(number) for number, name in json.loads(names.wait().data).items()}
    for side in "LR":
        info, ids = together(listen(f"{NS}/camera{side}/CameraInfo", CameraInfo), listen(f"{NS}/camera{side}/IdImage", Image))  # fmt: skip
        tf.wait(lambda m, side=side: any(t.child_frame_id == f"camera{side}" for t in m.transforms))
        moving, fixed = _frames(tf), _frames(static)
        assert moving[f"camera{side}"][0] == "world" and fixed[f"camera{side}_optical"][0] == f"camera{side}"
        T = inverse(moving[f"camera{side}"][1] @ fixed[f"camera{side}_optical"][1])
        for bead, point in BEADS.items():
            rows, columns = np.nonzero(pixels(ids) == table[f"/ambf/env/{bead}"])
            x = np.reshape(info.K, (3, 3)) @ (T[:3, :3] @ point + T[:3, 3])
            assert np.abs(np.array([columns.mean(), rows.mean()]) - x[:2] / x[2]).max() < 0.1
        baseline = -np.reshape(info.P, (3, 4))[0, 3] / info.P[0]
        assert baseline == pytest.approx({"L": 0.0, "R": 0.06}[side])


def test_facts_project_known_points_onto_their_pixels_and_follow_the_camera(
    simulator: Program, node: Any, listen: Callable[..., Any], publish: Callable[..., Any]
) -> None:
    """A point of the world goes through `T_camera_world` and K to the pixel where the picture has it; so says no tf."""
    from ambf_msgs.msg import CameraCmd
    from sensor_msgs.msg import CameraInfo

    name = f"{NS}/cameraL/facts"
    until(lambda: node.has_param(f"{name}/K"), "the facts are written", 20.0)
    found = node.get_param(name)
    info = listen(f"{NS}/cameraL/CameraInfo", CameraInfo).wait()
    assert found["K"] == pytest.approx(info.K) and (found["width"], found["height"]) == (info.width, info.height)
    assert found["frame"] == info.header.frame_id and found["pixel_radius"] == pytest.approx(0.5 / info.K[0])
    K, T = np.reshape(found["K"], (3, 3)), np.reshape(found["T_camera_world"], (4, 4))
    for x, y, z in BEADS.values():
        seen = (T @ [x, y, z, 1.0])[:3]
        # the camera is at y = -0.03 and looks along -x, with z up
        assert seen == pytest.approx([y + 0.03, -z, -x], abs=1e-6)
        u, v, _ = K @ seen / seen[2]
        assert 0.0 < u < info.width and 0.0 < v < info.height
    place = publish(f"{NS}/cameraL/Command", CameraCmd)
    command = CameraCmd(enable_position_controller=True)
    command.pose.position.y, command.pose.orientation.w = 0.1, 1.0

    def moved() -> bool:
        place.publish(command)
        return abs(np.reshape(node.get_param(name)["T_camera_world"], (4, 4))[0, 3] + 0.1) < 1e-6

    until(moved, "the facts follow", 20.0, 0.05)
    command.pose.position.y = -0.03
    until(
        lambda: place.publish(command) or abs(node.get_param(name)["T_camera_world"][3] - 0.03) < 1e-6,
        "back",
        20.0,
        0.05,
    )


def test_the_eyes_of_a_stereo_camera_are_a_pair(simulator: Program, listen: Callable[..., Any]) -> None:
    from sensor_msgs.msg import CameraInfo, Image
    from tf2_msgs.msg import TFMessage

    left, right, info = together(
        listen(f"{NS}/cameraS/left/IdImage", Image), listen(f"{NS}/cameraS/right/IdImage", Image),
        listen(f"{NS}/cameraS/right/CameraInfo", CameraInfo),
    )  # fmt: skip
    assert info.header.frame_id == right.header.frame_id == "cameraS_right_optical"
    assert -info.P[3] / info.P[0] == pytest.approx(0.06)
    assert np.nonzero(pixels(left) == 2)[1].mean() > np.nonzero(pixels(right) == 2)[1].mean()
    static = listen("/tf_static", TFMessage)
    static.wait()
    parent, T = _frames(static)["cameraS_left"]
    assert parent == "cameraS" and np.allclose(T[:3, 3], [0, -0.03, 0])


def test_parameters_change_lenses_and_faults_of_a_running_camera(
    simulator: Program, node: Any, listen: Callable[..., Any]
) -> None:
    from sensor_msgs.msg import CameraInfo

    infos = listen(f"{NS}/cameraR/CameraInfo", CameraInfo)
    assert infos.wait().K[0] == pytest.approx(240 / np.tan(0.45))
    node.set_param(f"{NS}/cameraR/near_plane", -1.0)
    simulator.wait_for("near_plane is -1.0; expected a number of at least 0")
    node.set_param(f"{NS}/cameraR/near_plane", 0.05)
    node.set_param(f"{NS}/cameraR/field_view_angle", 0.6)
    node.set_param(f"{NS}/cameraR/sensor/distortion", [-0.1, 0, 0, 0, 0])
    info = infos.wait(lambda m: m.D[0] != 0)
    assert info.K[0] == pytest.approx(240 / np.tan(0.3)) and info.D[0] == -0.1
    node.set_param(f"{NS}/cameraR/field_view_angle", 0.9)
    node.set_param(f"{NS}/cameraR/sensor/distortion", [0, 0, 0, 0, 0])


def test_parameters_change_the_light_of_a_running_scene(
    simulator: Program, node: Any, listen: Callable[..., Any]
) -> None:
    from sensor_msgs.msg import Image

    images = listen(f"{NS}/cameraL/ImageData", Image)
    bright = pixels(images.wait())[240, 180].astype(int).sum()
    node.set_param("/ambf/env/L/cutoff_angle", 0.05)
    images.wait(lambda m: pixels(m)[240, 180].astype(int).sum() < 0.6 * bright)
    node.set_param("/ambf/env/L/type", "POINT")
    images.wait(lambda m: pixels(m)[240, 180].astype(int).sum() > 0.9 * bright)
    node.set_param("/ambf/env/L/type", "SPOT")
    node.set_param("/ambf/env/L/cutoff_angle", 1.5)


def test_a_new_parent_name_carries_the_camera_along(simulator: Program, node: Any, listen: Callable[..., Any]) -> None:
    from ambf_msgs.msg import CameraState
    from tf2_msgs.msg import TFMessage

    states, tf = listen(f"{NS}/cameraR/State", CameraState), listen("/tf", TFMessage)
    local = states.wait().pose.position
    node.set_param(f"{NS}/cameraR/parent_name", "Pin")
    state = states.wait(lambda m: m.parent_name.data == "/ambf/env/Pin")
    assert (state.pose.position.x, state.pose.position.y) == (local.x, local.y)
    wanted = np.add(BEADS["Pin"], (0.0, 0.03, 0.0))
    until(
        lambda: np.allclose(_frames(tf).get("cameraR", ("", np.eye(4)))[1][:3, 3], wanted, atol=1e-6), "the new frame"
    )
    node.set_param(f"{NS}/cameraR/parent_name", "")
    states.wait(lambda m: m.parent_name.data == "")


def test_clouds_of_clients_are_drawn_where_they_are(
    simulator: Program, node: Any, listen: Callable[..., Any], publish: Callable[..., Any]
) -> None:
    """As AMBF's example does: a list of topics in a parameter, a cloud in the frame of a body, its size in pixels."""
    from geometry_msgs.msg import Point32
    from sensor_msgs.msg import Image, PointCloud
    from std_msgs.msg import Float32

    topics = node.get_param("/ambf/env/World/point_cloud_topics")
    node.set_param("/ambf/env/World/point_cloud_topics", [*topics, "/own_cloud"])
    cloud, size = publish("/own_cloud", PointCloud), publish("/own_cloud/radius", Float32)
    message = PointCloud()
    message.header.frame_id = "/ambf/env/Wall"  # at x = -2.1; its face at -2
    message.points = [Point32(1.1, 0.03, 0.0), Point32(0.0, 0.2, 0.2)]  # one before the face, one inside the wall
    size.publish(Float32(5.0))
    depth = listen(f"{NS}/cameraR/DepthImage", Image)

    def drawn(message: Any) -> bool:
        return abs(float(pixels(message)[message.height // 2, message.width // 2]) - 1.0) < 0.01

    def sent() -> bool:
        cloud.publish(message)
        return bool(depth.messages) and drawn(depth.messages[-1])

    until(sent, "the point in the middle of the picture", 20.0, 0.2)
    shown = pixels(depth.messages[-1])
    assert int((shown < 1.05).sum()) == 25
    assert (shown[(shown > 1.05)] >= 1.1).all()
    node.set_param("/ambf/env/World/point_cloud_topics", topics)
    until(lambda: not drawn(depth.messages[-1]), "the cloud goes with its topic", 20.0)


def test_diagnostics_count_frames(simulator: Program, listen: Callable[..., Any]) -> None:
    from diagnostic_msgs.msg import DiagnosticArray

    values = {v.key: v.value for v in listen("/diagnostics", DiagnosticArray).wait().status[0].values}
    assert int(values["camera frames drawn"]) > 10 and int(values["camera frames dropped"]) >= 0
    assert float(values["camera frame time (ms)"]) > 0


def test_a_killed_camera_process_comes_back(simulator: Program, listen: Callable[..., Any]) -> None:
    from ambf_msgs.msg import WorldState
    from sensor_msgs.msg import Image

    images, world = listen(f"{NS}/cameraL/ImageData", Image), listen("/ambf/env/World/State", WorldState)
    images.wait()
    before = world.wait().sim_time
    os.kill(simulator.children()["render_process"], signal.SIGKILL)
    simulator.wait_for("the render process ended with status -9; restarting it")
    seen = images.messages[-1].header.stamp
    images.wait(lambda m: m.header.stamp.to_sec() > seen.to_sec() + 0.5, seconds=30)
    assert world.messages[-1].sim_time > before + 0.5


def test_without_opengl_the_simulator_reports_it_and_runs_on(
    start: Callable[..., Program], scene: Path, ros_env: dict[str, str], listen: Callable[..., Any]
) -> None:
    from ambf_msgs.msg import WorldState

    env = dict(ros_env, __EGL_VENDOR_LIBRARY_DIRS="/nonexistent", __EGL_VENDOR_LIBRARY_FILENAMES="/nonexistent.json")
    program = start(BIN / "ligature", "run", scene, "--ns", "/blind", env=env)
    program.wait_for("the simulator runs on without cameras")
    assert "no pictures: no OpenGL 3.3 context through EGL" in program.output
    listener = listen("/blind/ambf/env/World/State", WorldState)
    before = listener.wait().sim_time
    listener.wait(lambda m: m.sim_time > before + 0.5)
    until(lambda: "render_process" not in program.children(), "the end of the render process")
    assert not [line for line in program.lines if "render process ended" in line]


def test_cameras_are_left_out_when_asked(start: Callable[..., Program], scene: Path, node: Any) -> None:
    program = start(BIN / "ligature", "run", scene, "--ns", "/none", "--no-cameras")
    program.wait_for("first state published")
    stays(lambda: "render_process" not in program.children(), "no render process", 0.5)
