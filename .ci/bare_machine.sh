#!/usr/bin/env bash
# Smoke of a stranger's machine: sets up and runs HEAD in a bare Debian 12 (make, certificates, nothing recommended).
#
# `make run` up to the first state, ended with Ctrl-C, then `ligature check` and `ligature bench`, the latter also as a
# user who can write nowhere. What it needs, and BARE_SYSTEM: bare_room.sh.
set -euo pipefail
try="bare machine"
deadline=1500
furnish() { git -C "$project" -c safe.directory="$project" archive HEAD | tar -x -C "$1/home/project"; }
. "$(dirname "$0")/bare_room.sh"

set -m # jobs are process groups of their own, and take Ctrl-C as on a terminal
mkfifo "$room/told"
inside make run >"$room/told" 2>&1 &
run=$!
silence=0 before=$SECONDS first=
while IFS= read -r -t "$deadline" line; do
    gap=$((SECONDS - before)) before=$SECONDS
    [ "$gap" -gt "$silence" ] && silence=$gap
    echo "bare machine: $line"
    if [ -z "$first" ] && [[ $line == *"first state published"* ]]; then
        first=$SECONDS
        kill -INT -- "-$run"
    fi
    [ "$SECONDS" -lt "$deadline" ] || break
done <"$room/told"
if [ -z "$first" ]; then
    kill -KILL -- "-$run" 2>/dev/null || true
    fail "'make run' did not come to the first state within $deadline s"
fi
wait "$run" || true # make tells of Ctrl-C by its status
echo "bare machine: first state after $first s; the longest silence lasted $silence s"
[ "$((SECONDS - first))" -lt 30 ] || fail "'make run' went on for $((SECONDS - first)) s after Ctrl-C"
[ "$silence" -le 10 ] || fail "the terminal was silent for $silence s"
extra=$(sed -n 's/^\([A-Za-z0-9_-]*\)==.*/\1/p' "$project/requirements-dev.txt" | while read -r name; do
    inside .venv/bin/pip show "$name" >/dev/null 2>&1 && echo "$name"
done || true)
[ -z "$extra" ] || fail "'make run' installed what only developers need:" $extra
inside .venv/bin/ligature check scenes/suturing/launch.yaml || fail "'ligature check'"
inside .venv/bin/ligature bench scenes/suturing/launch.yaml --seconds 2 || fail "'ligature bench'"
inside setpriv --reuid=65534 --clear-groups .venv/bin/ligature bench scenes/peg_transfer/launch.yaml --seconds 1 ||
    fail "'ligature bench' as a user who can write nowhere"
echo "bare machine: passed"
