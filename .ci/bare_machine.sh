#!/usr/bin/env bash
# Smoke of a stranger's machine: sets up and runs HEAD in a bare Debian 12 (make, certificates, nothing recommended).
#
# `make run` up to the first state, ended with Ctrl-C, then `ligature check` and `ligature bench`, the latter also as a
# user who can write nowhere. Needs root and mmdebstrap; where it cannot run it says why and ends with 0.
# BARE_SYSTEM=DIR keeps the bare system in DIR and takes it again. All mounts and processes live in namespaces of their
# own, so that they end with this script, however it ends.
set -euo pipefail
project=$(cd "$(dirname "$0")/.." && pwd)
deadline=1500
skip() {
    echo "bare machine: not tried: $*"
    exit 0
}

if [ "${1:-}" != --inside ]; then
    [ "$(id -u)" = 0 ] || skip "it needs root"
    command -v mmdebstrap >/dev/null || skip "it needs the Debian package mmdebstrap"
    command -v git >/dev/null || skip "it needs git"
    unshare --mount --pid --fork true 2>/dev/null || skip "this machine allows no namespaces of its own"
    work=$(mktemp -d)
    trap 'rm -rf --one-file-system "$work"' EXIT
    trap 'exit 130' INT
    trap 'exit 143' TERM
    bare=${BARE_SYSTEM:-$work/bare}
    if [ ! -e "$bare/etc/debian_version" ]; then
        echo "bare machine: building it in $bare, about 2 minutes"
        mmdebstrap --quiet --variant=minbase --include=make,ca-certificates bookworm "$bare" >&2 ||
            skip "mmdebstrap could not build a Debian 12"
    fi
    mkdir "$work/room"
    cp -a "$bare/." "$work/room/"
    mkdir -p "$work/room/home/project"
    git -C "$project" -c safe.directory="$project" archive HEAD | tar -x -C "$work/room/home/project"
    unshare --mount --propagation private --pid --fork --kill-child -- bash "$0" --inside "$work/room" &
    wait $!
    exit
fi

room=$2
# the machine's way to the package indices, and nothing else of it
for path in /etc/resolv.conf /etc/hosts /etc/pip.conf /etc/ssl/certs /usr/local/share/ca-certificates \
    /etc/apt/sources.list.d /etc/apt/apt.conf.d; do
    [ -e "$path" ] || continue
    rm -rf "${room:?}$path"
    mkdir -p "$(dirname "$room$path")"
    cp -aL "$path" "$room$path"
done
mount -t proc proc "$room/proc"
for path in /sys /dev; do mount --rbind "$path" "$room$path"; done
mount -t tmpfs tmpfs "$room/dev/shm"
ways=()
while IFS= read -r way; do ways+=("$way"); done < <(
    env | grep -E '^(PIP_|https?_proxy=|HTTPS?_PROXY=|no_proxy=|NO_PROXY=|SSL_CERT_FILE=|REQUESTS_CA_BUNDLE=)' |
        grep -v '^PIP_FIND_LINKS=' || true
)
inside() { # as root of the bare machine, in the project's folder
    env -i "${ways[@]}" HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 TERM=dumb \
        chroot "$room" /bin/sh -c 'cd /home/project && exec "$@"' sh "$@"
}
fail() {
    echo "bare machine: FAILED: $*"
    exit 1
}

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
