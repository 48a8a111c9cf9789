#!/bin/sh
# Installs the packages of the list $1 that are missing; asks for nothing when all are there.
# With --optional after the list, those that apt does not offer are left out and named.
set -eu
missing=$(sed 's/#.*//' "$1" | tr -s ' \n' '\n' | while read -r name; do
    [ -z "$name" ] && continue
    dpkg-query -W -f '${Status}' "$name" 2>/dev/null | grep -q 'install ok installed' || echo "$name"
done)
[ -z "$missing" ] && exit 0
if [ "$(id -u)" = 0 ]; then
    sudo=
elif command -v sudo >/dev/null; then
    sudo=sudo
    [ -t 0 ] && sudo -v # asks for the password before the progress of the step hides the question
else
    echo "These Debian packages are missing and need root to install:" $missing >&2
    exit 1
fi
sh .ci/step.sh "apt-get update: reads the lists of Debian packages, about half a minute" $sudo apt-get update
if [ "${2:-}" = --optional ]; then
    offered=
    for name in $missing; do
        if apt-cache show "$name" >/dev/null 2>&1; then
            offered="$offered $name"
        else
            echo "apt does not offer $name: its tests are skipped" >&2
        fi
    done
    missing=$offered
    [ -z "$missing" ] && exit 0
fi
count=$(echo $missing | wc -w)
# shellcheck disable=SC2086
sh .ci/step.sh "apt-get install: $count Debian packages of $1 and what they need, 1 to 5 minutes" \
    $sudo env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends $missing
