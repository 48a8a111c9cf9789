"""The page of the architecture and the import contracts name every room."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import ligature
import pytest

from tests.conftest import ROOT

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

PACKAGE = Path(ligature.__file__).parent
ROOMS = {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
MODULES = {path.stem for path in PACKAGE.glob("[a-z]*.py")}
CONTRACTS = {
    contract["name"]: contract
    for contract in tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
}
BESIDE = {"bundle", "definitions", "deprecation", "process"}
"""Small modules that any layer may use."""


def listed(names: list[str]) -> set[str]:
    """Rooms and modules in a list of a contract."""
    return {word.removeprefix("ligature.") for name in names for word in name.split(" | ")}


def test_every_room_and_module_has_a_row() -> None:
    rows = set(re.findall(r"^\| `(\w+)`", (ROOT / "docs" / "architecture.md").read_text(), flags=re.MULTILINE))
    assert rows == ROOMS | MODULES


def test_the_layers_hold_every_room() -> None:
    assert listed(CONTRACTS["Data runs one way"]["layers"]) | BESIDE | {"client"} == ROOMS | MODULES


def test_the_client_may_use_no_other_room() -> None:
    forbidden = listed(CONTRACTS["The client stands alone"]["forbidden_modules"]) - {"numpy"}
    assert forbidden == (ROOMS | MODULES) - {"client"}


@pytest.mark.parametrize("library", ["pybullet", "moderngl", "glfw", "viser", "websockets", "rospy", "rosbag"])
def test_a_contract_of_all_rooms_keeps_a_library_in_its_own(library: str) -> None:
    (contract,) = (c for c in CONTRACTS.values() if library in c.get("forbidden_modules", ()))
    assert contract["source_modules"] == ["ligature"]
    assert contract["ignore_imports"]
