"""A drop-in ``ambf_client`` for machines without AMBF: object handles over ROS 1 topics.

Poses of bodies are in the world, those of cameras, lights, ghosts and sensors in their parent's frame; SI units;
quaternions x, y, z, w; roll, pitch, yaw about fixed x, y, z. Nothing of the simulation is imported here: rospy and the
message packages are enough. The top-level names that scripts import (``from ambf_client import Client``) are thin
modules in ``names/``.
"""

from ligature.client.actuator import Actuator
from ligature.client.base_object import BaseObject
from ligature.client.client import Client
from ligature.client.euler import euler_from_quaternion, quaternion_from_euler
from ligature.client.layer import ral
from ligature.client.legacy import Object
from ligature.client.placed import Camera, Light
from ligature.client.rigid_body import RigidBody
from ligature.client.sensors import ContactSensor, GhostObject, Sensor
from ligature.client.vehicle import Vehicle
from ligature.client.world import World

__all__ = [
    "Actuator",
    "BaseObject",
    "Camera",
    "Client",
    "ContactSensor",
    "GhostObject",
    "Light",
    "Object",
    "RigidBody",
    "Sensor",
    "Vehicle",
    "World",
    "euler_from_quaternion",
    "quaternion_from_euler",
    "ral",
]
