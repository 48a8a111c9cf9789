"""A fresh Blender for each test, with the add-on enabled as a user enables it."""

import os
from pathlib import Path

import bpy
import pytest

NAME = "adf_studio"


@pytest.fixture
def corpus():
    """Folder of real scenes of others."""
    path = Path(os.environ.get("LIGATURE_CORPUS", "/nowhere"))
    if not path.is_dir():
        pytest.skip("the corpus is absent; set LIGATURE_CORPUS")
    return path


@pytest.fixture(autouse=True)
def addon():
    """The add-on in an empty Blender."""
    import addon_utils  # found once bpy is imported

    bpy.ops.wm.read_factory_settings(use_empty=True)
    module = addon_utils.enable(NAME, default_set=True)
    assert module is not None
    yield module
    addon_utils.disable(NAME, default_set=True)
