"""From arrays to picture messages: plain functions, no ROS node.

Pictures have row 0 at the top and are in optical frames (x right, y down, z forward); point clouds are in the
camera frame (looks along -X, +Y right, +Z up) and begin with the bottom row (as in AMBF). Metres.
"""

from __future__ import annotations

import io
import json
from typing import Any

import numpy as np
from geometry_msgs.msg import TransformStamped
from numpy.typing import NDArray
from PIL import Image as Pixels
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, PointCloud2, PointField
from std_msgs.msg import Header, String

from ligature.model.optics import Calibration
from ligature.model.scene import Scene

JPEG_QUALITY = 80
"""As image_transport's default."""

_POINT_BYTES = 16
_FIELDS = [PointField(name, 4 * i, PointField.FLOAT32, 1) for i, name in enumerate(("x", "y", "z", "rgb"))]
_DTYPES = {"rgb8": "u1", "32FC1": "<f4", "32SC1": "<i4"}


def image(pixels: NDArray[Any], encoding: str, header: Header) -> Image:
    """An uncompressed picture (h, w) or (h, w, 3) of ``encoding`` rgb8, 32FC1 or 32SC1."""
    data = np.ascontiguousarray(pixels, dtype=_DTYPES[encoding])
    height, width = data.shape[:2]
    return Image(header, height, width, encoding, 0, data.nbytes // height, data.tobytes())


def compressed(rgb: NDArray[np.uint8], header: Header) -> CompressedImage:
    """A JPEG picture, named as image_transport names it."""
    stream = io.BytesIO()
    Pixels.fromarray(rgb).save(stream, "JPEG", quality=JPEG_QUALITY)
    return CompressedImage(header, "rgb8; jpeg compressed bgr8", stream.getvalue())


def camera_info(calibration: Calibration, header: Header) -> CameraInfo:
    """The calibration of a camera."""
    message = CameraInfo(header=header, height=calibration.height, width=calibration.width)
    message.distortion_model = "plumb_bob"
    message.D = calibration.D.tolist()
    message.K = calibration.K.ravel().tolist()
    message.R = calibration.R.ravel().tolist()
    message.P = calibration.P.ravel().tolist()
    return message


def cloud(points: NDArray[np.float32], rgb: NDArray[np.uint8], header: Header) -> PointCloud2:
    """Organised cloud of ``points`` (h, w, 3) in the optical frame, top row first; NaN where nothing is."""
    height, width = points.shape[:2]
    data = np.empty((height, width, 4), dtype="<f4")
    data[..., 0] = -points[::-1, :, 2]
    data[..., 1] = points[::-1, :, 0]
    data[..., 2] = -points[::-1, :, 1]
    colour = rgb[::-1].astype("<u4")
    data[..., 3] = (colour[..., 0] << 16 | colour[..., 1] << 8 | colour[..., 2]).view("<f4")
    row = _POINT_BYTES * width
    return PointCloud2(header, height, width, _FIELDS, False, _POINT_BYTES, row, data.tobytes(), False)


def id_names(scene: Scene) -> String:
    """The table from the numbers of an id picture to identifiers, as JSON; 0 is the background."""
    return String(json.dumps({str(number): name for number, name in scene.drawn_names.items()}))


def transform(parent: str, child: str, pose: NDArray[np.float64], stamp: Any) -> TransformStamped:
    """Pose (7,) of frame ``child`` in frame ``parent``."""
    message = TransformStamped(child_frame_id=child)
    message.header.frame_id, message.header.stamp = parent, stamp
    p, q = message.transform.translation, message.transform.rotation
    p.x, p.y, p.z, q.x, q.y, q.z, q.w = pose.tolist()
    return message
