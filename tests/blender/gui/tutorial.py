"""The tutorial of docs/blender.md in a Blender with a window: each step as its script does it, and a picture of it."""

import importlib.util
import os
from pathlib import Path

import bpy
import window
from window import OUT, STEPS, find, picture, select, step, view

spec = importlib.util.spec_from_file_location("author", Path(os.environ["LIGATURE_ROOT"], "scenes", "author_blender_suturing.py"))  # fmt: skip
author = importlib.util.module_from_spec(spec)
spec.loader.exec_module(author)

step(window.enable)


def shown(name, distance, *objects):
    """A picture of what a step made, with one of its objects active."""

    def show():
        if objects:
            select(*[bpy.data.objects[each] for each in objects])
        window.look(author.at(z=-0.004), (0.95, 0.0, 0.45), distance)
        view()["space_data"].shading.color_type = "TEXTURE"
        picture(name)

    show.__name__ = name
    return show


def made(function):
    """A step of the script."""

    def make():
        function(OUT)

    make.__name__ = function.__name__
    return make


def simulate():
    bpy.context.preferences.addons["adf_studio"].preferences.simulator = os.environ["LIGATURE_COMMAND"]
    author.write(OUT / "scenes" / "blender_suturing")
    assert bpy.ops.adf.simulate(seconds=0.8) == {"FINISHED"}
    bpy.context.scene.frame_set(19)
    bpy.context.scene.adf.show_overlay = False
    view()["space_data"].overlay.show_extras = False
    for collection in bpy.data.collections:
        collection.hide_viewport = "Shapes" in collection.name


def finding_list():
    bpy.ops.adf.check()
    window.scroll_sidebar(12)


STEPS += [
    made(author.drape),
    lambda: window.look(author.at(), (0.95, 0.0, 0.45), 0.3),
    *window.OPEN_TAB,
    shown("blender_1_drape", 0.3, "Drape"),
    made(author.flaps),
    shown("blender_2_flaps", 0.19, "Pad"),
    made(author.holes),
    made(author.needle),
    lambda: select(find("JOINT", "Entry2")),
    shown("blender_3_needle", 0.13),
    made(author.view),
    made(author.arms),
    finding_list,
    shown("blender_4_arms", 0.7, "CameraFrame"),
    simulate,
    shown("blender_5_motion", 0.16, "Needle motion"),
]
window.start()
