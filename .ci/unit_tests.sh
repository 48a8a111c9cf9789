#!/bin/sh
# All tests, in two halves at once: sh .ci/unit_tests.sh PYTHON REAL_TIME_TESTS…
#
# The tests that watch real time mostly wait. What they leave of the processors goes to all others: three workers of lower
# priority, whose output comes when the tests that watch real time are done. What these fail for once, they may try again
# when nothing runs beside them. Where Linux shares the processor among sessions first, those of the simulators under test
# would count no more than the session of the three workers: that is a session of its own, of lower priority as a whole.
set -u
# hundreds of processes start, and each would compile all modules of a checkout anew
unset PYTHONDONTWRITEBYTECODE
python=$1
shift
ignored=
for path in "$@"; do ignored="$ignored --ignore=$path"; done
mkdir -p build/logs
log=build/logs/unit_tests.log
: >"$log"
# a shell starts what is in the background deaf to Ctrl-C, which tests of Ctrl-C would inherit
# shellcheck disable=SC2086,SC2016
setsid sh -c 'echo 5 2>/dev/null >/proc/self/autogroup; exec "$@"' sh \
    nice -n 19 env --default-signal=INT,QUIT \
    "$python" -m pytest -m "not slow" -n 3 --dist worksteal tests $ignored >"$log" 2>&1 </dev/null &
others=$!
trap 'kill "$others" 2>/dev/null' EXIT
trap 'exit 130' INT
trap 'exit 143' TERM
LIGATURE_RETRY_AFTER=$others sh .ci/real_time_tests.sh "$python" "$@"
status=$?
echo "the other tests, which ran meanwhile:"
tail -n +1 -f --pid="$others" "$log"
wait "$others" || status=$?
exit "$status"
