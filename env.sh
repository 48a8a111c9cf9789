# Source this in a shell (`. ./env.sh`) so that rostopic, rosbag and rospy programs find the messages of the simulator,
# and `from ambf_client import Client` finds ours where AMBF is not installed (LIGATURE_CLIENT=own: also where it is).
_ligature=$(CDPATH= cd -- "$(dirname -- "${BASH_SOURCE:-$0}")" && pwd)
export PATH="$_ligature/.venv/bin:$PATH"
export PYTHONPATH="$_ligature/build/python:$_ligature/simulator${PYTHONPATH:+:$PYTHONPATH}"
_names="$_ligature/simulator/ligature/client/names"
_absent() { ! python3 -c "import sys; del sys.path[0]; import importlib.util; sys.exit(importlib.util.find_spec('$1') is None)"; }
if [ "${LIGATURE_CLIENT:-}" = own ]; then
    export PYTHONPATH="$_names/ambf:$_names/tf:$PYTHONPATH"
else
    if _absent ambf_client; then export PYTHONPATH="$PYTHONPATH:$_names/ambf"; fi
    if _absent transformations; then export PYTHONPATH="$PYTHONPATH:$_names/tf"; fi
fi
export ROS_PACKAGE_PATH="$_ligature/ros_msgs:$_ligature${ROS_PACKAGE_PATH:+:$ROS_PACKAGE_PATH}"
export ROS_MASTER_URI="${ROS_MASTER_URI:-http://127.0.0.1:11311}"
case "$ROS_MASTER_URI" in  # to a master elsewhere this machine is known by its name
    http://127.*|http://localhost*) export ROS_IP="${ROS_IP:-127.0.0.1}" ;;
esac
export ROS_VERSION="${ROS_VERSION:-1}"
unset _ligature _names
unset -f _absent
