"""The camera node: pictures, calibrations, clouds and frames of cameras on ROS.

It publishes pictures that another process draws. Frames: ``<camera>`` is the camera frame of AMBF,
``<camera>_optical`` beside it is ROS's, and both hang below ``world``. All begin with the prefix of the scene.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import rospy
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, PointCloud2
from std_msgs.msg import Header, String
from tf2_msgs.msg import TFMessage

from ligature.model.frames import frame, matrix_pose7
from ligature.model.naming import topic_name
from ligature.model.optics import EYES, R_CAMERA_OPTICAL, Calibration, eye_offset
from ligature.model.scene import Camera, Scene
from ligature.ros import pictures
from ligature.ros.master import node_name
from ligature.ros.names import WORLD_FRAME, tf_topics
from ligature.ros.start import start_node

PICTURES = {
    "ImageData": Image,
    "ImageData/compressed": CompressedImage,
    "CameraInfo": CameraInfo,
    "DepthImage": Image,
    "IdImage": Image,
}


_PASS = {"ImageData": "rgb", "ImageData/compressed": "rgb", "DepthImage": "depth", "IdImage": "ids"}
"""What a topic shows."""


@dataclass(frozen=True)
class Wishes:
    """What clients of one camera listen to, of what is due."""

    picture_due: bool
    info: bool
    passes: frozenset[str]
    cloud: bool

    @property
    def drawing(self) -> bool:
        """Whether anything has to be drawn."""
        return bool(self.passes) or self.cloud


@dataclass(frozen=True, eq=False)
class Picture:
    """What was seen: ``rgb`` (h, w, 3), ``depth`` (h, w) metres, ``ids`` (h, w), row 0 at the top; or empty arrays."""

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    ids: NDArray[np.int32]


class CameraTopics:
    """The topics of one camera, or of one of its eyes."""

    def __init__(self, camera: Camera, eye: str, name: str, names: String, image: bool, depth: bool) -> None:
        self.camera, self.eye = camera, eye
        self.frame = f"{name}_{eye}" if eye else name
        self.optical_frame = f"{self.frame}_optical"
        base = f"{camera.identity.topic}/{eye}" if eye else camera.identity.topic
        self._pictures = {topic: _advertise(f"{base}/{topic}", type_) for topic, type_ in PICTURES.items()}
        self._cloud = _advertise(f"{base}/DepthData", PointCloud2) if depth else None
        self._names = rospy.Publisher(f"{base}/IdNames", String, queue_size=1, latch=True)
        self._names.publish(names)
        self.image_interval = camera.image_interval if image else camera.depth_interval
        self.depth_interval = camera.depth_interval if depth else None

    @property
    def count(self) -> int:
        """Topics of this camera."""
        return len(self._pictures) + 1 + (self._cloud is not None)

    def wishes(self, picture_due: bool, cloud_due: bool) -> Wishes:
        """What clients listen to, of what is due."""
        heard = [topic for topic in self._pictures if picture_due and self._heard(topic)]
        cloud = cloud_due and self._cloud is not None and _heard(self._cloud)
        return Wishes(picture_due, "CameraInfo" in heard, frozenset(_PASS[t] for t in heard if t in _PASS), cloud)

    def publish_info(self, calibration: Calibration, stamp: float) -> None:
        """Publish the calibration; ``stamp`` in Unix seconds, as everywhere here."""
        self._send("CameraInfo", pictures.camera_info(calibration, _header(stamp, self.optical_frame)))

    def publish_picture(self, picture: Picture, stamp: float) -> None:
        """Publish the drawn pictures to their subscribers."""
        header = _header(stamp, self.optical_frame)
        if picture.rgb.size and self._heard("ImageData"):
            self._send("ImageData", pictures.image(picture.rgb, "rgb8", header))
        if picture.rgb.size and self._heard("ImageData/compressed"):
            self._send("ImageData/compressed", pictures.compressed(picture.rgb, header))
        if picture.depth.size and self._heard("DepthImage"):
            self._send("DepthImage", pictures.image(picture.depth, "32FC1", header))
        if picture.ids.size and self._heard("IdImage"):
            self._send("IdImage", pictures.image(picture.ids, "32SC1", header))

    def publish_cloud(self, points: NDArray[np.float32], rgb: NDArray[np.uint8], stamp: float) -> None:
        """Publish ``points`` (h, w, 3) of the optical frame as a cloud in the camera frame."""
        if self._cloud is not None:
            self._cloud.publish(pictures.cloud(points, rgb, _header(stamp, self.frame)))

    def _heard(self, topic: str) -> bool:
        return _heard(self._pictures[topic])

    def _send(self, topic: str, message: Any) -> None:
        self._pictures[topic].publish(message)


class CameraNode:
    """Every camera in ``shown``, as ROS topics and frames; ``everything`` gives images and clouds of all of them.

    Raises `ligature.ros.registrations.NameTaken` when another simulator already publishes these cameras.
    """

    def __init__(self, scene: Scene, shown: Sequence[Camera], everything: bool) -> None:
        name = f"{node_name(scene.world.topic)}_cameras"
        start_node(name)
        prefix = scene.world.frame_prefix
        frames = [prefix + name for name in frame_names(scene.cameras)]
        names = pictures.id_names(scene)
        self.topics = [
            CameraTopics(c, eye, frames[c.index], names, everything or c.publish_image, everything or c.publish_depth)
            for c in shown
            for eye in ("", *(EYES if c.stereo else ()))
        ]
        self._frames, self._world = frames, prefix + WORLD_FRAME
        self._tf = [rospy.Publisher(topic, TFMessage, queue_size=10) for topic in tf_topics(scene.world, "tf")]
        self._static = [
            rospy.Publisher(topic, TFMessage, queue_size=1, latch=True) for topic in tf_topics(scene.world, "tf_static")
        ]
        fixed = TFMessage([t for topics in self.topics for t in self._fixed(topics)])
        for publisher in self._static:
            publisher.publish(fixed)

    def publish_frames(self, poses: NDArray[np.float64], shown: Sequence[Camera], stamp: float) -> None:
        """Publish where the cameras ``shown`` stand; ``poses`` (cameras, 7) in world axes."""
        indices = sorted({camera.index for camera in shown})
        heard = [publisher for publisher in self._tf if _heard(publisher)]
        if indices and heard:
            time = rospy.Time.from_sec(stamp)
            frames = [pictures.transform(self._world, self._frames[i], poses[i], time) for i in indices]
            for publisher in heard:
                publisher.publish(TFMessage(frames))

    def _fixed(self, topics: CameraTopics) -> list[Any]:
        """Transforms that never change: from the camera to its eye, and to the optical frame."""
        stamp = rospy.Time.now()
        turned = matrix_pose7(frame(R_CAMERA_OPTICAL, (0.0, 0.0, 0.0)))
        found = [pictures.transform(topics.frame, topics.optical_frame, turned, stamp)]
        if topics.eye:
            aside = np.array([0.0, eye_offset(topics.camera, topics.eye), 0.0, 0.0, 0.0, 0.0, 1.0])
            found.append(pictures.transform(self._frames[topics.camera.index], topics.frame, aside, stamp))
        return found


def frame_names(cameras: Sequence[Camera]) -> list[str]:
    """Frame of each camera: its name, or that after its namespace where several have one name."""
    count = Counter(c.identity.name for c in cameras)
    return [
        c.identity.name
        if count[c.identity.name] == 1
        else topic_name(c.identity.namespace, c.identity.name).strip("/").replace("/", "_")
        for c in cameras
    ]


def _advertise(topic: str, type_: Any) -> rospy.Publisher:
    """A publisher whose slow clients miss messages: one waits for each client, the newest."""
    return rospy.Publisher(topic, type_, queue_size=1, tcp_nodelay=True)


def _heard(publisher: rospy.Publisher) -> bool:
    return bool(publisher.get_num_connections())


def _header(stamp: float, frame_id: str) -> Header:
    return Header(0, rospy.Time.from_sec(stamp), frame_id)
