"""Packs the extension: its own files, the packages adf, mesh and authoring, cache and paths, and the wheels it needs.

``python blender_addon/pack.py OUT`` writes the legacy zip (Blender 3.4 to 4.1) and the extension zip
(4.2 and later); ``--stage FOLDER`` only lays the legacy form out in a folder, for tests. Imports of
``ligature`` become relative, so that the add-on adds no top-level module to Blender.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
SIMULATOR = HERE.parent / "simulator" / "ligature"
SHARED = ("adf", "mesh", "authoring")
MODULES = ("cache.py", "paths.py")
LEFT_OUT = {"mesh/distance.py", "mesh/quality.py", "mesh/decompose.py", "mesh/coacd_process.py"}
"""Modules that need numba, SciPy or processes of ours, which Blender does not have."""

NAME = "adf_studio"
WHEELS = {"PyYAML": "6.0.2", "coacd": "1.0.14"}
PLATFORMS = {
    "linux-x64": ("manylinux2014_x86_64", "manylinux_2_17_x86_64", "manylinux_2_28_x86_64", "manylinux_2_31_x86_64"),
    "windows-x64": ("win_amd64",),
    "macos-arm64": ("macosx_11_0_arm64", "macosx_14_0_arm64", "macosx_15_0_arm64"),
}
PYTHONS = ("311", "313")
_IMPORT = re.compile(r"^(\s*)from ligature\.(\S+) import ", re.MULTILINE)
_FIXED_TIME = (2026, 1, 1, 0, 0, 0)


GUIDE = HERE.parent / "docs" / "blender.md"
"""The page that a button of the preferences opens."""


def stage(target: Path, vendored: bool) -> Path:
    """Lay the add-on out below ``target``; ``vendored`` adds pure-Python PyYAML for Blenders without it."""
    addon = target / NAME
    shutil.rmtree(addon, ignore_errors=True)
    ignored = shutil.ignore_patterns("__pycache__", "pack.py", "*.toml")
    shutil.copytree(HERE, addon, ignore=ignored)
    shutil.copyfile(GUIDE, addon / GUIDE.name)
    (addon / "ligature").mkdir()
    (addon / "ligature" / "__init__.py").write_text(
        '"""The packages of Ligature that authors need."""\n', encoding="utf-8"
    )
    for package in SHARED:
        for source in sorted((SIMULATOR / package).rglob("*.py")):
            name = source.relative_to(SIMULATOR)
            if name.as_posix() not in LEFT_OUT:
                _copy(source, addon / "ligature" / name, "." * len(name.parts))
    for module in MODULES:
        _copy(SIMULATOR / module, addon / "ligature" / module, ".")
    if vendored:
        _vendor_yaml(addon / "vendor")
    return addon


def _copy(source: Path, target: Path, dots: str) -> None:
    """Copy a module with its imports made relative; ``dots`` lead to the packed ``ligature``."""
    text = _IMPORT.sub(rf"\1from {dots}\2 import ", source.read_text(encoding="utf-8"))
    text = re.sub(r"^import yaml$", f"from {dots}.yaml_module import yaml", text, flags=re.MULTILINE)
    if re.search(r"^\s*import ligature\b", text, re.MULTILINE):
        raise SystemExit(f"{source}: import names with 'from ligature.… import', so that they can be packed")
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(text, encoding="utf-8")


def _vendor_yaml(folder: Path) -> None:
    """The pure-Python part of PyYAML, which imports itself relatively."""
    with tempfile.TemporaryDirectory() as unpacked:
        wheel = _download("PyYAML", "311", ("manylinux2014_x86_64", "manylinux_2_17_x86_64"), Path(unpacked))
        with zipfile.ZipFile(wheel) as archive:
            for name in archive.namelist():
                if name.startswith("yaml/") and name.endswith(".py"):
                    (folder / name).parent.mkdir(parents=True, exist_ok=True)
                    (folder / name).write_bytes(archive.read(name))
                if name.upper().endswith("LICENSE"):
                    folder.mkdir(parents=True, exist_ok=True)
                    (folder / "PyYAML-LICENSE").write_bytes(archive.read(name))
    (folder / "__init__.py").write_text('"""Packages for Blenders that lack them."""\n', encoding="utf-8")


def _download(package: str, python: str, platforms: tuple[str, ...], folder: Path) -> Path:
    """The wheel of a package, unmodified from the package index."""
    command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--only-binary=:all:"]
    command += ["--disable-pip-version-check", "--python-version", python, "--dest", str(folder.resolve())]
    command += [word for platform in platforms for word in ("--platform", platform)]
    before = set(folder.glob("*.whl"))
    subprocess.run([*command, f"{package}=={WHEELS[package]}"], check=True, cwd=folder)
    new = sorted(set(folder.glob("*.whl")) - before)
    return (
        new[0] if new else next(f for f in sorted(folder.glob("*.whl")) if f.name.lower().startswith(package.lower()))
    )


def write_zip(folder: Path, target: Path, top: str) -> Path:
    """A zip of ``folder`` with equal bytes for equal content."""
    target.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(p for p in folder.rglob("*") if p.is_file() and "__pycache__" not in p.parts):
            entry = zipfile.ZipInfo(f"{top}{file.relative_to(folder).as_posix()}", _FIXED_TIME)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = 0o644 << 16
            archive.writestr(entry, file.read_bytes())
    return target


def legacy_zip(out: Path) -> Path:
    """The add-on for Blender 3.4 to 4.1; CoACD is used when Blender's Python has it."""
    with tempfile.TemporaryDirectory() as folder:
        addon = stage(Path(folder), vendored=True)
        return write_zip(addon, out / f"{NAME}-legacy.zip", f"{NAME}/")


def extension_zip(out: Path, platform: str) -> Path:
    """The extension for Blender 4.2 and later on one platform, with its wheels."""
    with tempfile.TemporaryDirectory() as folder:
        addon = stage(Path(folder), vendored=False)
        wheels = addon / "wheels"
        wheels.mkdir()
        for package in WHEELS:
            for python in PYTHONS:
                _download(package, python, PLATFORMS[platform], wheels)
        names = sorted(f"./wheels/{wheel.name}" for wheel in wheels.glob("*.whl"))
        manifest = (HERE / "blender_manifest.toml").read_text(encoding="utf-8")
        listed = "".join(f'  "{name}",\n' for name in names)
        head, _, tail = manifest.partition("\n[permissions]")
        text = f'{head}platforms = ["{platform}"]\nwheels = [\n{listed}]\n\n[permissions]{tail}'
        (addon / "blender_manifest.toml").write_text(text, encoding="utf-8")
        return write_zip(addon, out / f"{NAME}-{platform}.zip", "")


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description="Pack the Blender extension.")
    parser.add_argument("out", type=Path, nargs="?", default=Path("dist"))
    parser.add_argument("--stage", type=Path, help="lay the legacy form out in this folder and stop")
    parser.add_argument("--platform", choices=sorted(PLATFORMS), action="append", help="only these platforms")
    arguments = parser.parse_args()
    if arguments.stage:
        stage(arguments.stage, vendored=False)
        return
    made = [legacy_zip(arguments.out)]
    made += [extension_zip(arguments.out, platform) for platform in arguments.platform or PLATFORMS]
    sys.stdout.write("".join(f"{path} {path.stat().st_size} bytes\n" for path in made))


if __name__ == "__main__":
    main()
