#!/bin/sh
# Blender of version $1 as a Python module in an environment of its own at $2, within $3 seconds; what is there is kept.
# A failed download is no failure: the reason is printed and stands in $2.why, and its tests are skipped.
set -u
version=$1 folder=$2 seconds=${3:-600}
if "$folder/bin/python" -c "import bpy, pytest, yaml" 2>/dev/null; then
    rm -f "$folder.why"
    exit 0
fi
python=
for candidate in /usr/bin/python3 python3.11; do # the wheels of Blender 4.2 to 5.0 are for Python 3.11 alone
    "$candidate" -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' 2>/dev/null && python=$candidate && break
done
mkdir -p "$(dirname "$folder")"
if [ -z "$python" ]; then
    why="bpy $version needs Python 3.11, and this machine has $(/usr/bin/python3 -V 2>&1)"
else
    rm -rf "$folder"
    "$python" -m venv "$folder" &&
        sh "$(dirname "$0")/step.sh" "fetching bpy $version (some 350 MB) into $folder, for at most $seconds s" \
            timeout -k 10 "$seconds" "$folder/bin/pip" install --disable-pip-version-check --progress-bar off \
            --timeout 15 --retries 1 "bpy==$version" -r requirements-bpy.txt
    case $? in
    0) rm -f "$folder.why" && exit 0 ;;
    124) why="bpy $version was not fetched within $seconds s" ;;
    *) why="bpy $version could not be fetched from the package index" ;;
    esac
fi
echo "$why: its tests are skipped" >&2
echo "$why" >"$folder.why"
