#!/usr/bin/env bash
# Smoke of a stranger's machine: sets up and runs HEAD in a bare Debian 12 (make, certificates, nothing recommended).
#
# `make run` up to the first state, ended with Ctrl-C, then `ligature check` and `ligature bench`, the latter also as a
# user who can write nowhere. What it needs, and BARE_SYSTEM: bare_room.sh. BARE_KERNELS=DIR puts kernels that this
# machine has compiled into the room, where only that user's then compile; without it all do, in some minutes.
set -euo pipefail
try="bare machine"
furnish() {
    git -C "$project" -c safe.directory="$project" archive HEAD | tar -x -C "$1/home/project"
    [ -d "${BARE_KERNELS:-}" ] || return 0
    mkdir -p "$1/root/.cache/ligature"
    cp -a "$BARE_KERNELS" "$1/root/.cache/ligature/kernels"
}
. "$(dirname "$0")/bare_room.sh"

run_to_first_state 1500 inside make run || true # the status of make shows Ctrl-C
echo "$try: first state after $first s; the longest silence lasted $silence s"
[ "$ending" -lt 30 ] || fail "'make run' went on for $ending s after Ctrl-C"
[ "$silence" -le 10 ] || fail "the terminal was silent for $silence s"
extra=$(sed -n 's/^\([A-Za-z0-9_-]*\)==.*/\1/p' "$project/requirements-dev.txt" | while read -r name; do
    inside .venv/bin/pip show "$name" >/dev/null 2>&1 && echo "$name"
done || true)
[ -z "$extra" ] || fail "'make run' installed what only developers need:" $extra
inside .venv/bin/ligature check scenes/suturing/launch.yaml || fail "'ligature check'"
inside .venv/bin/ligature bench scenes/suturing/launch.yaml --seconds 2 || fail "'ligature bench'"
echo "bodies: [B]
B: {name: b, mass: 1, gravity: {x: 0, y: 0, z: 0}, collision shape: SPHERE, collision geometry: {radius: 0.02}}" >"$room/tmp/ball.yaml"
inside setpriv --reuid=65534 --clear-groups .venv/bin/ligature bench /tmp/ball.yaml --seconds 1 || # it compiles anew
    fail "'ligature bench' as a user who can write nowhere"
echo "$try: passed"
