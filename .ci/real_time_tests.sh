#!/bin/sh
# The tests that watch real time: sh .ci/real_time_tests.sh PYTHON TESTS…
# They share the machine with whatever else runs on it, so that up to forty that fail run once more, in a process of
# their own, when the process LIGATURE_RETRY_AFTER has ended. Both runs are shown, and the last lines name what passed the
# second time only; LIGATURE_RETRY=0 does without. LIGATURE_BETWEEN is a command that would disturb them: it runs after the
# first run, beside what else runs on the machine, and its failure counts.
python=$1
shift
memory="-o addopts=-ra -o cache_dir=build/real_time_tests"
between=0
leave() { # STATUS
    [ "$1" -ne 0 ] || exit "$between"
    exit "$1"
}
rm -rf build/real_time_tests
"$python" -m pytest -m "not slow" $memory "$@"
status=$?
[ -z "${LIGATURE_BETWEEN:-}" ] || sh -c "$LIGATURE_BETWEEN" || between=$?
[ $status -eq 1 ] && [ "${LIGATURE_RETRY:-1}" != 0 ] || leave $status
failed=$("$python" -c 'import json; print(*json.load(open("build/real_time_tests/v/cache/lastfailed")), sep="\n")')
count=$(printf '%s\n' "$failed" | grep -c '::')
[ "$count" -ge 1 ] && [ "$count" -le 40 ] || leave $status
[ -z "${LIGATURE_RETRY_AFTER:-}" ] || tail -f /dev/null --pid="$LIGATURE_RETRY_AFTER"
echo "running what failed once more: $count of the tests that watch real time"
# only their files: to collect all takes twenty seconds
# shellcheck disable=SC2046
"$python" -m pytest -m "not slow" $memory --last-failed $(printf '%s\n' "$failed" | cut -d: -f1 | sort -u) || leave $?
printf 'passed the second time only:\n%s\n' "$failed"
leave 0
