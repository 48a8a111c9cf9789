"""Runs ``depth compute shaders`` of a scene file over a depth picture (as in AMBF)."""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import NDArray

from ligature.render import legacy
from ligature.render.camera import CameraView
from ligature.render.geometry import Triangles
from ligature.render.programs import Program

_QUAD = Triangles(
    np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]),
    np.tile([0.0, 0.0, 1.0], (4, 1)),
    np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]),
    np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32),
)


def computed_points(
    context: moderngl.Context, program: Program, depth: NDArray[np.float32], view: CameraView
) -> NDArray[np.float32]:
    """The colours (h, w, 3), taken for coordinates, that ``program`` writes for linear ``depth`` (h, w), row 0 on top.

    The program draws a square that fills the picture; ``diffuseMap`` is the depth buffer, 0 at the near and 1 at
    the far plane, and ``invProjection`` leads from clip to eye coordinates.
    """
    height, width = depth.shape
    size = (width, height)
    stored = context.texture(size, 1, depth_buffer(depth, view)[::-1].astype("f4").tobytes(), dtype="f4")
    stored.filter = (moderngl.NEAREST, moderngl.NEAREST)
    written = context.texture(size, 4, dtype="f4")
    buffer = context.framebuffer([written])
    buffer.use()
    buffer.clear()
    context.disable(moderngl.DEPTH_TEST | moderngl.CULL_FACE | moderngl.BLEND)
    program.write("invProjection", np.linalg.inv(view.projection))
    legacy.bind_object(program, np.eye(4), np.eye(4))
    program.set("uTextureEnabled", True)
    stored.use(legacy.DIFFUSE_UNIT)
    legacy.LegacyBuffers(context, _QUAD).array(program).render()
    points = np.frombuffer(written.read(), dtype="f4").reshape(height, width, 4)[::-1, :, :3]
    return np.ascontiguousarray(points)


def depth_buffer(depth: NDArray[np.float32], view: CameraView) -> NDArray[np.float64]:
    """What OpenGL's depth buffer would hold, 0..1, where linear depth (h, w) is ``depth``; 1 where nothing is."""
    z = np.where(np.isfinite(depth), depth, view.far).astype(float)
    p = view.projection
    clip, w = p[2, 3] - p[2, 2] * z, p[3, 3] - p[3, 2] * z
    stored: NDArray[np.float64] = np.where(np.isfinite(depth), 0.5 + 0.5 * clip / w, 1.0)
    return stored
