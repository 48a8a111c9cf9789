"""Wheel and source distribution hold what a stranger needs; the metadata agree with the locks and with catkin's."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tarfile
import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path

import ligature
import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tests.conftest import ROOT

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
EXTRAS = PROJECT["optional-dependencies"]
SET_UP = {"setuptools", "wheel"}
"""What the locks pin for the set-up itself."""


def files(*folders: str) -> set[str]:
    """The tracked files below ``folders``, relative to the root."""
    listed = subprocess.run(
        ["git", "-c", f"safe.directory={ROOT}", "ls-files", *folders],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    return {name for name in listed.stdout.split("\n") if name and (ROOT / name).is_file()}


def locked(name: str) -> dict[str, str]:
    pins = (line.split("#")[0].strip() for line in (ROOT / name).read_text().splitlines())
    return {canonicalize_name(pin.split("==")[0]): pin.split("==")[1] for pin in pins if pin}


@pytest.fixture(scope="module")
def distributions(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the source distribution, and the wheel that is built from it."""
    if not Path("/usr/lib/genpy").is_dir():
        pytest.skip("python3-genpy is absent: the ROS messages cannot be generated")
    folder = tmp_path_factory.mktemp("dist")
    copy = tmp_path_factory.mktemp("checkout")
    for name in files("."):
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        (copy / name).write_bytes((ROOT / name).read_bytes())
        (copy / name).chmod((ROOT / name).stat().st_mode)
    done = subprocess.run(
        [sys.executable, "-m", "build", "--no-isolation", "--outdir", folder, copy], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return folder


@pytest.fixture(scope="module")
def wheel(distributions: Path) -> zipfile.ZipFile:
    (path,) = distributions.glob("*.whl")
    assert path.name == f"ligature_sim-{ligature.__version__}-py3-none-any.whl"
    return zipfile.ZipFile(path)


def test_the_wheel_holds_package_scenes_examples_shaders_and_messages(wheel: zipfile.ZipFile) -> None:
    names = {name for name in wheel.namelist() if ".dist-info/" not in name}
    package = {name.removeprefix("simulator/") for name in files("simulator")}
    assert any(name.endswith(".glsl") for name in package)
    bundled = {f"ligature/bundled/{name}" for name in files("scenes", "examples")}
    messages = {
        f"{path.parts[1]}/{path.parts[2]}/_{path.stem}.py"
        for path in map(Path, files("ros_msgs")) if path.suffix in (".msg", ".srv")
    }  # fmt: skip
    assert len(messages) > 30 and package | bundled | messages <= names
    assert {name for name in names - package - bundled - messages if not name.endswith("/__init__.py")} == set()


def test_messages_of_the_wheel_are_those_that_amb_clients_expect(wheel: zipfile.ZipFile) -> None:
    assert b"c0ba0eb38f2481828a038f3b17ce0623" in wheel.read("ambf_msgs/msg/_RigidBodyState.py")


def test_the_source_distribution_carries_everything_tracked_and_the_messages(distributions: Path) -> None:
    (path,) = distributions.glob("*.tar.gz")
    with tarfile.open(path) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    left_out = {name for name in files(".") - names if not name.startswith((".git", ".pre-commit"))}
    assert left_out == set()
    assert "ros_msgs/python/crtk_msgs/srv/_TriggerOperatingState.py" in names


def test_the_unpacked_wheel_finds_its_scenes_by_name(wheel: zipfile.ZipFile, tmp_path: Path) -> None:
    wheel.extractall(tmp_path)
    done = subprocess.run(
        [sys.executable, "-m", "ligature", "check", "peg_transfer"],
        cwd="/", env=dict(os.environ, PYTHONPATH=str(tmp_path)), capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert f"{tmp_path}/ligature/bundled/scenes/peg_transfer/launch.yaml: 0 errors" in done.stdout, done.stderr


def test_every_pin_lies_within_the_bounds_and_every_bounded_package_is_pinned() -> None:
    running = [
        *PROJECT["dependencies"],
        *(x for name in ("learn", "lerobot", "cockpit", "convert") for x in EXTRAS[name]),
    ]
    pins = locked("requirements.txt") | locked("requirements-dev.txt")
    named = {canonicalize_name(r.name): r for r in map(Requirement, [*running, *EXTRAS["dev"]])}
    assert set(named) == set(pins) - SET_UP
    outside = {name: pins[name] for name, requirement in named.items() if pins[name] not in requirement.specifier}
    assert outside == {}
    for requirement in named.values():
        assert any(s.operator == ">=" for s in requirement.specifier), requirement
        assert "==" not in str(requirement), requirement


def test_what_users_run_is_locked_apart_from_what_developers_need() -> None:
    dev = {canonicalize_name(Requirement(text).name) for text in EXTRAS["dev"]}
    assert dev <= set(locked("requirements-dev.txt")) and not dev & set(locked("requirements.txt"))


def test_all_manifests_name_one_version() -> None:
    assert ET.parse(ROOT / "package.xml").findtext("version") == ligature.__version__
    manifest = tomllib.loads((ROOT / "blender_addon" / "blender_manifest.toml").read_text())
    assert manifest["version"] == ligature.__version__
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert citation["version"] == ligature.__version__
    newest = re.search(r"^## .*$", (ROOT / "CHANGELOG.md").read_text(), flags=re.MULTILINE)
    assert newest and newest[0] == f"## [{ligature.__version__}] - {citation['date-released']}"


def test_pages_name_the_wheel_of_this_version() -> None:
    named = {
        (path.name, version)
        for path in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
        for version in re.findall(r"ligature_sim-(\d[\w.]*)-py3", path.read_text())
    }
    assert named and {version for _, version in named} == {ligature.__version__}, named


IMPORTED = {
    "learn": ("gymnasium", "h5py", "ligature.environments"),
    "lerobot": ("h5py", "pyarrow.parquet", "av", "ligature.datasets.lerobot"),
    "train": ("torch", "stable_baselines3", "onnx", "onnxscript", "onnxruntime"),
    "cockpit": ("viser", "websockets", "ligature.cockpit.page"),
    "convert": ("mujoco",),
}
"""What each extra for users brings, as it is imported."""


def test_every_extra_for_users_is_imported_by_the_test_of_newest_packages() -> None:
    assert set(IMPORTED) == {name for name, packages in EXTRAS.items() if packages} - {"dev"}


@pytest.mark.slow
@pytest.mark.timeout(1800)  # some gigabytes to fetch and unpack
def test_the_newest_packages_that_the_bounds_allow_work_together(distributions: Path, tmp_path: Path) -> None:
    """As pip installs them for a stranger today; a package may want another of a version that pip does not know of."""
    python = tmp_path / "venv" / "bin" / "python"
    subprocess.run([sys.executable, "-m", "venv", str(tmp_path / "venv")], check=True)
    wheel = next(distributions.glob("*.whl"))
    wanted = f"{wheel}[{','.join(IMPORTED)}]"
    done = subprocess.run([python, "-m", "pip", "install", "-q", wanted], capture_output=True, text=True)
    if done.returncode and "No matching distribution" in done.stderr:
        pytest.skip(f"the index cannot be reached: {done.stderr[-300:]}")
    assert done.returncode == 0, done.stderr
    for module in (module for modules in IMPORTED.values() for module in modules):
        subprocess.run([python, "-c", f"import {module}"], cwd=tmp_path, check=True)
    example = ROOT / "examples" / "record_experts.py"
    recorded = [python, str(example), "reach.h5", "--task", "reach", "--episodes", "2"]
    subprocess.run(recorded, cwd=tmp_path, check=True)
    ligature_command = tmp_path / "venv" / "bin" / "ligature"
    subprocess.run([ligature_command, "dataset", "export", "reach.h5", "reach"], cwd=tmp_path, check=True)
    assert list((tmp_path / "reach").rglob("*.parquet"))
