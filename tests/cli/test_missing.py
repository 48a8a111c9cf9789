"""A feature whose packages are missing names them, and how to install them."""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from ligature.cli import missing, ros_packages

from tests.test_requirements import imported, listed

ROS = {
    "diagnostic_msgs",
    "genpy",
    "geometry_msgs",
    "rosbag",
    "rosgraph",
    "rospy",
    "sensor_msgs",
    "std_msgs",
    "std_srvs",
}


def without(monkeypatch: pytest.MonkeyPatch, *modules: str) -> None:
    """Let ``modules`` and ROS's master seem absent."""
    monkeypatch.setattr(
        ros_packages, "_importable", lambda m: m not in modules and importlib.util.find_spec(m) is not None
    )


def test_every_ros_module_that_is_imported_has_its_debian_package() -> None:
    assert imported("simulator") >= ROS
    named = {"tf2_msgs", "rosgraph_msgs"} | {
        m for m in imported("simulator") if m.startswith("ros") or m.endswith("_msgs")
    }
    assert named | ROS <= set(ros_packages.PACKAGES)
    assert {*ros_packages.PACKAGES.values(), ros_packages.MASTER} <= listed("debian-packages.txt")


def test_a_run_without_ros_names_the_packages_to_install(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(ros_packages, "DEBIAN_PYTHON", tmp_path)
    monkeypatch.setattr(shutil, "which", lambda name: None)
    without(monkeypatch, "rospy", "std_srvs")
    problem = ros_packages.ros_problem()
    assert "apt install python3-rosmaster python3-rospy python3-std-srvs\n" in problem
    assert f"set 'include-system-site-packages = true' in {sys.prefix}/pyvenv.cfg" in problem


def test_an_environment_that_hides_debians_packages_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "rospy").mkdir()
    monkeypatch.setattr(ros_packages, "DEBIAN_PYTHON", tmp_path)
    without(monkeypatch, "rospy")
    problem = ros_packages.ros_problem()
    assert "apt install" not in problem and "include-system-site-packages" in problem


def test_with_ros_nothing_is_missing() -> None:
    if any(importlib.util.find_spec(module) is None for module in ros_packages.PACKAGES):
        pytest.skip("ROS is absent")
    assert ros_packages.ros_problem() == ""


@pytest.mark.parametrize("module", sorted(missing.EXTRAS))
def test_a_module_of_an_extra_is_reported_by_the_command_that_needs_it(module: str) -> None:
    code = (
        f"import sys\nsys.modules[{module!r}] = None\nfrom ligature.cli import command, main\n"
        f"def app():\n    import {module}\nmain.app = app\ncommand.ligature()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 2 and "Traceback" not in done.stderr
    assert f"the Python package {module} is missing; run: pip install 'ligature-sim[" in done.stderr


def test_an_error_of_our_own_is_not_taken_for_a_missing_package() -> None:
    code = (
        "from ligature.cli import command, main\n"
        "def app():\n    import ligature.nowhere\nmain.app = app\ncommand.ligature()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 1 and "No module named 'ligature.nowhere'" in done.stderr
