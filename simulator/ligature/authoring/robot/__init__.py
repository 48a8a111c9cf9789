"""Robots of URDF and SDF files: read into one description, which becomes objects of the format and is made of them."""

from ligature.authoring.robot.description import Joint, Link, MeshFile, PlacedShape, Robot, RobotError
from ligature.authoring.robot.from_adf import Exported, exported
from ligature.authoring.robot.sdf import read_sdf, sdf_text
from ligature.authoring.robot.to_adf import to_adf
from ligature.authoring.robot.urdf import read_urdf, urdf_text

__all__ = [
    "Exported", "Joint", "Link", "PlacedShape", "MeshFile", "Robot", "RobotError", "exported", "read_sdf", "read_urdf",
    "sdf_text", "to_adf", "urdf_text",
]  # fmt: skip
