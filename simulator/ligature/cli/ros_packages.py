"""The Debian packages that give Python ROS 1, and which of them this Python lacks."""

from __future__ import annotations

import importlib.util
import shutil
import sys
from collections.abc import Mapping
from pathlib import Path

PACKAGES: Mapping[str, str] = {
    "genpy": "python3-genpy",
    "rosbag": "python3-rosbag",
    "rosgraph": "python3-rosgraph",
    "roslib": "python3-roslib",
    "rospy": "python3-rospy",
    "diagnostic_msgs": "python3-diagnostic-msgs",
    "geometry_msgs": "python3-geometry-msgs",
    "rosgraph_msgs": "python3-rosgraph-msgs",
    "sensor_msgs": "python3-sensor-msgs",
    "std_msgs": "python3-std-msgs",
    "std_srvs": "python3-std-srvs",
    "tf2_msgs": "python3-tf2-msgs",
    "visualization_msgs": "python3-visualization-msgs",
}
"""Modules that a run on ROS imports, and the package of Debian 12 and Ubuntu 22.04 that brings each."""

MASTER = "python3-rosmaster"
OUR_MESSAGES = ("ambf_msgs", "cisst_msgs", "crtk_msgs")
DEBIAN_PYTHON = Path("/usr/lib/python3/dist-packages")


def ros_problem() -> str:
    """Why this Python cannot run a scene on ROS, and what to do about it; empty when it can."""
    lacking = {module: package for module, package in PACKAGES.items() if not _importable(module)}
    packages = [package for module, package in lacking.items() if not (DEBIAN_PYTHON / module).is_dir()]
    if shutil.which("rosmaster") is None:
        packages.append(MASTER)
    steps = []
    if packages:
        steps.append(f"install the Debian packages: apt install {' '.join(sorted(packages))}")
    if lacking and _isolated():
        steps.append(
            f"let this environment see them: set 'include-system-site-packages = true' in {sys.prefix}/pyvenv.cfg"
        )
    elif lacking and not packages:
        steps.append(f"run Ligature with Debian's own Python; {sys.executable} does not see {DEBIAN_PYTHON}")
    ours = [module for module in OUR_MESSAGES if not _importable(module)]
    if ours:
        steps.append(f"install Ligature from a wheel or with 'make run'; the messages {', '.join(ours)} are missing")
    if not steps:
        return ""
    return "ROS 1 is missing:\n  " + "\n  ".join(steps) + "\n'ligature cockpit' runs scenes without ROS"


def _importable(module: str) -> bool:
    return importlib.util.find_spec(module) is not None


def _isolated() -> bool:
    """Whether this Python is a virtual environment that hides Debian's packages."""
    return sys.prefix != sys.base_prefix and str(DEBIAN_PYTHON) not in sys.path
