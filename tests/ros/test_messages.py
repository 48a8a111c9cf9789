"""Message definitions: their MD5 sums are those of AMBF 2.0 and 3.0, crtk_msgs 1.3.0, cisst_msgs and Debian 12."""

from __future__ import annotations

import importlib

import pytest

from tests.ros.conftest import ROOT

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


CISST = """
IntervalStatistics 25eabfa93979fc6d9ab895c84674476c
mtsIntervalStatistics fc177c4951f85470a8a9c80c56822cfb
BoolStamped 542e22b190dc8e6eb476d50dda88feb7
DoubleVec fb60495edd59d3fcf90e173153ae8a9a
"""
CISST_SERVICES = "ConvertFloat64Array cfaed3f0a946c7fe3a617e0ff7c368ec"
STD = """
String 992ce8a1687cec8c8bd883ec73ca41d1
Header 2176decaecbce78abc3b96ef049fabed
Empty d41d8cd98f00b204e9800998ecf8427e
Bool 8b94c1b53db61fb6aed406028ad6332a
Float32 73fcbf46b49191e672908e50842a83d4
Float64 fdb28210bfa9d7c91146260178d9a584
Float64MultiArray 4b7d974086d4060e7db4613a7e6c3ba4
UInt64 1b2a79973e8bf53d7b53acb71299cb57
"""
GEOMETRY = """
Point 4a842b65f413084dc2b10fb484ea7f17
Vector3 4a842b65f413084dc2b10fb484ea7f17
Quaternion a779879fadf0160734f906b8c19c7004
Pose e45d45a5a1ce597b249e23fb30fc871f
PoseStamped d3812c3cbc69362b77dc0b19b345f8f5
PoseArray 916c28c5764443f268b296bb671b9d97
TransformStamped b5764a33bfeb3588febc2682852579b0
Twist 9f195f881246fdfa2798d1d3eebca84a
TwistStamped 98d34b0043a2093cf9d9345ab6eef12e
Wrench 4f539cf138b23283b520fd271b567936
WrenchStamped d78d3cb249ce23087ade7e7d0c40cfa7
QuaternionStamped e57f1e547e0e1fd13504588ffc8334e2
"""
SENSOR = """
JointState 3066dcd76a6cfaef579bd0f34173e9fd
Joy 5a9ea5f83505693b71e785041e67a8bb
Image 060021388200f6f0f447d0fcd9c64743
CameraInfo c9a58c1b0b154e0e6da7578cb991d214
PointCloud d8e9c3f5afbdd8a130fd1d2763945fca
PointCloud2 1158d486dd51d683ce2f1be655c3c181
ChannelFloat32 3d40139cdd33dfedcb71ffeeeb42ae7f
"""


def rows(module: str, text: str) -> list[tuple[str, str, str]]:
    return [(module, *line.split()) for line in text.strip().splitlines()]  # type: ignore[misc]


@pytest.mark.parametrize(
    ("module", "name", "md5"),
    [
        *rows("ambf_msgs.msg", AMBF),
        *rows("crtk_msgs.msg", CRTK),
        *rows("crtk_msgs.srv", SERVICES),
        *rows("cisst_msgs.msg", CISST),
        *rows("cisst_msgs.srv", CISST_SERVICES),
        *rows("std_msgs.msg", STD),
        *rows("geometry_msgs.msg", GEOMETRY),
        *rows("sensor_msgs.msg", SENSOR),
        *rows("std_srvs.srv", "Trigger 937c9679a518e3a18d831e57125ea522"),
        *rows("diagnostic_msgs.msg", "KeyValue cf57fdc6617a881a88c16e768132149c"),
        *rows("tf2_msgs.msg", "TFMessage 94810edda583a504dfda3829e70d7eec"),
        *rows("visualization_msgs.msg", "Marker 4048c9de2a16f4ae8e0538085ebf1b97"),
        *rows("rosgraph_msgs.msg", "Clock a9c97c1d230cfc112e270351a944ee47"),
    ],
)
def test_definitions_match_the_originals_byte_for_byte(module: str, name: str, md5: str) -> None:
    assert getattr(importlib.import_module(module), name)._md5sum == md5


def test_constants_of_rigid_body_commands() -> None:
    from ambf_msgs.msg import RigidBodyCmd

    assert (RigidBodyCmd.TYPE_FORCE, RigidBodyCmd.TYPE_POSITION, RigidBodyCmd.TYPE_VELOCITY) == (0, 1, 2)


def test_what_another_tool_computes_from_the_definitions_agrees() -> None:
    """genmsg itself, from the files that catkin builds, beside the sums in the generated modules."""
    from genmsg.gentools import compute_md5
    from genmsg.msg_loader import MsgContext, load_depends, load_msg_from_file

    search = {package.name: [str(package / "msg")] for package in (ROOT / "ros_msgs").iterdir() if package.is_dir()}
    for package in ("std_msgs", "geometry_msgs"):
        search[package] = [f"/usr/share/{package}/msg"]
    context = MsgContext.create_default()
    for name, md5 in (line.split() for line in AMBF.strip().splitlines()):
        path = ROOT / "ros_msgs" / "ambf_msgs" / "msg" / f"{name}.msg"
        spec = load_msg_from_file(context, str(path), f"ambf_msgs/{name}")
        load_depends(context, spec, search)
        assert compute_md5(context, spec) == md5
