"""Packaging of the simulator; read by pip and by catkin alike. The metadata stands in pyproject.toml.

A wheel holds the scenes, the examples and the generated ROS messages; catkin installs these by itself, elsewhere. A
source distribution carries the messages generated, so that a wheel is built from it without ROS.
"""

import re
import shutil
import subprocess
from pathlib import Path

from setuptools import find_packages, setup
from setuptools.command.build_py import build_py
from setuptools.command.sdist import sdist

ROOT = Path(__file__).resolve().parent
MESSAGES = ROOT / "ros_msgs" / "python"
"""The generated messages of a source distribution."""

VERSION = re.search(r'__version__ = "(.+)"', (ROOT / "simulator/ligature/__init__.py").read_text("utf-8"))[1]


def generate_messages(folder):
    """Generate the Python modules of the ROS messages in ``folder``."""
    if not Path("/usr/lib/genpy").is_dir():
        raise SystemExit(
            "the ROS messages cannot be generated: install the Debian packages python3-genpy, ros-std-msgs and "
            "ros-geometry-msgs, or build from a source distribution, which holds them"
        )
    subprocess.run([str(ROOT / "ros_msgs" / "generate.sh"), str(folder)], check=True)


class BuildWithBundle(build_py):
    """Adds to a wheel what stands beside the package in a checkout."""

    def run(self):
        super().run()
        if self.editable_mode or self.distribution.get_command_obj("bdist_wheel", create=False) is None:
            return
        for name in ("scenes", "examples"):
            target = Path(self.build_lib, "ligature", "bundled", name)
            shutil.copytree(ROOT / name, target, ignore=shutil.ignore_patterns("__pycache__"), dirs_exist_ok=True)
        if MESSAGES.is_dir():
            self.copy_tree(str(MESSAGES), self.build_lib)
        else:
            generate_messages(Path(self.build_lib).resolve())


class SourceWithMessages(sdist):
    """Adds the generated messages."""

    def make_release_tree(self, base_dir, files):
        super().make_release_tree(base_dir, files)
        target = Path(base_dir).resolve() / MESSAGES.relative_to(ROOT)
        if not target.is_dir():
            generate_messages(target)


setup(
    name="ligature-sim",
    version=VERSION,
    license="BSD-3-Clause",
    package_dir={"": "simulator"},
    packages=find_packages("simulator"),
    package_data={
        "ligature": ["py.typed", "**/*.glsl", "**/*.vert", "**/*.frag", "client/names/*/*.py", "cockpit/web/*"]
    },
    cmdclass={"build_py": BuildWithBundle, "sdist": SourceWithMessages},
)
