"""What is imported or read is named in the lists that a bare machine is set up from, and in the right one."""

from __future__ import annotations

import ast
import re
import sys
from functools import cache
from importlib.metadata import packages_distributions
from pathlib import Path

from tests.conftest import ROOT

OPTIONAL = {"av", "mujoco", "onnxruntime", "pyarrow", "ray"}
"""Imported where they are used, with a line that names the package to install."""

BLENDER = {"bpy", "bmesh", "bpy_extras", "addon_utils", "mathutils", "gpu", "gpu_extras", "blf"}
OURS = {"ligature", "ambf_msgs", "crtk_msgs", "cisst_msgs", "ambf_client"}


def listed(name: str) -> set[str]:
    """The packages of a list, without versions, in lower case."""
    lines = (line.split("#")[0].strip() for line in (ROOT / name).read_text().splitlines())
    return {re.split(r"[=<>\[]", line)[0].lower().replace("_", "-") for line in lines if line}


@cache
def imported(folder: str) -> set[str]:
    """The modules that files below ``folder`` import from elsewhere, by their first name."""
    found: set[str] = set()
    own = {path.stem for path in (ROOT / folder).rglob("*.py")} | {path.name for path in (ROOT / folder).rglob("*")}
    for path in (ROOT / folder).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and not node.level:
                names = [node.module or ""]
            found |= {name.split(".")[0] for name in names}
    return found - set(sys.stdlib_module_names) - OURS - BLENDER - own


@cache
def installed() -> dict[str, list[str]]:
    """Packages by the modules that they bring, of this environment."""
    return dict(packages_distributions())


def suppliers(module: str) -> set[str]:
    """Packages of either list that may supply ``module``: by what is installed, and by Debian's custom."""
    named = {name.lower().replace("_", "-") for name in installed().get(module, [])}
    return named | {module.lower(), f"python3-{module.replace('_', '-')}"}


def test_what_the_simulator_imports_is_in_the_lists_for_running() -> None:
    lists = listed("requirements.txt") | listed("debian-packages.txt")
    modules = (imported("simulator") | imported("scenes")) - OPTIONAL
    lacking = {module for module in modules if not suppliers(module) & lists}
    assert lacking <= {"llvmlite"}, lacking  # numba's own part


def test_running_needs_nothing_of_the_developers() -> None:
    both = listed("requirements.txt") & listed("requirements-dev.txt")
    assert not both and not listed("debian-packages.txt") & listed("debian-packages-tests.txt")
    heavy = {"ray", "selenium", "mujoco", "mypy", "matplotlib", "hypothesis", "pytest"}
    assert heavy <= listed("requirements-dev.txt") and not heavy & listed("requirements.txt")


def test_message_definitions_that_are_read_are_named() -> None:
    """They are only recommended by the packages that bring the modules."""
    read = set(re.findall(r"/usr/share/(\w+)/msg", (ROOT / "ros_msgs" / "generate.sh").read_text()))
    for manifest in (ROOT / "ros_msgs").glob("*/package.xml"):
        read |= set(re.findall(r"<build_depend>(\w+_msgs)<", manifest.read_text())) - OURS
    assert read and {f"ros-{name.replace('_', '-')}" for name in read} <= listed("debian-packages.txt")


def test_every_imported_message_package_is_named_with_its_definitions() -> None:
    lists = listed("debian-packages.txt")
    for module in imported("simulator") | imported("tests"):
        if module.endswith(("_msgs", "_srvs")):
            name = module.replace("_", "-")
            assert {f"python3-{name}", f"ros-{name}"} <= lists, module


def test_make_run_stays_off_the_lists_of_developers() -> None:
    rules = dict(re.findall(r"^([^\s:#]+): ?(.*)$", (ROOT / "Makefile").read_text(), flags=re.MULTILINE))
    needed, seen = ["run"], set()
    while needed:
        target = needed.pop()
        seen.add(target)
        needed += [name for name in rules.get(target, "").split() if name not in seen]
    assert "requirements.txt" in seen and "debian-packages.txt" in seen
    assert not {"requirements-dev.txt", "debian-packages-tests.txt"} & seen


def test_the_scripts_of_the_set_up_are_plain_shell() -> None:
    for script in Path(ROOT, ".ci").glob("*.sh"):
        assert script.read_text().startswith(("#!/bin/sh\n", "#!/usr/bin/env bash\n", "# Sourced by ")), script
