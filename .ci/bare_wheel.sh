#!/usr/bin/env bash
# A stranger installs the wheel: tries dist/ligature_sim-*.whl in a bare Debian 12 with python3-venv alone.
#
# Without ROS and without a compiler, as an ordinary user: `ligature check`, two arms suture (`ligature demo`), the learning
# environments; `ligature run` names the Debian packages that it lacks. With these installed it runs. What the script needs,
# and BARE_SYSTEM: bare_room.sh.
set -euo pipefail
try="bare wheel"
furnish() {
    local wheels=("$project"/dist/ligature_sim-*.whl)
    [ -e "${wheels[0]}" ] || fail "there is no wheel in dist; run 'make wheel'"
    cp "${wheels[@]}" "$1/home/project"
}
. "$(dirname "$0")/bare_room.sh"

env=/home/user/env
step() { # says what is tried, and how long it took
    local begin=$SECONDS
    echo "$try: $1"
    shift
    "$@" || fail "$*"
    echo "$try:   $((SECONDS - begin)) s"
}
user() { inside setpriv --reuid=1000 --regid=1000 --clear-groups env HOME=/home/user PATH="$env/bin:/usr/bin:/bin" "$@"; }
apt() { inside env DEBIAN_FRONTEND=noninteractive apt-get -qq -o Dpkg::Use-Pty=0 "$@" >/dev/null; }

# shellcheck disable=SC2016
learn='import gymnasium, ligature.environments
env = gymnasium.make("ligature/Reach-v0")
env.reset(seed=1)
observation, reward, *_ = env.step(env.action_space.sample())
print("observation", observation.shape, "reward", reward)'

step "reading the lists of Debian packages" apt update
step "installing python3-venv" apt install -y --no-install-recommends python3-venv
inside install -d -o 1000 -g 1000 /home/user
! inside sh -c 'command -v cc || command -v gcc || command -v rosmaster' || fail "the room is not bare"
step "creating an environment" user python3 -m venv "$env"
step "installing the wheel" user sh -c 'pip install --quiet --progress-bar off ./ligature_sim-*.whl'
step "checking a scene" user ligature check suturing
step "two arms suture by themselves" user ligature demo --throws 1 --out /home/user/out
output=$(user ligature run suturing 2>&1) && fail "'ligature run' ran without ROS"
echo "$output"
[[ $output == *"apt install "*python3-rosmaster*python3-rospy* ]] || fail "'ligature run' does not name the packages it lacks"
output=$(user ligature cockpit suturing 2>&1) && fail "'ligature cockpit' ran without viser"
[[ $output == *"ligature-sim[cockpit]"* ]] || fail "'ligature cockpit' does not name its extra: $output"
step "installing the extra learn" user sh -c 'pip install --quiet --progress-bar off "$(ls ./ligature_sim-*.whl)[learn]"'
step "a step of a learning environment" user python -c "$learn"

named=$(user ligature run suturing 2>&1 | sed -n 's/.*apt install //p' || true)
# shellcheck disable=SC2086
step "installing the Debian packages that 'ligature run' names" apt install -y --no-install-recommends $named
user sed -i 's/^include-system-site-packages = false/include-system-site-packages = true/' "$env/pyvenv.cfg"
run_to_first_state 120 user ligature run suturing || fail "'ligature run' ended with status $? after Ctrl-C"
echo "$try: passed"
