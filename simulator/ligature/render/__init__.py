"""Cameras: colour, linear depth, object ids and normals of a scene, drawn by OpenGL without a display."""

from ligature.render.camera import CameraView, unproject, view_of
from ligature.render.context import RenderUnavailable
from ligature.render.renderer import Frame, Renderer
from ligature.render.sensor import ImageSensor

__all__ = ["CameraView", "Frame", "ImageSensor", "RenderUnavailable", "Renderer", "unproject", "view_of"]
