"""The sky box of a world file: six pictures around everything (as in AMBF)."""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np
from PIL import Image

from ligature.adf import AdfError, Diagnostic, Mark, Resolver, Severity
from ligature.model.pictures import PictureError, read_picture
from ligature.model.scene import Scene
from ligature.render.camera import CameraView
from ligature.render.programs import Program, source

FACES = ("right", "left", "bottom", "top", "front", "back")
"""Names of the pictures in the order of the cube's faces +X, -X, +Y, -Y, +Z, -Z, as the format has it."""


class Sky:
    """Six pictures as a cube, drawn where nothing else is."""

    def __init__(self, context: moderngl.Context, pictures: list[Image.Image]) -> None:
        self._context = context
        size = min(pictures[0].size)
        faces = b"".join(picture.convert("RGB").resize((size, size)).tobytes() for picture in pictures)
        self.cube = context.texture_cube((size, size), 3, faces, alignment=1)
        self.cube.build_mipmaps()
        header = "#version 330 core\n"
        self._program = Program(context.program(header + source("sky.vert"), header + source("sky.frag")))
        self._array = context.vertex_array(self._program.linked, [])

    @classmethod
    def of(
        cls, context: moderngl.Context, scene: Scene, resolver: Resolver | None, problems: list[AdfError]
    ) -> Sky | None:
        """The sky of a scene; None when it has none, or its pictures cannot be read, which ``problems`` then states."""
        if scene.world.skybox is None:
            return None
        pictures = []
        for face in FACES:
            path = Path(scene.world.skybox[face])
            try:
                allowed = (resolver or Resolver([path.parent])).allow(path)
                pictures.append(read_picture(allowed))
            except AdfError as error:
                problems.append(error)
                return None
            except (OSError, PictureError) as error:
                message = f"sky box: the picture of its {face} cannot be read: {error}"
                problems.append(AdfError(Diagnostic(Severity.WARNING, message, Mark(path, 1, 1), "", "render")))
                return None
        return cls(context, pictures)

    def draw(self, buffer: moderngl.Framebuffer, view: CameraView) -> None:
        """Fill what is still empty of ``buffer``."""
        buffer.use()
        self._context.enable_only(moderngl.DEPTH_TEST)
        self._context.depth_func = "<="
        self._program.write("uWorldFromClip", np.linalg.inv(view.projection[:, :] @ _turned(view.view)))
        self.cube.use(0)
        self._array.render(moderngl.TRIANGLES, vertices=3)
        self._context.depth_func = "<"


def _turned(view: np.ndarray) -> np.ndarray:
    """``view`` (4, 4) without its shift: the sky is infinitely far."""
    turned = np.array(view)
    turned[:3, 3] = 0.0
    return turned
