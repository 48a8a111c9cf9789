#!/bin/sh
# Blender of version $1 as a Python module in an environment of its own at $2; what is there is kept.
set -u
if "$2/bin/python" -c "import bpy, pytest, yaml" 2>/dev/null; then exit 0; fi
echo "fetching bpy $1 (some 350 MB) into $2"
rm -rf "$2"
/usr/bin/python3 -m venv "$2" &&
    "$2/bin/pip" install --quiet --disable-pip-version-check "bpy==$1" -r requirements-bpy.txt && exit 0
echo "bpy $1 could not be had from the package index: its tests are skipped" >&2
