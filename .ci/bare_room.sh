# Sourced by scripts that try something in a bare Debian 12 (make, certificates, nothing recommended), with the name of the
# try in $try and the script's own arguments. In the room: `inside COMMAND…` runs as root, in /home/project.
#
# Needs root and mmdebstrap; without the room the script prints the reason and ends with 0. BARE_SYSTEM=DIR keeps the
# bare system in DIR and takes it again; with `--prepare` the script does no more than build it there. All mounts and
# processes live in namespaces of their own, so that they end with the script, however it ends. A function `furnish ROOM`
# puts into the room what the try needs.
project=$(cd "$(dirname "$0")/.." && pwd)
skip() {
    echo "$try: not tried: $*"
    exit 0
}
fail() {
    echo "$try: FAILED: $*"
    exit 1
}

if [ "${1:-}" != --inside ]; then
    [ "$(id -u)" = 0 ] || skip "it needs root"
    command -v mmdebstrap >/dev/null || skip "it needs the Debian package mmdebstrap"
    command -v git >/dev/null || skip "it needs git"
    unshare --mount --pid --fork true 2>/dev/null || skip "this machine allows no namespaces of its own"
    work=$(mktemp -d)
    end_room() { # before its folder goes; unshare itself ends at SIGKILL alone, and takes all of the room with it
        kill -KILL "$!" 2>/dev/null && wait "$!" 2>/dev/null || true
    }
    trap 'rm -rf --one-file-system "$work"' EXIT
    trap 'end_room; exit 130' INT
    trap 'end_room; exit 143' TERM
    bare=${BARE_SYSTEM:-$work/bare}
    if [ ! -e "$bare/etc/debian_version" ]; then
        echo "$try: building a bare Debian in $bare, about 2 minutes"
        rm -rf --one-file-system "$bare.part" # of a try that was ended
        mmdebstrap --quiet --variant=minbase --include=make,ca-certificates bookworm "$bare.part" >&2 ||
            skip "mmdebstrap could not build a Debian 12"
        mv "$bare.part" "$bare"
    fi
    [ "${1:-}" != --prepare ] || exit 0
    mkdir "$work/room"
    cp -a "$bare/." "$work/room/"
    mkdir -p "$work/room/home/project"
    furnish "$work/room"
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

set -m # a job is a process group of its own, and takes Ctrl-C as on a terminal
first= silence=0 ending=0
run_to_first_state() { # DEADLINE COMMAND…: Ctrl-C after the first state; the status is COMMAND's
    # sets, in seconds, $first: till that state, $silence: longest without a line, $ending: from Ctrl-C to the end
    local deadline=$1 begin=$SECONDS before=$SECONDS run gap line
    shift
    mkfifo "$room/output"
    "$@" >"$room/output" 2>&1 &
    run=$!
    while IFS= read -r -t "$deadline" line; do
        gap=$((SECONDS - before)) before=$SECONDS
        [ "$gap" -le "$silence" ] || silence=$gap
        echo "$try: $line"
        if [ -z "$first" ] && [[ $line == *"first state published"* ]]; then
            first=$((SECONDS - begin)) ending=$SECONDS
            kill -INT -- "-$run"
        fi
        [ $((SECONDS - begin)) -lt "$deadline" ] || break
    done <"$room/output"
    [ -n "$first" ] || { kill -KILL -- "-$run" 2>/dev/null; fail "no first state within $deadline s: $*"; }
    local status=0
    wait "$run" || status=$?
    ending=$((SECONDS - ending))
    return "$status"
}
