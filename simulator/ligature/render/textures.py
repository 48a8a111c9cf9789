"""Picture files as OpenGL textures with mipmaps, each loaded once."""

from __future__ import annotations

from pathlib import Path

import moderngl
from PIL import Image

from ligature.adf import AdfError
from ligature.model.pictures import read_picture, unreadable


class Textures:
    """The textures of one context by path."""

    def __init__(self, context: moderngl.Context, problems: list[AdfError]) -> None:
        self._context, self._problems = context, problems
        self._loaded: dict[Path, moderngl.Texture | None] = {}
        self.white = context.texture((1, 1), 4, b"\xff" * 4)
        """Replaces a texture that a shader needs and a surface lacks."""

        self.around = context.texture_cube((1, 1), 4, b"\xff" * 24)
        """What surrounds the scene: its sky box; white where it has none."""

        self.lit = context.depth_texture((1, 1), b"\xff" * 4)
        """Stands in for a shadow map where there is no shadow."""
        self.lit.compare_func = "<="

    def get(self, path: Path | None) -> moderngl.Texture | None:
        """The texture of ``path``; None when it does not exist or is no picture, which the problems then state."""
        if path is None:
            return None
        if path not in self._loaded:
            self._loaded[path] = self._load(path)
        return self._loaded[path]

    def _load(self, path: Path) -> moderngl.Texture | None:
        try:
            image = read_picture(path).convert("RGBA").transpose(Image.Transpose.FLIP_TOP_BOTTOM)
        except FileNotFoundError:
            return None  # as the mesh reader has stated
        except (OSError, ValueError) as error:
            self._problems.append(AdfError(unreadable(path, error)))
            return None
        if max(image.size) > self._context.info["GL_MAX_TEXTURE_SIZE"]:
            image.thumbnail((self._context.info["GL_MAX_TEXTURE_SIZE"],) * 2)
        texture = self._context.texture(image.size, 4, image.tobytes())
        texture.build_mipmaps()
        texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        return texture
