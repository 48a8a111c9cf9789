#!/usr/bin/env bash
# Executes the steps of the Dockerfile in a bare Debian 12, where docker is absent, then runs its entry point.
#
# RUN, COPY, USER, WORKDIR and ENV mean what docker makes of them; FROM is the bare system. What the script needs, and
# BARE_SYSTEM: bare_room.sh.
set -euo pipefail
try="bare image"
furnish() {
    local line
    while IFS= read -r line; do # the build context: what .dockerignore lets through
        # shellcheck disable=SC2086
        (cd "$project" && cp --parents $line "$1/home/project") || fail "the build context lacks $line; run 'make wheel'"
    done < <(sed -n 's/^!//p' "$project/.dockerignore")
    cp "$project/Dockerfile" "$project/.ci/dockerfile_steps.py" "$1/home"
}
. "$(dirname "$0")/bare_room.sh"

user=root folder=/ settings=(PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin) entry=
within() { # as the image's user, in its folder and environment
    local home
    home=$(inside sh -c "getent passwd $user | cut -d: -f6")
    inside setpriv --reuid="$user" --regid="$user" --init-groups env HOME="$home" DEBIAN_FRONTEND=noninteractive \
        "${settings[@]}" sh -c "cd $folder && $1"
}
while IFS=$'\t' read -r step text; do
    echo "$try: $step $text"
    begin=$SECONDS
    case $step in
    FROM) [ "$text" = debian:12-slim ] || fail "the base is $text, not what this script builds" ;;
    RUN) within "$text" >"$room/home/log" 2>&1 || { tail -n 30 "$room/home/log"; fail "$text"; } ;;
    COPY)
        read -ra words <<<"$text"
        # shellcheck disable=SC2086
        (cd "$room/home/project" && cp -r ${words[*]::${#words[@]}-1} "$room${words[-1]}") || fail "COPY $text"
        ;;
    USER) user=$text ;;
    WORKDIR) folder=$text ;;
    ENV) settings+=("$text") ;;
    ENTRYPOINT) entry=$text ;;
    CMD) command=$text ;;
    esac
    [ $((SECONDS - begin)) -lt 2 ] || echo "$try:   $((SECONDS - begin)) s"
done < <(python3 "$room/home/dockerfile_steps.py" "$room/home/Dockerfile")

[ "$user" != root ] || fail "the image runs as root"
output=$(within "$entry $command")
[[ $output == *"Usage: ligature"* ]] || fail "'$entry $command' shows no help: $output"
within "$entry check suturing" || fail "'$entry check suturing'"
within "$entry bench suturing --seconds 1" || fail "'$entry bench suturing'"
within "$entry render peg_transfer --camera cameraL --width 320 --out pictures && ls pictures" || fail "'$entry render'"
run_to_first_state 120 within "exec $entry run suturing" || fail "'$entry run' ended with status $? after Ctrl-C"
echo "$try: passed"
