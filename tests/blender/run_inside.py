"""Runs pytest inside Blender: ``blender -b --factory-startup --python run_inside.py -- PYTEST-ARGUMENTS``."""

import os
import sys

sys.path += os.environ["LIGATURE_TEST_PACKAGES"].split(os.pathsep)  # behind Blender's own, whose numpy stays

import pytest  # noqa: E402

code = pytest.main([*sys.argv[sys.argv.index("--") + 1 :], "-p", "no:cacheprovider", "-p", "no:hypothesispytest"])
sys.stdout.flush()
os._exit(int(code))
