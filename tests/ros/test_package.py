"""The repository as ROS packages: built and installed by Debian's catkin, started by roslaunch."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.ros.conftest import ROOT, Program, free_port
from tests.test_requirements import imported

pytestmark = pytest.mark.ros

MESSAGES = ("ambf_msgs", "cisst_msgs", "crtk_msgs")


def make(workspace: Path, *words: str, timeout: float = 400.0) -> subprocess.CompletedProcess[str]:
    """``catkin_make`` as in a shell of its own, without the environment of the tests."""
    env = {name: value for name, value in os.environ.items() if not name.startswith(("ROS_", "PYTHONPATH", "VIRTUAL"))}
    env.update(PATH="/usr/bin:/bin", PWD=str(workspace), LIGATURE_PYTHON=sys.executable)
    env.update(ROS_MASTER_URI=f"http://127.0.0.1:{free_port()}")
    return subprocess.run(
        ["/usr/bin/catkin_make", "-DPYTHON_EXECUTABLE=/usr/bin/python3", *words],
        cwd=workspace, env=env, capture_output=True, text=True, timeout=timeout,
    )  # fmt: skip


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A catkin workspace with our packages and one of a stranger's, built and installed."""
    folder = tmp_path_factory.mktemp("workspace")
    source = folder / "src"
    (source / "ligature").mkdir(parents=True)
    for name in MESSAGES:
        shutil.copytree(ROOT / "ros_msgs" / name, source / name)
    # copies, since cmake installs a link as a link
    for name in ("package.xml", "CMakeLists.txt", "setup.py", "pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source / "ligature" / name)
    for name in ("simulator", "launch", "scenes", "examples", "tests/ros"):
        shutil.copytree(ROOT / name, source / "ligature" / name, ignore=shutil.ignore_patterns("__pycache__", "my_lab"))
    shutil.copytree(ROOT / "examples" / "rostest" / "my_lab", source / "my_lab")
    done = make(folder, "install")
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return folder


@pytest.fixture(scope="module")
def installed(workspace: Path) -> dict[str, str]:
    """The environment of a shell that has sourced the install space, with our Python named."""
    clean = {"PATH": "/usr/bin:/bin", "HOME": os.environ.get("HOME", "/"), "LIGATURE_PYTHON": sys.executable}
    command = f". {workspace / 'install' / 'setup.sh'} && env -0"
    done = subprocess.run(["/bin/sh", "-c", command], env=clean, capture_output=True, text=True, check=True)
    return dict(line.split("=", 1) for line in done.stdout.split("\0") if line)


def test_message_packages_and_the_simulator_build_under_catkin(workspace: Path) -> None:
    (packages,) = (workspace / "devel" / "lib").glob("python3*/*-packages")
    assert {*MESSAGES, "ligature"} <= {path.name for path in packages.iterdir()}
    generated = (packages / "ambf_msgs" / "msg" / "_RigidBodyState.py").read_text()
    assert "c0ba0eb38f2481828a038f3b17ce0623" in generated


def test_the_install_space_has_program_launch_files_scenes_and_package(
    workspace: Path, installed: dict[str, str]
) -> None:
    space = workspace / "install"
    assert os.access(space / "lib" / "ligature" / "ligature_run", os.X_OK)
    share = space / "share" / "ligature"
    assert {path.name for path in (share / "launch").iterdir()} == {p.name for p in (ROOT / "launch").glob("*.launch")}
    code = "import ligature, ligature.bundle as b, ambf_msgs.msg as m; print(ligature.__file__, b.SCENES, m.__file__)"
    done = subprocess.run([sys.executable, "-c", code], env=installed, cwd="/", capture_output=True, text=True)
    package, scenes, messages = done.stdout.split()
    assert Path(scenes) == share / "scenes" and (share / "scenes" / "suturing" / "launch.yaml").is_file()
    assert package.startswith(str(space)) and messages.startswith(str(space))


def test_roslaunch_finds_launch_file_and_program_in_the_install_space(
    workspace: Path, installed: dict[str, str]
) -> None:
    command = ["/usr/bin/roslaunch", "--args", "ligature_supervisor", "ligature", "suturing_small.launch"]
    done = subprocess.run(command, env=installed, capture_output=True, text=True, timeout=60)
    program, scene = done.stdout.split()[:2]
    assert program == str(workspace / "install" / "lib" / "ligature" / "ligature_run"), done.stdout + done.stderr
    assert scene == str(workspace / "install" / "share" / "ligature" / "scenes" / "suturing_small" / "launch.yaml")


@pytest.mark.slow  # the kernels of another copy of the sources compile anew
@pytest.mark.timeout(1800)
def test_roslaunch_starts_a_scene_from_the_install_space(
    start: Callable[..., Program], installed: dict[str, str]
) -> None:
    env = dict(installed, ROS_MASTER_URI=f"http://127.0.0.1:{free_port()}", ROS_IP="127.0.0.1")
    program = start("/usr/bin/roslaunch", "ligature", "suturing_small.launch", "options:=-p 200", env=env)
    program.wait_for("first state published", 1500.0)
    assert program.end(20) == 0


def test_the_install_space_without_our_python_packages_names_what_to_install(
    workspace: Path, installed: dict[str, str]
) -> None:
    program = workspace / "install" / "lib" / "ligature" / "ligature_run"
    env = {name: value for name, value in installed.items() if name != "LIGATURE_PYTHON"}
    done = subprocess.run([program, "suturing"], env=env, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert "python3 lacks the Python packages of Ligature" in done.stderr and "LIGATURE_PYTHON" in done.stderr


@pytest.mark.slow
@pytest.mark.timeout(2800)
def test_run_tests_runs_the_rostests(workspace: Path) -> None:
    # configured anew, since the first configuration writes down an environment without the packages that it builds
    done = make(workspace, "--force-cmake", "run_tests", timeout=2600.0)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    results = sorted((workspace / "build" / "test_results").glob("*/rosunit-*.xml"))
    assert [(path.parent.name, path.stem) for path in results] == [
        *(("ligature", f"rosunit-{name}") for name in ("arms", "objects", "score", "teleoperation")),
        ("my_lab", "rosunit-fall"),
    ]
    for path in results:
        suite = ET.parse(path).getroot()
        counts = {key: int(suite.get(key, 0)) for key in ("tests", "failures", "errors")}
        assert counts == {"tests": 1, "failures": 0, "errors": 0}, path.read_text()


def test_the_manifest_names_every_ros_package_that_is_imported() -> None:
    named = set(re.findall(r"<exec_depend>(\w+)<", (ROOT / "package.xml").read_text()))
    needed = {module for module in imported("simulator") if module.startswith("ros") or module.endswith("_msgs")}
    assert {"std_srvs", "tf2_msgs", "genpy", *MESSAGES, *needed} <= named


def test_roslaunch_starts_the_small_scene(start: Callable[..., Program], ros_env: dict[str, str]) -> None:
    env = dict(ros_env, ROS_MASTER_URI=f"http://127.0.0.1:{free_port()}")
    env["ROS_PACKAGE_PATH"] = f"{ROOT}:{ROOT / 'ros_msgs'}"
    program = start("/usr/bin/roslaunch", ROOT / "launch" / "suturing_small.launch", "options:=-p 200", env=env)
    program.wait_for("first state published")
    assert program.end(20) == 0
