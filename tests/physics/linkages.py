"""Random linkages as model files: four-bars, parallelograms and spatial ones, rounded as files are.

Bodies stand anywhere, at joint positions other than zero; pivots and locations are rounded to 1 mm, axes and angles to
three digits.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from ligature.model.frames import frame, inverse, joint_frames, matrix_rpy, rpy_matrix
from numpy.typing import NDArray

Array = NDArray[np.float64]

CLOSING = ("revolute", "p2p", "torsion spring", "cone twist", "six dof", "six dof spring")
KINDS = ("four-bar", "parallelogram", "double parallelogram", "spatial", "slider")

_MORE = {
    "revolute": "",
    "p2p": "",
    "torsion spring": "joint limits: {low: -3, high: 3}, stiffness: 0.01, damping: 0.001, ",
    "cone twist": "joint limits: {x: 3, y: 3, z: 3}, ",
    "six dof": "joint limits: {linear: {low: {x: 0, y: 0, z: 0}, high: {x: 0, y: 0, z: 0}}, "
    "angular: {low: {x: 0, y: 0, z: 1}, high: {x: 0, y: 0, z: -1}}}, ",
    "six dof spring": "joint limits: {linear: {low: {x: 0, y: 0, z: 0}, high: {x: 0, y: 0, z: 0}}, "
    "angular: {low: {x: 0, y: 0, z: 1}, high: {x: 0, y: 0, z: -1}}}, "
    "stiffness: {linear: {x: 0, y: 0, z: 0}, angular: {x: 0, y: 0, z: 0.01}}, ",
    "prismatic": "",
}


@dataclass
class _Bar:
    name: str
    mass: float
    T: Array
    size: float


def _vector(v: Array, digits: int = 3) -> str:
    x, y, z = (round(float(c), digits) + 0.0 for c in v)
    return f"{{x: {x:.{digits}f}, y: {y:.{digits}f}, z: {z:.{digits}f}}}"


def _placed(rng: np.random.Generator, name: str, mass: float, ends: Array) -> _Bar:
    """A bar whose body frame stands at random near the middle of its ``ends`` (k, 3), rounded as files are."""
    size = float(np.ptp(ends, axis=0).max())
    at = np.round(ends.mean(axis=0) + rng.uniform(-0.2, 0.2, 3) * size, 3)
    return _Bar(name, mass, frame(rpy_matrix(*np.round(rng.uniform(-1.5, 1.5, 3), 3)), at), max(size, 0.01))


def _joint(
    rng: np.random.Generator, key: str, kind: str, parent: _Bar, child: _Bar, pivot: Array, axis: Array, start: float
) -> str:
    """A joint that holds the bars at ``pivot`` about ``axis`` in the world, at the position ``start``."""
    pivots = [np.round(inverse(bar.T)[:3, :3] @ pivot + inverse(bar.T)[:3, 3], 3) for bar in (parent, child)]
    axes = [np.round(bar.T[:3, :3].T @ axis, 3) for bar in (parent, child)]
    slides = kind == "prismatic"
    frames = joint_frames(np.eye(4), np.eye(4), *pivots, *axes, prismatic=slides)
    D = inverse(parent.T @ frames.T_parent_a) @ child.T @ frames.T_child_b
    about = D[:3, :3] if not slides else np.roll(np.roll(D[:3, :3], -1, 0), -1, 1)
    offset = round(float(np.arctan2(about[1, 0], about[0, 0])) - (0.0 if slides else start), 3)
    if slides:
        pivots[0] = np.round(pivots[0] - start * axes[0], 3)
    return (
        f"{key}: {{name: {key}, parent: {parent.name}, child: {child.name}, type: {kind}, offset: {offset}, "
        f"parent pivot: {_vector(pivots[0])}, child pivot: {_vector(pivots[1])}, "
        f"{_MORE[kind]}parent axis: {_vector(axes[0])}, child axis: {_vector(axes[1])}}}\n"
    )


def linkage(rng: np.random.Generator, kind: str, closing: str = "revolute", gravity: float = 9.8) -> str:
    """A model file of a random linkage of ``kind``, whose last joint is of the type ``closing``."""
    scale = 10.0 ** rng.uniform(-1.0, 0.0)
    R = rpy_matrix(*rng.uniform(-3.0, 3.0, 3))
    origin = rng.uniform(-0.5, 0.5, 3)

    def world(*points: tuple[float, float, float]) -> Array:
        return origin + scale * np.array(points) @ R.T

    normal = R[:, 2]
    lift = float(rng.uniform(0.5, 1.2))
    lean, top = rng.uniform(-0.4, 0.4), rng.uniform(0.7, 1.3)
    A, B, C, D = (0.0, 0.0, 0.0), (lean, lift, 0.0), (lean + top, lift * rng.uniform(0.7, 1.3), 0.0), (1.0, 0.0, 0.0)
    if "parallelogram" in kind:
        C = (lean + 1.0, lift, 0.0)
    masses = 10.0 ** rng.uniform(-3.0, 1.0, 4)
    base = _Bar("Base", 0.0, np.eye(4), 1.0)
    starts = rng.uniform(-1.0, 1.0, 6)
    if kind == "spatial":
        p = world(A, B, (*C[:2], 0.4), D)
        tilted = R @ np.array([0.5, 0.2, 0.84])
        bars = [_placed(rng, n, m, e) for n, m, e in zip("LMN", masses, (p[:2], p[1:3], p[2:]), strict=False)]
        left, middle, right = bars
        joints = [
            _joint(rng, "J1", "revolute", base, left, p[0], normal, starts[0]),
            _joint(rng, "J2", "revolute", base, right, p[3], tilted / np.linalg.norm(tilted), starts[1]),
            _joint(rng, "J3", "cone twist", left, middle, p[1], normal, 0.0),
            _joint(rng, "J4", "p2p", middle, right, p[2], normal, 0.0),
        ]
        return _file([base, *bars], joints, gravity)
    p = world(A, B, C, D)
    if kind == "slider":
        bars = [_placed(rng, n, m, e) for n, m, e in zip("LM", masses, (p[:2], p[1:3]), strict=False)]
        block = _placed(rng, "N", masses[2], p[2:3] + [[0, 0, 0], [0.1, 0.1, 0.1]])
        left, middle = bars
        along = R[:, 0]
        joints = [
            _joint(rng, "J1", "revolute", base, left, p[0], normal, starts[0]),
            _joint(rng, "J2", "revolute", left, middle, p[1], normal, starts[1]),
            _joint(rng, "J3", "prismatic", base, block, p[2], along, float(starts[2]) * 0.1),
            _joint(rng, "J4", closing, middle, block, p[2], normal, 0.0),
        ]
        return _file([base, left, middle, block], joints, gravity)
    bars = [_placed(rng, n, m, e) for n, m, e in zip("LMN", masses, (p[:2], p[1:3], p[2:]), strict=False)]
    left, middle, right = bars
    joints = [
        _joint(rng, "J1", "revolute", base, left, p[0], normal, starts[0]),
        _joint(rng, "J2", "revolute", left, middle, p[1], normal, starts[1]),
        _joint(rng, "J3", "revolute", right, middle, p[2], normal, starts[2]),
        _joint(rng, "J4", closing, base, right, p[3], normal, 0.0),
    ]
    if kind == "double parallelogram":
        share = float(rng.uniform(0.3, 0.7))
        q = np.array([p[0] + share * (p[1] - p[0]), p[3] + share * (p[2] - p[3])])
        bar = _placed(rng, "O", masses[3], q)
        bars.append(bar)
        joints += [
            _joint(rng, "J5", "revolute", left, bar, q[0], normal, starts[3]),
            _joint(rng, "J6", "revolute", right, bar, q[1], normal, starts[4]),
        ]
    return _file([base, *bars], joints, gravity)


def doubled(rng: np.random.Generator, text: str) -> str:
    """The linkage ``text`` with one of its joints twice: the second holds the same, or by 10 µm to 5 mm something else."""
    joints = [line for line in text.splitlines() if re.match(r"J\d: ", line)]
    first = joints[-1] if rng.random() < 0.5 else joints[rng.integers(len(joints))]
    key = first.split(":")[0]
    second = first.replace(f"{key}: {{name: {key},", "J9: {name: J9,")
    if rng.random() < 0.5:
        second = re.sub(r"type: [a-z ]+,", f"type: {rng.choice(('revolute', 'p2p'))},", second)
    size = rng.choice((0.0, 1e-5, 1e-4, 1e-3, 5e-3))
    for vector in ("parent pivot", "parent axis"):
        found = re.search(vector + r": \{x: ([^,]+), y: ([^,]+), z: ([^}]+)\}", second)
        assert found is not None
        moved = np.array(found.groups(), dtype=float) + rng.normal(0.0, size, 3)
        second = second.replace(found.group(), f"{vector}: {_vector(moved, 6)}")
    return re.sub(r"^(joints: \[.*)\]$", r"\1, J9]", text, flags=re.MULTILINE) + second + "\n"


def _file(bars: list[_Bar], joints: list[str], gravity: float) -> str:
    text = f"bodies: [{', '.join(bar.name for bar in bars)}]\njoints: [{', '.join(j.split(':')[0] for j in joints)}]\n"
    text += f"gravity: {{x: 0, y: 0, z: {-gravity}}}\n"
    for bar in bars:
        roll, pitch, yaw = matrix_rpy(bar.T[:3, :3])
        inertia = bar.mass * bar.size**2 / 12.0
        text += (
            f"{bar.name}: {{name: {bar.name}, mass: {bar.mass:.6f}, inertial offset: {{}}, "
            f"inertia: {{ix: {inertia:.3e}, iy: {inertia:.3e}, iz: {inertia:.3e}}}, location: {{"
            f"position: {_vector(bar.T[:3, 3])}, orientation: {{r: {roll:.3f}, p: {pitch:.3f}, y: {yaw:.3f}}}}}}}\n"
        )
    return text + "".join(joints)
