# Source this in a shell (`. ./env.sh`) so that rostopic, rosbag and rospy programs find the messages of the simulator.
_ligature=$(CDPATH= cd -- "$(dirname -- "${BASH_SOURCE:-$0}")" && pwd)
export PATH="$_ligature/.venv/bin:$PATH"
export PYTHONPATH="$_ligature/build/python${PYTHONPATH:+:$PYTHONPATH}"
export ROS_PACKAGE_PATH="$_ligature/ros_msgs:$_ligature${ROS_PACKAGE_PATH:+:$ROS_PACKAGE_PATH}"
export ROS_MASTER_URI="${ROS_MASTER_URI:-http://127.0.0.1:11311}"
export ROS_IP="${ROS_IP:-127.0.0.1}"
unset _ligature
