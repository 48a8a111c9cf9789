"""Cameras: colour, linear depth, object ids and normals of a scene, drawn by OpenGL without a display."""

from ligature.render.camera import CameraView, unproject, view_of
from ligature.render.context import RenderUnavailable
from ligature.render.lights import LightKind, LightSettings
from ligature.render.renderer import Renderer
from ligature.render.sensor import ImageSensor
from ligature.render.target import PASSES, Frame

__all__ = [
    "PASSES",
    "CameraView",
    "Frame",
    "ImageSensor",
    "LightKind",
    "LightSettings",
    "RenderUnavailable",
    "Renderer",
    "unproject",
    "view_of",
]
