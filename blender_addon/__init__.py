"""Edits ADF scenes in Blender: the file is the document, Blender is one editor of it.

Metres, kilograms, seconds, radians, as in the format; Blender's own axes are the world's. Nothing
here looks at the scene while it is imported or registered.
"""

bl_info = {
    "name": "ADF Studio",
    "author": "The Ligature developers",
    "version": (0, 1, 0),
    "blender": (3, 4, 0),
    "location": "File > Import/Export, 3D View > Sidebar > ADF, Properties > Physics",
    "description": "Author scenes in the AMBF Description Format: bodies, joints, sutures, sensors, cameras, worlds",
    "category": "Import-Export",
}

from . import registration  # noqa: E402  (Blender reads bl_info from the text above the imports)


def register():
    """Add classes, properties, menus and handlers to Blender."""
    registration.register()


def unregister():
    """Take away everything that `register` added."""
    registration.unregister()
