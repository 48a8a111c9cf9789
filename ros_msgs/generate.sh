#!/bin/sh
# Generates the Python modules of every message package here into the folder $1, with Debian's genpy.
set -eu
here=$(dirname "$(readlink -f "$0")")
out=$1
python=/usr/bin/python3
includes="-Istd_msgs:/usr/share/std_msgs/msg -Igeometry_msgs:/usr/share/geometry_msgs/msg"
for package in "$here"/*/package.xml; do
    folder=$(dirname "$package")
    name=$(basename "$folder")
    includes="$includes -I$name:$folder/msg"
done
for package in "$here"/*/package.xml; do
    folder=$(dirname "$package")
    name=$(basename "$folder")
    for kind in msg srv; do
        ls "$folder/$kind"/*.$kind >/dev/null 2>&1 || continue
        mkdir -p "$out/$name/$kind"
        # shellcheck disable=SC2086
        $python "/usr/lib/genpy/gen${kind}_py.py" $includes -p "$name" -o "$out/$name/$kind" "$folder/$kind"/*.$kind
        $python "/usr/lib/genpy/gen${kind}_py.py" --initpy -p "$name" -o "$out/$name/$kind"
    done
    : > "$out/$name/__init__.py"
done
