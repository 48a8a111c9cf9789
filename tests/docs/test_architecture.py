"""The page of the architecture and the import contracts name every package."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import ligature
import pytest
from ligature.model.state import state_dtype

from tests.conftest import ROOT

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

sys.path.insert(0, str(ROOT / "docs" / "site"))
import reference  # noqa: E402

PACKAGE = Path(ligature.__file__).parent
PACKAGES = {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
MODULES = {path.stem for path in PACKAGE.glob("[a-z]*.py")}
CONTRACTS = {
    contract["name"]: contract
    for contract in tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
}
BESIDE = {"bundle", "definitions", "deprecation", "process"}
"""Small modules that any layer may use."""


def listed(names: list[str]) -> set[str]:
    """Packages and modules in a list of a contract."""
    return {word.removeprefix("ligature.") for name in names for word in name.split(" | ")}


def test_every_package_and_module_has_a_row() -> None:
    rows = set(re.findall(r"^\| `(\w+)`", (ROOT / "docs" / "architecture.md").read_text(), flags=re.MULTILINE))
    assert rows == PACKAGES | MODULES


def test_every_package_has_a_page_in_the_reference() -> None:
    documented = [*reference.PUBLIC, *reference.PARTS]
    assert len(documented) == len(set(documented))
    assert set(documented) == PACKAGES - {"cli"} | {"simulation"}  # `cli` has the generated page of commands
    listed = re.findall(r"^api/(\w+)$", (ROOT / "docs" / "python.md").read_text(), flags=re.MULTILINE)
    assert listed == ["ligature", *documented]


def test_the_page_of_the_state_has_every_field() -> None:
    dtype = state_dtype(ligature.load("suturing_small"))
    rows = re.findall(r"^\| `(\w+)` \| [^|]+ \| [^|]* \| ([^|]+) \|$", reference.state(), flags=re.MULTILINE)
    assert [name for name, _ in rows] == list(dtype.names or ())
    assert len({meaning for _, meaning in rows}) > 50  # none is empty or a copy


def test_the_layers_hold_every_package() -> None:
    assert listed(CONTRACTS["Data runs one way"]["layers"]) | BESIDE | {"client"} == PACKAGES | MODULES


def test_the_client_may_use_no_other_package() -> None:
    forbidden = listed(CONTRACTS["The client stands alone"]["forbidden_modules"]) - {"numpy"}
    assert forbidden == (PACKAGES | MODULES) - {"client"}


@pytest.mark.parametrize("library", ["pybullet", "moderngl", "glfw", "viser", "websockets", "rospy", "rosbag"])
def test_a_contract_of_all_packages_keeps_a_library_in_its_own(library: str) -> None:
    (contract,) = (c for c in CONTRACTS.values() if library in c.get("forbidden_modules", ()))
    assert contract["source_modules"] == ["ligature"]
    assert contract["ignore_imports"]
