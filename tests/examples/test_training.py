"""What the training examples make of observations does not depend on where the world's origin is; training repeats."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

pytest.importorskip("torch")
pytest.importorskip("onnxscript")

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
QUATERNIONS, WORLD_PLACES, WORLD_TURNS, WORLD_VECTORS = (10, 17, 44), (14, 27, 30), (17,), (21, 24)
"""Where an observation has quaternions, and what of the world."""


@pytest.fixture(scope="module", autouse=True)
def examples() -> Iterator[None]:
    sys.path.insert(0, str(EXAMPLES))
    yield
    sys.path.remove(str(EXAMPLES))


def observed(rng: np.random.Generator, n: int, R: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Observations (n, 52) of an arm whose base is at R (3, 3) and p (3,)."""
    found = rng.normal(size=(n, 52)) * 0.02
    for k in QUATERNIONS:
        found[:, k : k + 4] = Rotation.random(n, random_state=int(rng.integers(1 << 30))).as_quat()
    found[:, 27:30] = found[:, 7:10] @ R.T + p
    return found


def moved(seen: np.ndarray, R: np.ndarray, p: np.ndarray) -> np.ndarray:
    """The same moments in another world, whose axes are turned by R and whose origin is moved by p."""
    found = seen.copy()
    for k in WORLD_PLACES:
        found[:, k : k + 3] = seen[:, k : k + 3] @ R.T + p
    for k in WORLD_VECTORS:
        found[:, k : k + 3] = seen[:, k : k + 3] @ R.T
    for k in WORLD_TURNS:
        found[:, k : k + 4] = (Rotation.from_matrix(R) * Rotation.from_quat(seen[:, k : k + 4])).as_quat()
    return found


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_features_are_those_of_the_tool_wherever_the_world_begins(seed: int) -> None:
    import torch
    from networks import ToolView, base_pose

    rng = np.random.default_rng(seed)
    bases = Rotation.random(2, random_state=seed).as_matrix()
    seen = observed(rng, 40, bases[0], rng.normal(size=3) * 0.3)
    other = moved(seen, bases[1], rng.normal(size=3) * 0.3)
    for data in (seen, other):
        R, p = base_pose(data)
        np.testing.assert_allclose(data[:, 7:10] @ R.numpy().T + p.numpy(), data[:, 27:30], atol=1e-6)
    one, two = (ToolView(*base_pose(d))(torch.tensor(d, dtype=torch.float32)) for d in (seen, other))
    np.testing.assert_allclose(one[1], two[1], atol=1e-6)
    np.testing.assert_allclose(one[0], two[0], atol=2e-3)  # an inverse sine resolves the last digits of a place


def test_places_that_no_one_base_explains_are_refused() -> None:
    from networks import base_pose

    seen = observed(np.random.default_rng(1), 40, np.eye(3), np.zeros(3))
    seen[3, 27] += 0.001
    with pytest.raises(ValueError, match="the tip does not tell where the arm's base is"):
        base_pose(seen)
    with pytest.raises(ValueError, match="the tip does not tell"):
        base_pose(np.repeat(seen[:1], 40, axis=0))


def test_training_repeats_and_the_file_acts_as_the_network_does(tmp_path: Path) -> None:
    import onnxruntime
    import torch
    from networks import save
    from train_bc import train

    rng = np.random.default_rng(2)
    seen = observed(rng, 300, np.eye(3), np.zeros(3)).astype(np.float32)
    wanted = np.clip(50.0 * rng.normal(size=(52, 7)).T @ seen.T, -1.0, 1.0).T.astype(np.float32)
    policies: list[Any] = [train(seen, wanted, 2, seed) for seed in (0, 0, 1)]
    for k, policy in enumerate(policies):
        save(policy, tmp_path / f"{k}.onnx", 52)
    files = [(tmp_path / f"{k}.onnx").read_bytes() for k in range(3)]
    assert files[0] == files[1] != files[2]
    session = onnxruntime.InferenceSession(files[0])
    for one in seen[:50]:
        with torch.no_grad():
            expected = policies[0](torch.from_numpy(one[None])).numpy()
        found = session.run(None, {"state": one[None]})[0]
        np.testing.assert_allclose(found, expected, atol=1e-5)
        assert np.abs(found).max() <= 1.0
