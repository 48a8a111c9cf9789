"""Named poses: where the joints of a model stand, kept in the blend file and shown as a preview."""

import json

import bpy

from . import making
from .file_operators import chosen_collection
from .preview_operators import is_previewing, show, shown


def model_of(context):
    """The model of the active object, else the active one."""
    file = making.file_of(context.object) or chosen_collection(context)
    return file if file is not None and file.adf.kind == "MODEL" else None


def joints_by_key(collection):
    """The joints of a model by their identifiers."""
    return {obj.adf.key: obj for obj in collection.all_objects if obj.adf.role == "JOINT"}


class ADF_OT_store_pose(bpy.types.Operator):
    """Keep the previewed positions of the model's joints under a name; a pose of that name is replaced"""

    bl_idname = "adf.store_pose"
    bl_label = "Store Pose"
    bl_options = {"REGISTER", "UNDO"}

    name: bpy.props.StringProperty(name="Name", default="pose")

    @classmethod
    def poll(cls, context):
        if model_of(context) is None or not is_previewing(context.scene):
            cls.poll_message_set("Make a model active, and preview joints of it")
            return False
        return True

    def invoke(self, context, event):
        return context.window_manager.invoke_props_dialog(self)

    def execute(self, context):
        file = model_of(context)
        positions = shown(context.scene)
        kept = {key: positions[j.name] for key, j in joints_by_key(file).items() if j.name in positions}
        if not kept or not self.name.strip():
            self.report({"ERROR"}, f"No joint of '{file.name}' is previewed" if not kept else "Give the pose a name")
            return {"CANCELLED"}
        pose = file.adf.poses.get(self.name) or file.adf.poses.add()
        pose.name, pose.positions = self.name, json.dumps(kept)
        self.report({"INFO"}, f"'{self.name}' holds {len(kept)} joints")
        return {"FINISHED"}


class OfPose:
    """An operator on one of the model's poses."""

    name: bpy.props.StringProperty(name="Name")

    @classmethod
    def poll(cls, context):
        file = model_of(context)
        if file is None or not len(file.adf.poses):
            cls.poll_message_set("The active model has no pose")
            return False
        return True

    def pose(self, context):
        """The pose of the name; None, reported, without it."""
        poses = model_of(context).adf.poses
        found = poses.get(self.name) if self.name else poses[0]
        if found is None:
            self.report({"ERROR"}, f"There is no pose '{self.name}'; choose one of {', '.join(poses.keys())}")
        return found


class ADF_OT_show_pose(OfPose, bpy.types.Operator):
    """Show a pose of the model as a preview; other models stay as they are"""

    bl_idname = "adf.show_pose"
    bl_label = "Show Pose"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        pose = self.pose(context)
        if pose is None:
            return {"CANCELLED"}
        joints, kept = joints_by_key(model_of(context)), json.loads(pose.positions)
        own = {joint.name for joint in joints.values()}
        others = {name: values for name, values in shown(context.scene).items() if name not in own}
        show(context.scene, {**others, **{joints[key].name: v for key, v in kept.items() if key in joints}})
        gone = sorted(set(kept) - set(joints))
        if gone:
            self.report({"WARNING"}, f"The model has no joint {', '.join(gone)} any more")
        return {"FINISHED"}


class ADF_OT_remove_pose(OfPose, bpy.types.Operator):
    """Forget a pose of the model"""

    bl_idname = "adf.remove_pose"
    bl_label = "Remove Pose"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        pose = self.pose(context)
        if pose is None:
            return {"CANCELLED"}
        poses = model_of(context).adf.poses
        poses.remove(poses.find(pose.name))
        return {"FINISHED"}


CLASSES = (ADF_OT_store_pose, ADF_OT_show_pose, ADF_OT_remove_pose)


def attach() -> None:
    """Nothing but the classes."""


def detach() -> None:
    """Nothing but the classes."""
