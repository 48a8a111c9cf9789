#!/bin/sh
# Installs the packages of the list $1 that are missing; asks for nothing when all are there.
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
else
    echo "These Debian packages are missing and need root to install:" $missing >&2
    exit 1
fi
$sudo apt-get update -qq
# shellcheck disable=SC2086
DEBIAN_FRONTEND=noninteractive $sudo apt-get install -y -qq --no-install-recommends $missing
