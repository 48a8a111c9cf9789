"""Packaging of the simulator; read by pip and by catkin alike."""

from setuptools import find_packages, setup

setup(
    name="ligature",
    version="0.2.0",
    description="An open simulator for robot-assisted suturing",
    license="BSD-3-Clause",
    python_requires=">=3.10",
    package_dir={"": "simulator"},
    packages=find_packages("simulator"),
    package_data={"ligature": ["py.typed", "**/*.glsl", "**/*.vert", "**/*.frag", "client/names/*/*.py"]},
    entry_points={
        "console_scripts": [
            "ligature = ligature.cli.main:main",
            "ambf_simulator = ligature.cli.ambf_simulator:main",
        ]
    },
)
