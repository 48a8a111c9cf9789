"""What the training examples share: what a network makes of an observation, and how it is written as ONNX.

An observation (`ligature.environments.SuturingEnv`) has places in the world, and actions are steps along the axes of
the arm's base. What an expert does depends on where things are from the tool: a small network learns that from few
demonstrations when it sees them so.
"""

from __future__ import annotations

import logging
import warnings
from pathlib import Path

import numpy as np
import torch
from ligature.environments.layout import PLACE, TARGET, TURN
from torch import Tensor, nn

MILLIMETRE = 1e-3
STILL = 1e-4
"""Deviation of a feature below which it is taken as constant: scaling would magnify noise."""

FARTHEST = 5.0
"""Deviations from the mean beyond which a feature is cut: nothing was seen there."""

ALIGNED = 1e-4
"""Metres by which the tips in an arm's base, moved to the world, may miss those in the world."""


def base_pose(observations: np.ndarray) -> tuple[Tensor, Tensor]:
    """Rotation (3, 3) and position (3,) of the arm's base in the world, from observations (n, 52).

    They have the tip's place in both. The least squares of Kabsch (Acta Crystallographica A32, 1976). Raises
    ValueError where no one pose fits.
    """
    local, world = observations[:, 7:10].astype(float), observations[:, 27:30].astype(float)
    middle = local.mean(axis=0), world.mean(axis=0)
    U, spread, Vt = np.linalg.svd((world - middle[1]).T @ (local - middle[0]))
    R = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
    missed = np.abs((local - middle[0]) @ R.T + middle[1] - world).max()
    if missed > ALIGNED or spread[1] < len(local) * ALIGNED**2:
        raise ValueError(f"the tip does not tell where the arm's base is: places differ by {missed:.2g} m")
    return torch.tensor(R, dtype=torch.float32), torch.tensor(middle[1] - R @ middle[0], dtype=torch.float32)


def rotation(quaternion: Tensor) -> Tensor:
    """Rotations (n, 3, 3) of quaternions (n, 4), x y z w."""
    x, y, z, w = (quaternion / quaternion.norm(dim=1, keepdim=True)).unbind(1)
    rows = [
        1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w),
        2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
        2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y),
    ]  # fmt: skip
    return torch.stack(rows, dim=1).reshape(-1, 3, 3)


class ToolView(nn.Module):
    """Features (n, k) of observations (n, 52): places and turns as seen from the set-point of the tool.

    Places are given twice, in metres, and as an inverse hyperbolic sine of millimetres, which has the sign and resolves
    what is near as well as what is far.
    """

    R_base: Tensor
    p_base: Tensor

    def __init__(self, R_base: Tensor, p_base: Tensor) -> None:
        super().__init__()
        self.register_buffer("R_base", R_base)
        self.register_buffer("p_base", p_base)

    def in_base(self, places: Tensor) -> Tensor:
        """Places (n, 3) of the world in the arm's base."""
        return (places - self.p_base) @ self.R_base

    def forward(self, seen: Tensor) -> tuple[Tensor, Tensor]:
        """Features (n, k), and the rotation (n, 3, 3) of the tool in the base."""
        R, at = rotation(seen[:, 44:48]), seen[:, 41:44]
        needle, target = self.in_base(seen[:, PLACE]), self.in_base(seen[:, TARGET])
        R_needle = self.R_base.T @ rotation(seen[:, TURN])
        ways = torch.cat([from_tool(R, place - at) for place in (needle, target, seen[:, 7:10])], dim=1)
        twist = torch.cat([from_tool(R, seen[:, k : k + 3] @ self.R_base) for k in (21, 24)], dim=1)
        found = [
            ways, torch.asinh(ways / MILLIMETRE), needle, at,
            (R.transpose(1, 2) @ R_needle).flatten(1),  # how the needle is turned in the hand
            (R.transpose(1, 2) @ rotation(seen[:, 10:14])).flatten(1),  # how far the tool lags behind
            R_needle.flatten(1), R.flatten(1), seen[:, 6:7], twist, seen[:, 33:41], seen[:, 48:],
        ]  # fmt: skip
        return torch.cat(found, dim=1), R


def from_tool(R: Tensor, ways: Tensor) -> Tensor:
    """Vectors (n, 3) along the axes of the tool (n, 3, 3)."""
    return (R.transpose(1, 2) @ ways[:, :, None])[:, :, 0]


class Scale(nn.Module):
    """Features with mean 0 and deviation 1, as far as they vary."""

    mean: Tensor
    factor: Tensor

    def __init__(self, features: Tensor) -> None:
        super().__init__()
        deviation = features.std(dim=0)
        factor = torch.where(deviation > STILL, 1.0 / deviation.clip(min=STILL), torch.zeros_like(deviation))
        self.register_buffer("mean", features.mean(dim=0))
        self.register_buffer("factor", factor)

    def forward(self, features: Tensor) -> Tensor:
        """Features (n, k), scaled."""
        return ((features - self.mean) * self.factor).clip(-FARTHEST, FARTHEST)


def save(policy: nn.Module, path: Path, numbers: int) -> None:
    """Write a policy as ONNX, whose input is one observation (1, k)."""
    policy.eval()
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)  # it warns of packages that this does not use
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)  # of torch, about itself
        torch.onnx.export(
            policy, (torch.zeros(1, numbers),), path, input_names=["state"], output_names=["action"], dynamo=True,
            external_data=False, verbose=False,
        )  # fmt: skip
