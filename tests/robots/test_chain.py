"""Forward kinematics and Jacobians, for every kind of arm."""

from __future__ import annotations

import numpy as np
import pytest
from ligature.model.frames import frame, matrix_pose7, quaternion_matrix
from ligature.robots.chain import Chain, Convention, Link
from ligature.robots.ecm import Ecm, SrcCamera
from ligature.robots.mtm import Mtm
from ligature.robots.poses import turned
from ligature.robots.psm import Psm

from tests.robots import examples
from tests.robots.poses import pose

WRITTEN_TO = 3e-5
"""The examples were computed with right angles written as 1.5708."""

ARMS = {
    "PSM Classic": Psm("LARGE_NEEDLE_DRIVER:400006"),
    "PSM Si": Psm(420006, "Si"),
    "PSM challenge": Psm(420006, "SRC"),
    "ECM": Ecm("Classic_HD_UP"),
    "challenge camera": SrcCamera(),
    "MTML": Mtm("left"),
    "MTMR": Mtm("right"),
}

EXAMPLES = [
    *(("SRC 400006", Psm(400006, "SRC"), *example) for example in examples.SRC_400006),
    *(("SRC 420006", Psm(420006, "SRC"), *example) for example in examples.SRC_420006),
    *(("dVRK PSM Classic", Psm(400006), *example) for example in examples.DVRK_PSM),
    *(("dVRK PSM Si", Psm(420006, "Si"), *example) for example in examples.DVRK_PSM),
    *((f"dVRK ECM {scope}", Ecm(f"Classic_SD_{scope}"), q, T, xyzw) for q, scope, T, xyzw in examples.DVRK_ECM),
    *(("dVRK MTML", Mtm("left"), *example) for example in examples.DVRK_MTM),
    *(("dVRK MTMR", Mtm("right"), *example) for example in examples.DVRK_MTM),
    *(("SRC camera", SrcCamera(), *example) for example in examples.SRC_CAMERA),
]


@pytest.fixture(params=ARMS.values(), ids=ARMS.keys())
def arm(request: pytest.FixtureRequest) -> Chain:
    return request.param


@pytest.mark.parametrize(("name", "arm", "q", "rows", "xyzw"), EXAMPLES, ids=[f"{e[0]} {e[2]}" for e in EXAMPLES])
def test_forward_kinematics_gives_the_worked_example(name, arm, q, rows, xyzw):
    T = arm.forward(q)
    np.testing.assert_allclose(T, pose(rows), rtol=0, atol=WRITTEN_TO)
    np.testing.assert_allclose(T[:3, :3], quaternion_matrix(xyzw), rtol=0, atol=WRITTEN_TO)


@pytest.mark.parametrize(("count", "rows"), examples.SRC_PARTIAL, ids=[f"link {e[0]}" for e in examples.SRC_PARTIAL])
def test_frames_are_the_partial_products_of_the_worked_example(count, rows):
    frames = Psm(420006, "SRC").frames([0.2, -0.3, 0.12, 0.5, -0.4, 0.3])
    np.testing.assert_allclose(frames[count - 1], pose(rows), rtol=0, atol=WRITTEN_TO)


@pytest.mark.parametrize("convention", Convention)
def test_a_link_is_the_product_of_its_four_elementary_motions(convention):
    alpha, a, d, theta, q = 0.3, 0.2, -0.4, 0.5, 0.7
    about_x, about_z, along_x, along_z = np.eye(4), np.eye(4), np.eye(4), np.eye(4)
    about_x[1:3, 1:3] = [[np.cos(alpha), -np.sin(alpha)], [np.sin(alpha), np.cos(alpha)]]
    about_z[:2, :2] = [[np.cos(theta + q), -np.sin(theta + q)], [np.sin(theta + q), np.cos(theta + q)]]
    along_x[0, 3], along_z[2, 3] = a, d
    of_x, of_z = about_x @ along_x, about_z @ along_z
    expected = of_x @ of_z if convention is Convention.MODIFIED else of_z @ of_x
    chain = Chain(("turn",), (Link(alpha, a, d, theta),), convention, np.eye(4), [(-1, 1)])
    np.testing.assert_allclose(chain.forward([q]), expected, rtol=0, atol=1e-15)


