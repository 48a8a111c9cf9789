"""What a session of Blender with a window is made of: steps, views, pictures, a result.

A session is started with the folder for pictures after ``--``; it prints one line ``RESULT {…}`` and quits.
"""

import json
import os
import sys
import time
import traceback
from pathlib import Path

import addon_utils
import bpy
from mathutils import Euler, Vector

OUT = Path(sys.argv[sys.argv.index("--") + 1])
RESULT = {"undone": {}, "drawn": [], "pictures": [], "errors": []}
STEPS = []
START = time.monotonic()


def step(function):
    """Enter a function that runs with a window, one after the other."""
    STEPS.append(function)
    return function


def main():
    """The window."""
    return bpy.context.window_manager.windows[0]


def view():
    """The 3D view, as what a context is overridden with."""
    area = next(a for a in main().screen.areas if a.type == "VIEW_3D")
    return {
        "window": main(),
        "area": area,
        "region": next(r for r in area.regions if r.type == "WINDOW"),
        "space_data": area.spaces[0],
    }


def redraw():
    """Draw the window now."""
    bpy.ops.wm.redraw_timer(type="DRAW_WIN_SWAP", iterations=1)


def picture(name):
    """Save what the window shows."""
    for _ in range(3):  # panels slide into place
        redraw()
    bpy.ops.screen.screenshot(filepath=str(OUT / f"{name}.png"))
    RESULT["pictures"].append(name)


def select(*objects):
    """Select objects; the last one becomes active."""
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj in objects)
    bpy.context.view_layer.objects.active = objects[-1]


def find(role, name=""):
    """The first object of a role whose name holds a text."""
    return next(o for o in bpy.data.objects if o.adf.role == role and name in o.name)


def enable():
    """Enable the add-on as a user does, in an empty scene that a software renderer draws."""
    assert addon_utils.enable("adf_studio", default_set=True) is not None
    bpy.context.preferences.view.show_splash = False
    bpy.context.preferences.view.ui_scale = 1.0
    bpy.context.preferences.system.viewport_aa = "OFF"  # a software renderer draws these windows
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)


def look(place, turn, distance):
    """Turn the view to a place, at an Euler rotation and a distance, with the sidebar open and the floor hidden."""
    area = view()["area"]
    space = area.spaces[0]
    space.show_region_ui = True
    space.shading.type, space.shading.color_type, space.shading.show_xray = "SOLID", "OBJECT", False
    space.overlay.show_floor = False
    space.clip_start = 0.001
    space.region_3d.view_location = Vector(place)
    space.region_3d.view_rotation = Euler(turn).to_quaternion()
    space.region_3d.view_distance = distance
    properties = next(a for a in main().screen.areas if a.type == "PROPERTIES")
    properties.spaces[0].context = "PHYSICS" if bpy.context.object else "SCENE"


def simulate(kind, value):
    """An event of the mouse over the sidebar's ADF tab."""
    area = view()["area"]
    main().event_simulate(type=kind, value=value, x=area.x + area.width - 14, y=area.y + area.height - 212)


def point_at_the_tab():
    redraw()
    simulate("MOUSEMOVE", "NOTHING")


def press_the_tab():
    simulate("LEFTMOUSE", "PRESS")


def release_the_tab():
    simulate("LEFTMOUSE", "RELEASE")


OPEN_TAB = (point_at_the_tab, press_the_tab, release_the_tab)
"""Steps that open the add-on's tab in the sidebar."""


def scroll_sidebar(times):
    """Scroll the sidebar down."""
    area = view()["area"]
    region = next(region for region in area.regions if region.type == "UI")
    with bpy.context.temp_override(window=main(), area=area, region=region):
        for _ in range(times):
            bpy.ops.view2d.scroll_down(deltay=60)


def scroll_physics(times):
    """Scroll the keys of the active object down."""
    area = next(a for a in main().screen.areas if a.type == "PROPERTIES")
    area.spaces[0].context = "PHYSICS"
    redraw()
    region = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=main(), area=area, region=region):
        for _ in range(times):
            bpy.ops.view2d.scroll_down(deltay=60)


def run():
    """The next step; a failure ends the session with its traceback."""
    if not STEPS:
        finish()
        return None
    function = STEPS.pop(0)
    sys.stderr.write(f"{time.monotonic() - START:.1f} s: {function.__name__}\n")
    sys.stderr.flush()
    try:
        with bpy.context.temp_override(**view()):
            function()
    except Exception:
        RESULT["errors"].append(f"{function.__name__}: {traceback.format_exc()}")
        finish()
        return None
    return 0.3


def finish():
    """Report the result and quit."""
    sys.stdout.write(f"RESULT {json.dumps(RESULT)}\n")
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)


def start():
    """Run the steps, one after the other, once Blender has drawn its window."""
    bpy.app.timers.register(run, first_interval=1.0, persistent=True)
