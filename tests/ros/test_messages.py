"""Message definitions: every MD5 sum of the interface reference §1.1 and §1.5."""

from __future__ import annotations

import importlib

import pytest

AMBF = """
ActuatorCmd 95500dea47e70fe03427341c7d1aa9f0
ActuatorState bb54291f69633b7821b7930b1ec68d2b
CameraCmd 4c77af9a51e6b28efe30862e7d6b0479
CameraState a407bd98dbe1308fc98fc9d52379c405
LightCmd 4c77af9a51e6b28efe30862e7d6b0479
LightState a407bd98dbe1308fc98fc9d52379c405
ObjectCmd 091c255bd5039de21056e952538cf83c
ObjectState 3dc87d37c7ec8f949bfbd135c2cfe5a8
RigidBodyCmd c54fc48da5e84240a367eff7725e74b4
RigidBodyState c0ba0eb38f2481828a038f3b17ce0623
SensorCmd 8f1886769be440a6a76a9e6c56ba2056
SensorState e405887246b5afd9e382d4a7a0f69926
VehicleCmd 20858f9fdd87217d00304616067bb7b4
VehicleState 0196943764f0cf7865b5798046e2027c
WorldCmd 6941ddbc8f8196cff4beb0278a6ad79d
WorldState 6e545bb4d1457db0c1ee58df8e46d570
ContactData fa9406851f936701ab8c14a333a3f2e2
ContactEvent eb82193058a0ca0d1eedde1e59b63259
ContactSensorCmd d7be0bb39af8fb9129d5a76e6b63a290
ContactSensorState 69bafc7aa5201075354dea9d8be980d5
GhostObjectCmd d7be0bb39af8fb9129d5a76e6b63a290
GhostObjectState 415d13a1e544582332f8da23ceee6c2f
"""
CRTK = """
OperatingState b1bd4021639d9d9c5fbfff78d6ff3158
StringStamped 5e3e46086181199270f1ac3a28a5977f
CartesianState 3913bf7ef8bcc8fa7a8eb33a46f273db
CartesianImpedanceHalfPlaneGains b8790a9e2c72de6fc930123c128d3b77
CartesianImpedance 59675c5b57c990d0b76f7f0c9954d4f3
SetpointMode 45488f3061f396e81b1a70a7e6acdfa4
JointServo 660a5227424e1ddeb4a13710d9166974
CartesianServo 6a249c3960a5b413513e5f1e23a82d6d
"""
SERVICES = """
QueryForwardKinematics 787c6da7a75e9886573c4af11f1a381f
QueryInverseKinematics ce8dbc3b4384e2f7567488e7e75496d8
TriggerOperatingState d941a2d049e2c9ac5773fc4a3a8a892d
"""


def rows(module: str, text: str) -> list[tuple[str, str, str]]:
    return [(module, *line.split()) for line in text.strip().splitlines()]  # type: ignore[misc]


@pytest.mark.parametrize(
    ("module", "name", "md5"),
    [*rows("ambf_msgs.msg", AMBF), *rows("crtk_msgs.msg", CRTK), *rows("crtk_msgs.srv", SERVICES)],
)
def test_definitions_match_the_originals_byte_for_byte(module: str, name: str, md5: str) -> None:
    assert getattr(importlib.import_module(module), name)._md5sum == md5


def test_constants_of_rigid_body_commands() -> None:
    from ambf_msgs.msg import RigidBodyCmd

    assert (RigidBodyCmd.TYPE_FORCE, RigidBodyCmd.TYPE_POSITION, RigidBodyCmd.TYPE_VELOCITY) == (0, 1, 2)
