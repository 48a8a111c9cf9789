"""Simulate Here: runs Ligature on the scene in a process of its own and plays the motion on the timeline.

The motion is put on copies in a collection of its own: the scene itself stays at rest and exportable.
"""

import os
import re
import shutil

import bpy
import numpy as np

from .file_operators import chosen_collection
from .launch_file import exporting_scene
from .read_file import qualified
from .waiting import Process, Waits, failure
from .write_file import ExportError, exporting, members

MOTION = "ADF Motion"
THICKNESS = 4e-4
"""Drawn diameter in metres of a thread whose file states a USP size instead of a diameter."""


def command():
    """The words that start Ligature: those of the preferences, else what the path has."""
    preferences = bpy.context.preferences.addons.get(__package__)
    words = preferences.preferences.simulator.split() if preferences else []
    found = words[0] if words else shutil.which("ligature")
    if found and os.path.dirname(found):
        found = os.path.abspath(found)  # it is started in another folder than this
    return [found, *words[1:]] if found else []


class ADF_OT_simulate(Waits, bpy.types.Operator):
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

    def begin(self, context):
        self.job = Process("simulate")
        folder = self.job.root / "scene"
        folder.mkdir()
        try:
            if len(context.scene.adf.models):
                file = folder / "launch.yaml"
                yield from exporting_scene(context.scene, file, remember=False)
            else:
                file = folder / "model.yaml"
                models = (c for c in bpy.data.collections if c.adf.kind == "MODEL")
                yield from exporting(chosen_collection(context) or next(models), file, remember=False)
        except ExportError as error:
            self.report({"ERROR"}, str(error))
            return False
        self._out = self.job.root / "motion.npz"
        frames = context.scene.render.fps / context.scene.render.fps_base
        words = [*command(), "poses", str(file), "--seconds", str(self.seconds), "--rate", str(frames)]
        try:
            self.job.start([*words, "--out", str(self._out), "--root", str(self.job.root)])
        except OSError as error:
            self.report({"ERROR"}, f"The simulator cannot be started: {error}")
            return False
        return True

    def shown(self):
        return progress(self.job.words)

    def take(self, context):
        if self.job.status or not self._out.is_file():
            words = failure("Simulator", self.job.words, self.job.status)
            self.report({"ERROR"}, f"The simulator failed: {words}")
            return {"CANCELLED"}
        with np.load(self._out, allow_pickle=False) as motion:
            identifiers, poses = [str(name) for name in motion["identifiers"]], motion["poses"]
        moved, threads = play(context.scene, identifiers, poses)
        also = f" and {threads} thread{'' if threads == 1 else 's'}" if threads else ""
        self.report({"INFO"}, f"{moved} bodies{also} over {len(poses)} frames, in the collection '{MOTION}'")
        return {"FINISHED"}


def progress(words):
    """What the simulator is at, and the share that is done, from what it has printed so far."""
    done = re.findall(r"^(\d+) of (\d+) frames$", words, re.MULTILINE)
    if done:
        frame, frames = map(int, done[-1])
        return f"Simulating: frame {frame} of {frames}", frame / frames
    if "compiling" in words:
        return "Compiling the simulator for this machine: 1 to 3 minutes, once", None
    return "Starting the simulator; after an installation it compiles first, for 1 to 3 minutes", None


def play(scene, identifiers, poses):
    """Put a motion (t, n, 7) on copies of bodies and threads; returns how many bodies and threads move."""
    clear_motion()
    collection = bpy.data.collections.new(MOTION)
    scene.collection.children.link(collection)
    bodies, threads = (
        {
            qualified(file, obj): obj
            for file in bpy.data.collections
            if file.adf.kind == "MODEL"
            for obj in members(file)
            if obj.adf.role == role
        }
        for role in ("BODY", "SUTURE")
    )
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
    drawn = 0
    for name, obj in threads.items():
        elements = elements_of(name, identifiers)
        if len(elements) > 1:
            nodes = nodes_of(poses[:, elements], obj.adf.suture.length / len(elements))
            collection.objects.link(_thread(obj, frames, nodes))
            drawn += 1
    scene.frame_end = max(scene.frame_end, int(frames[-1]))
    scene.frame_set(scene.frame_current)  # else the copies stand where their last keyframe put them
    return moved, drawn


def elements_of(name, identifiers):
    """Where the elements of a thread are in a motion, from its start on: the simulator numbers them behind its name."""
    pattern = re.compile(re.escape(name) + r"_(\d{3,})")
    found = [(int(match[1]), index) for index, text in enumerate(identifiers) if (match := pattern.fullmatch(text))]
    return [index for _, index in sorted(found)]


def nodes_of(poses, length):
    """Where a thread is over time, (t, n + 1, 3): its elements have a length along Z of their poses (t, n, 7)."""
    x, y, z, w = np.moveaxis(poses[..., 3:], -1, 0)
    along = np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=-1)
    start, end = poses[..., :3] - length / 2 * along, poses[..., :3] + length / 2 * along
    return np.concatenate([start[:, :1], (end[:, :-1] + start[:, 1:]) / 2, end[:, -1:]], axis=1)


def _thread(suture, frames, nodes):
    """A tube of the thread's thickness that takes one shape after the other."""
    name = f"{suture.name} motion"
    curve = bpy.data.curves.new(name, "CURVE")
    curve.dimensions, curve.bevel_depth = "3D", (suture.adf.suture.diameter or THICKNESS) / 2
    spline = curve.splines.new("POLY")
    spline.points.add(nodes.shape[1] - 1)
    _put(spline.points, nodes[0])
    tube = bpy.data.objects.new(name, curve)
    tube.color = suture.color
    for number, places in enumerate(nodes):
        _put(tube.shape_key_add(name=f"{number}", from_mix=False).data, places)
    keys = curve.shape_keys
    keys.use_relative = False  # each shape has its own place on the way of `eval_time`
    for frame, block in zip(frames, keys.key_blocks, strict=True):
        keys.eval_time = block.frame
        keys.keyframe_insert("eval_time", frame=frame)
    return tube


def _put(points, places):
    """Move points of a curve; those of its spline have a weight as their fourth number."""
    for point, place in zip(points, places.tolist(), strict=True):
        point.co = (*place, 1.0) if len(point.co) == 4 else place


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
            tube = obj.data if obj.type == "CURVE" else None
            bpy.data.objects.remove(obj)
            if tube is not None:
                bpy.data.curves.remove(tube)
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
