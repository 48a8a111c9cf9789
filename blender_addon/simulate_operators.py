"""Simulate Here: runs Ligature on the scene in a process of its own and plays the motion on the timeline.

The motion is put on copies in a collection of its own: the scene itself stays at rest and exportable.
"""

import os
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

import bpy
import numpy as np

from .file_operators import chosen_collection
from .launch_file import export_scene
from .read_file import qualified
from .write_file import ExportError, export_file, members

MOTION = "ADF Motion"


def command():
    """The words that start Ligature: those of the preferences, else what the path has."""
    preferences = bpy.context.preferences.addons.get(__package__)
    words = preferences.preferences.simulator.split() if preferences else []
    if words:
        return words
    found = shutil.which("ligature")
    return [found] if found else []


class ADF_OT_simulate(bpy.types.Operator):
    """Simulate the scene, or its active model, and play the motion back on the timeline"""

    bl_idname = "adf.simulate"
    bl_label = "Simulate Here"
    bl_options = {"REGISTER", "UNDO", "PRESET"}

    seconds: bpy.props.FloatProperty(name="Seconds", default=2.0, min=0.05, max=120.0)

    @classmethod
    def poll(cls, context):
        if not command():
            cls.poll_message_set("Name the simulator's command in the add-on's preferences")
            return False
        if not any(c.adf.kind == "MODEL" for c in bpy.data.collections):
            cls.poll_message_set("The scene has no model")
            return False
        return True

    def execute(self, context):
        if not self._start(context):
            return {"CANCELLED"}
        while self._process.poll() is None:
            time.sleep(0.05)
        return self._take(context)

    def invoke(self, context, event):
        if bpy.app.background:
            return self.execute(context)
        if not self._start(context):
            return {"CANCELLED"}
        self._timer = context.window_manager.event_timer_add(0.1, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC":
            self._process.kill()
            self._process.wait()
            self._end(context)
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        context.workspace.status_text_set("Simulating. Esc ends it")
        if self._process.poll() is None:
            return {"PASS_THROUGH"}
        self._end(context)
        return self._take(context)

    def _start(self, context):
        self._folder = tempfile.TemporaryDirectory(prefix="adf-simulate-")
        root = Path(self._folder.name)
        folder = root / "scene"
        folder.mkdir(parents=True)
        try:
            if len(context.scene.adf.models):
                file = folder / "launch.yaml"
                export_scene(context.scene, file, remember=False)
            else:
                file = folder / "model.yaml"
                models = (c for c in bpy.data.collections if c.adf.kind == "MODEL")
                export_file(chosen_collection(context) or next(models), file, remember=False)
        except ExportError as error:
            self.report({"ERROR"}, str(error))
            return False
        self._out = root / "motion.npz"
        frames = context.scene.render.fps / context.scene.render.fps_base
        words = [
            *command(),
            "poses",
            str(file),
            "--seconds",
            str(self.seconds),
            "--rate",
            str(frames),
            "--out",
            str(self._out),
            "--root",
            str(root),
        ]
        self._log = open(root / "log", "wb")  # noqa: SIM115  (closed when the motion is taken)
        self._process = subprocess.Popen(words, stdout=self._log, stderr=subprocess.STDOUT, env=dict(os.environ))
        return True

    def _end(self, context):
        context.window_manager.event_timer_remove(self._timer)
        context.workspace.status_text_set(None)

    def _take(self, context):
        self._log.close()
        if self._process.returncode or not self._out.is_file():
            words = Path(self._log.name).read_text("utf-8", "replace").strip().splitlines()[-3:]
            self.report({"ERROR"}, f"The simulator failed: {' '.join(words)}")
            return {"CANCELLED"}
        with np.load(self._out, allow_pickle=False) as motion:
            identifiers, poses = [str(name) for name in motion["identifiers"]], motion["poses"]
        moved = play(context.scene, identifiers, poses)
        self.report({"INFO"}, f"{moved} bodies over {len(poses)} frames, in the collection '{MOTION}'")
        return {"FINISHED"}


def play(scene, identifiers, poses):
    """Put a motion (t, n, 7) on copies of the bodies; returns how many bodies move."""
    clear_motion()
    collection = bpy.data.collections.new(MOTION)
    scene.collection.children.link(collection)
    bodies = {
        qualified(file, obj): obj
        for file in bpy.data.collections
        if file.adf.kind == "MODEL"
        for obj in members(file)
        if obj.adf.role == "BODY"
    }
    frames = np.arange(len(poses), dtype=float) + scene.frame_start
    moved = 0
    for index, name in enumerate(identifiers):
        body = bodies.get(name)
        if body is None:
            continue
        copy = bpy.data.objects.new(f"{body.name} motion", body.data)
        collection.objects.link(copy)
        _animate(copy, frames, poses[:, index])
        moved += 1
    scene.frame_end = max(scene.frame_end, int(frames[-1]))
    scene.frame_set(scene.frame_current)  # else the copies stand where their last keyframe put them
    return moved


def _animate(obj, frames, poses):
    """Keyframes of a path: location and quaternion at every frame."""
    obj.rotation_mode = "QUATERNION"
    turns = poses[:, [6, 3, 4, 5]].copy()
    for i in range(1, len(turns)):
        if turns[i] @ turns[i - 1] < 0.0:
            turns[i] = -turns[i]  # the nearer of the two quaternions, so that interpolation does not go round
    for frame, place, turn in zip(frames, poses[:, :3], turns, strict=True):
        obj.location, obj.rotation_quaternion = place, turn
        obj.keyframe_insert("location", frame=frame)
        obj.keyframe_insert("rotation_quaternion", frame=frame)


def clear_motion():
    """Remove the copies of an earlier motion."""
    collection = bpy.data.collections.get(MOTION)
    if collection is not None:
        for obj in list(collection.objects):
            bpy.data.objects.remove(obj)
        bpy.data.collections.remove(collection)


class ADF_OT_clear_motion(bpy.types.Operator):
    """Remove the motion that was played back"""

    bl_idname = "adf.clear_motion"
    bl_label = "Clear Motion"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        clear_motion()
        return {"FINISHED"}


CLASSES = (ADF_OT_simulate, ADF_OT_clear_motion)


def attach() -> None:
    """Nothing but the classes."""


def detach() -> None:
    """Nothing but the classes."""
