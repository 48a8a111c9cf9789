#!/bin/sh
# One long step of the set-up: says $1 (what is done), then runs the command that follows, and reports at least every 4 s
# how long it has been at it and what it wrote last. What the command writes is kept below build/logs and shown if it fails.
set -u
what=$1
shift
logs=build/logs
mkdir -p "$logs"
log=$logs/$(echo "$what" | tr -cs 'A-Za-z0-9' '_' | cut -c -40).log
: >"$log"
begin=$(date +%s)
elapsed() { echo $(($(date +%s) - begin)); }
last_line() { tr '\r' '\n' <"$log" | grep -v '^[[:space:]]*$' | tail -n 1 | cut -c -60; }
report() {
    if [ -t 1 ]; then
        printf '\r\033[K  %s s  %s' "$(elapsed)" "$(last_line)"
    else
        echo "  $(elapsed) s  $(last_line)"
    fi
}
echo "$what"
own=$$
( # the step itself stays in the foreground, so that Ctrl-C reaches it
    pause=4
    [ -t 1 ] && pause=1
    while sleep "$pause" && kill -0 "$own" 2>/dev/null; do report; done
) &
ticker=$!
leave() { kill "$ticker" 2>/dev/null; }
trap leave EXIT
trap 'exit 130' INT
trap 'exit 143' TERM
"$@" >"$log" 2>&1 </dev/null
status=$?
leave
[ -t 1 ] && printf '\r\033[K'
if [ "$status" = 0 ]; then
    echo "  done in $(elapsed) s"
else
    echo "  failed with status $status after $(elapsed) s; the end of $log:"
    tail -n 30 "$log"
fi
exit "$status"
