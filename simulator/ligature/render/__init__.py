"""Cameras: colour, linear depth, object ids and normals of a scene, drawn by OpenGL without a display."""

from ligature.render.camera import CameraView, view_of
from ligature.render.context import RenderUnavailable
from ligature.render.renderer import Frame, Renderer

__all__ = ["CameraView", "Frame", "RenderUnavailable", "Renderer", "view_of"]
