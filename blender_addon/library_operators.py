"""A library of sensors for the active body; the numbers are starting points, not data of products."""

import bpy
import numpy as np

from . import making
from .object_operators import active_body, target_file

LIBRARY = {
    "BEAM": ("Beam", "One ray of 50 mm along X: is something in front?"),
    "FAN": ("Fan", "Nine rays of 50 mm over 60 degrees about Z: where is an edge?"),
    "RING": ("Ring", "Twelve rays of 10 mm outwards from a circle of 5 mm: what is around a shaft?"),
    "PAD": ("Resistive Pad", "Nine points, 4 mm apart, that press along X with a spring: a tactile array"),
    "CONTACT": ("Contact", "Contacts of the body itself"),
}


def rays_of(name):
    """Starts (n, 3) in metres and directions (n, 3) of a sensor's rays, and their length."""
    if name == "FAN":
        angle = np.linspace(-np.pi / 6, np.pi / 6, 9)
        return np.zeros((9, 3)), np.column_stack([np.cos(angle), np.sin(angle), np.zeros(9)]), 0.05
    if name == "RING":
        angle = np.linspace(0.0, 2 * np.pi, 12, endpoint=False)
        out = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(12)])
        return 0.005 * out, out, 0.01
    if name == "PAD":
        y, z = np.meshgrid([-0.004, 0.0, 0.004], [-0.004, 0.0, 0.004])
        return np.column_stack([np.zeros(9), y.ravel(), z.ravel()]), np.tile([1.0, 0.0, 0.0], (9, 1)), 0.003
    return np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0]]), 0.05


class ADF_OT_add_sensor(bpy.types.Operator):
    """Add a ready-made sensor at the 3D cursor, on the active body"""

    bl_idname = "adf.add_sensor"
    bl_label = "Add Sensor"
    bl_options = {"REGISTER", "UNDO"}

    which: bpy.props.EnumProperty(name="Sensor", items=[(key, *words) for key, words in LIBRARY.items()])

    @classmethod
    def poll(cls, context):
        if active_body(context, ("BODY",)) is None:
            cls.poll_message_set("Make the parent body of the sensor active")
            return False
        return True

    def execute(self, context):
        body = active_body(context, ("BODY",))
        file = making.file_of(body) or target_file(context, "SENSOR")
        name = LIBRARY[self.which][0]
        obj = making.new_object(file, "SENSOR", name, making.cursor_pose(context.scene), body)
        group = obj.adf.sensor
        group.type = {"PAD": "RESISTANCE", "CONTACT": "CONTACT"}.get(self.which, "PROXIMITY")
        if self.which == "CONTACT":
            return {"FINISHED"}
        starts, directions, length = rays_of(self.which)
        group.range = length
        for start, direction in zip(starts.tolist(), directions.tolist(), strict=True):
            ray = group.array.add()
            ray.offset, ray.direction = start, direction
        if self.which == "PAD":
            group.contact_stiffness, group.contact_area = 2.0, 0.004
        return {"FINISHED"}


CLASSES = (ADF_OT_add_sensor,)


def attach() -> None:
    """Nothing but the classes."""


def detach() -> None:
    """Nothing but the classes."""
