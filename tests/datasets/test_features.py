"""Columns of an export: poses whose numbers move as little as the bodies do."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from ligature.datasets.lerobot.features import one_sign
from scipy.spatial.transform import Rotation


@given(st.integers(0, 2**32 - 1), st.integers(1, 60), st.booleans())
def test_quaternions_do_not_leap_and_mean_the_same_turns(seed: int, n: int, beside: bool) -> None:
    rng = np.random.default_rng(seed)
    turns = Rotation.random(random_state=rng.integers(2**31)) * Rotation.identity(n)
    for k in range(1, n):
        step = rng.normal(size=3)
        turns[k] = turns[k - 1] * Rotation.from_rotvec(0.3 * step / np.linalg.norm(step))
    flipped = turns.as_quat() * rng.choice([-1.0, 1.0], n)[:, None]
    poses = np.hstack([rng.normal(size=(n, 3)), flipped])
    near = poses[rng.integers(n)] if beside else None
    found = one_sign(poses, near)
    assert np.array_equal(found[:, :3], poses[:, :3])
    assert np.array_equal(np.abs(found), np.abs(poses))
    assert Rotation.from_quat(found[:, 3:]).approx_equal(turns, 1e-9).all()
    if n > 1:
        assert np.linalg.norm(np.diff(found[:, 3:], axis=0), axis=1).max() < 0.16  # half of 0.3 rad
    first = found[0, 3:] @ near[3:] if near is not None else found[0, 3:][np.argmax(np.abs(found[0, 3:]))]
    assert first >= 0.0
    assert np.array_equal(poses[:, 3:], flipped), "what was given stays"
