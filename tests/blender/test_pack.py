"""The packed add-on: relative imports only, no Blender in the shared packages, equal bytes for equal content."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parent.parent.parent


@pytest.fixture(scope="module")
def pack() -> ModuleType:
    spec = importlib.util.spec_from_file_location("pack", ROOT / "blender_addon" / "pack.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_packed_modules_import_each_other_relatively_and_the_rooms_know_no_blender(
    pack: ModuleType, tmp_path: Path
) -> None:
    addon = pack.stage(tmp_path, vendored=False)
    modules = list(addon.rglob("*.py"))
    assert len(modules) > 60 and not (addon / "pack.py").exists()
    for module in modules:
        text = module.read_text(encoding="utf-8")
        assert not re.search(r"^\s*(from|import) ligature\b", text, re.MULTILINE), module
        if "ligature" in module.relative_to(addon).parts:
            assert not re.search(r"^\s*(from|import) (bpy|mathutils|bmesh)\b", text, re.MULTILINE), module
            assert not re.search(r"^(from|import) (scipy|numba|trimesh)\b", text, re.MULTILINE), module


def test_version_branches_stand_in_one_file() -> None:
    for module in (ROOT / "blender_addon").glob("*.py"):
        if module.name != "compat.py":
            assert "bpy.app.version" not in module.read_text(encoding="utf-8"), module


def test_equal_content_gives_equal_bytes(pack: ModuleType, tmp_path: Path) -> None:
    addon = pack.stage(tmp_path, vendored=False)
    first = pack.write_zip(addon, tmp_path / "a.zip", "x/").read_bytes()
    assert pack.write_zip(addon, tmp_path / "b.zip", "x/").read_bytes() == first
