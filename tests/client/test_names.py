"""The names under which scripts import the client, and what the path does with AMBF's own."""

from __future__ import annotations

import importlib
import os
import subprocess
from pathlib import Path

import pytest

from tests.client.conftest import NAMES, ROOT

HANDLES = {
    "ambf_client": "Client",
    "ambf_actuator": "Actuator",
    "ambf_base_object": "BaseObject",
    "ambf_camera": "Camera",
    "ambf_contact_sensor": "ContactSensor",
    "ambf_ghost_object": "GhostObject",
    "ambf_light": "Light",
    "ambf_object": "Object",
    "ambf_rigid_body": "RigidBody",
    "ambf_sensor": "Sensor",
    "ambf_vehicle": "Vehicle",
    "ambf_world": "World",
    "ros_abstraction_layer": "ral",
}


@pytest.mark.parametrize("module", HANDLES)
def test_scripts_find_every_class_under_its_module(module: str) -> None:
    import ligature.client

    assert getattr(importlib.import_module(module), HANDLES[module]) is getattr(ligature.client, HANDLES[module])


@pytest.mark.parametrize("module", ["tf_function", "transformations"])
def test_scripts_find_the_conversions(module: str) -> None:
    conversions = importlib.import_module(module)
    quaternion = conversions.quaternion_from_euler(0.1, 0.2, 0.3, "szyx")
    assert conversions.euler_from_quaternion(quaternion, "szyx") == pytest.approx((0.1, 0.2, 0.3))


def imported_after_env(before: str, module: str) -> str:
    """File of ``module`` in a shell that ran ``before`` and then env.sh."""
    script = f'{before}\n. ./env.sh\npython3 -c "import {module}; print({module}.__file__)"'
    env = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "LIGATURE_CLIENT")}
    done = subprocess.run(["bash", "-ec", script], cwd=ROOT, env=env, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_env_sh_gives_scripts_our_client_where_ambf_is_absent() -> None:
    assert imported_after_env("", "ambf_client") == str(NAMES / "ambf" / "ambf_client.py")
    assert imported_after_env("", "transformations") == str(NAMES / "tf" / "transformations.py")


def test_env_sh_leaves_an_installed_ambf_alone_unless_asked(tmp_path: Path) -> None:
    theirs = tmp_path / "ambf_client.py"
    theirs.write_text("class Client: pass\n")
    there = f"export PYTHONPATH={tmp_path}"
    assert imported_after_env(there, "ambf_client") == str(theirs)
    assert imported_after_env(f"{there} LIGATURE_CLIENT=own", "ambf_client") == str(NAMES / "ambf" / "ambf_client.py")


def test_the_client_needs_none_of_the_simulators_libraries() -> None:
    code = "import sys, ambf_client; print(sorted(set(sys.modules) & {'pybullet', 'numba', 'scipy', 'trimesh'}))"
    path = os.pathsep.join(map(str, [ROOT / "simulator", ROOT / "build" / "python", NAMES / "ambf"]))
    done = subprocess.run(
        ["/usr/bin/python3", "-c", code], env=dict(os.environ, PYTHONPATH=path), capture_output=True, text=True
    )
    assert done.stdout.strip() == "[]", done.stderr
