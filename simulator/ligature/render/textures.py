"""Picture files as OpenGL textures with mipmaps, each loaded once."""

from __future__ import annotations

from pathlib import Path

import moderngl
from PIL import Image


class Textures:
    """The textures of one context by path."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._loaded: dict[Path, moderngl.Texture | None] = {}
        self.white = context.texture((1, 1), 4, b"\xff" * 4)
        """Stands in where a shader wants a texture that a surface lacks."""

        self.lit = context.depth_texture((1, 1), b"\xff" * 4)
        """Stands in for a shadow map where there is no shadow."""
        self.lit.compare_func = "<="

    def get(self, path: Path | None) -> moderngl.Texture | None:
        """The texture of ``path``; None when it is not a picture, as the mesh reader has reported."""
        if path is None:
            return None
        if path not in self._loaded:
            self._loaded[path] = self._load(path)
        return self._loaded[path]

    def _load(self, path: Path) -> moderngl.Texture | None:
        try:
            with Image.open(path) as picture:
                image = picture.convert("RGBA").transpose(Image.Transpose.FLIP_TOP_BOTTOM)
        except (OSError, Image.DecompressionBombError):
            return None
        if max(image.size) > self._context.info["GL_MAX_TEXTURE_SIZE"]:
            image.thumbnail((self._context.info["GL_MAX_TEXTURE_SIZE"],) * 2)
        texture = self._context.texture(image.size, 4, image.tobytes())
        texture.build_mipmaps()
        texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        return texture
