"""What to install when a module of an optional feature is missing."""

from __future__ import annotations

from collections.abc import Mapping

from ligature.cli.ros_packages import OUR_MESSAGES, PACKAGES, ros_problem

EXTRAS: Mapping[str, str] = {
    "gymnasium": "learn",
    "h5py": "learn",
    "viser": "cockpit",
    "websockets": "cockpit",
    "pyarrow": "lerobot",
    "av": "lerobot",
    "onnxruntime": "train",
    "mujoco": "convert",
}
"""Modules that only one feature needs, and the extra of the distribution that installs each."""


def remedy(module: str) -> str:
    """What to do about ``module``, which cannot be imported; empty when it is none of an optional feature."""
    name = module.split(".")[0]
    if name in EXTRAS:
        return f"the Python package {name} is missing; run: pip install 'ligature-sim[{EXTRAS[name]}]'"
    return ros_problem() if name in PACKAGES or name in OUR_MESSAGES else ""