def test_a_sliding_joint_moves_along_the_z_axis_of_its_link():
    chain = Chain(("slide",), (Link(d=0.1, prismatic=True),), Convention.MODIFIED, np.eye(4), [(0, 1)])
    assert chain.forward([0.25])[2, 3] == pytest.approx(0.35)


def test_right_angles_are_exact(arm):
    entries = np.abs(arm.frames(np.zeros(arm.n))[:-1, :3, :3])
    assert np.all((entries < 1e-15) | (np.abs(entries - 1.0) < 1e-15))


def test_many_joint_vectors_give_what_each_alone_gives(arm):
    q = np.random.default_rng(1).uniform(arm.lower, arm.upper, (3, 4, arm.n))
    for function in (arm.forward, arm.frames, arm.jacobian_body, arm.jacobian_spatial):
        many = function(q)
        assert many.shape[:2] == (3, 4)
        np.testing.assert_array_equal(many[2, 1], function(q[2, 1]))


def test_the_last_frame_is_the_tip(arm):
    q = 0.5 * (arm.lower + arm.upper) + 0.01
    assert arm.frames(q).shape == (arm.n + 1, 4, 4)
    np.testing.assert_allclose(arm.frames(q)[-1], arm.forward(q), rtol=0, atol=1e-15)


def test_jacobians_are_the_derivative_of_the_pose(arm):
    step = 1e-6
    for q in np.random.default_rng(2).uniform(arm.lower, arm.upper, (20, arm.n)):
        T = arm.forward(q)
        spatial, body = np.empty((6, arm.n)), np.empty((6, arm.n))
        for j, offset in enumerate(step * np.eye(arm.n)):
            rate = (arm.forward(q + offset) - arm.forward(q - offset)) / (2 * step)
            spatial[:, j] = _twist(rate @ np.linalg.inv(T))
            body[:, j] = _twist(np.linalg.inv(T) @ rate)
        np.testing.assert_allclose(arm.jacobian_spatial(q), spatial, rtol=0, atol=2e-9)
        np.testing.assert_allclose(arm.jacobian_body(q), body, rtol=0, atol=2e-9)


def _twist(matrix):
    return np.array([*matrix[:3, 3], matrix[2, 1], matrix[0, 2], matrix[1, 0]])


def test_a_joint_vector_of_the_wrong_length_is_refused_by_name(arm):
    with pytest.raises(ValueError, match=rf"expected {arm.n} joint values \({arm.joint_names[0]}, .*\), got \(9,\)"):
        arm.forward(np.zeros(9))


def test_limits_cannot_be_changed_by_accident(arm):
    with pytest.raises(ValueError, match="read-only"):
        arm.lower[0] = -10.0
    assert arm.lower.shape == arm.upper.shape == (arm.n,)
    assert np.all(arm.lower < arm.upper)


@pytest.mark.parametrize("absolute", [False, True])
def test_what_an_arm_reports_of_its_tip_is_what_each_function_gives(arm, absolute):
    rng = np.random.default_rng(arm.n)
    measured, setpoint, wrench = (
        rng.uniform(-0.5, 0.5, (3, arm.n)),
        rng.uniform(-0.5, 0.5, (3, arm.n)),
        rng.uniform(-1, 1, 6),
    )
    base = frame(quaternion_matrix([0.1, 0.7, -0.1, 0.7]), (0.1, 0.2, 0.3))
    js, poses, vectors, jacobians = np.zeros((2, 3, arm.n)), np.zeros((4, 7)), np.zeros((4, 6)), np.zeros((2, 6, arm.n))
    arm.describe(base, absolute, measured, setpoint, wrench, js, poses, vectors, jacobians)
    np.testing.assert_array_equal(js, [measured, setpoint])
    tips = arm.forward([measured[0], setpoint[0]])
    for pose_, T in zip(poses, [*(base @ tips), *tips], strict=True):
        np.testing.assert_allclose(pose_, matrix_pose7(T), atol=1e-12)
    np.testing.assert_allclose(
        jacobians, [arm.jacobian_body(measured[0]), arm.jacobian_spatial(measured[0])], atol=1e-12
    )
    R = tips[0, :3, :3]
    twist = turned(R, jacobians[0] @ measured[1])
    on_tip = wrench if absolute else turned(R.T, wrench)
    expected = [turned(base[:3, :3], twist), twist, on_tip, turned(base[:3, :3], wrench)]
    np.testing.assert_allclose(vectors, expected, atol=1e-12)
