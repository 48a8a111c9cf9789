"""Linkages as MuJoCo models, for ticks so short that they show the true motion."""

from __future__ import annotations

from collections.abc import Iterable

import mujoco
import numpy as np
from ligature.model.axes import axes_of
from ligature.model.frames import inverse, matrix_quaternion, pose7_matrix
from ligature.model.scene import JointType, Scene
from numpy.typing import NDArray

Array = NDArray[np.float64]


def _text(values: Iterable[float]) -> str:
    return " ".join(f"{float(value):.17g}" for value in values)


def model_of(scene: Scene, poses: Array, dt: float) -> mujoco.MjModel:
    """The linkage of ``scene`` with its bodies at ``poses`` (b, 7): trees of hinges and slides, loops of stiff points."""
    T = {b.index: pose7_matrix(poses[b.index]) @ b.T_body_inertial for b in scene.bodies}
    children: dict[int, list[tuple[int, int]]] = {}
    for tree in scene.articulations:
        for link in tree.links[1:]:
            assert link.joint is not None
            children.setdefault(tree.links[link.parent_link].body, []).append((link.body, link.joint))

    def axis_of(joint: int) -> tuple[Array, list[Array], list[bool]]:
        described = scene.joints[joint]
        frame = T[described.parent] @ described.T_parent_a
        axes = axes_of(described) or ()
        return frame[:3, 3], [frame[:3, :3] @ axis.direction for axis in axes], [axis.prismatic for axis in axes]

    def body(index: int, T_parent: Array, joint: int) -> str:
        described, local = scene.bodies[index], inverse(T_parent) @ T[index]
        x, y, z, w = matrix_quaternion(local[:3, :3])
        text = f'<body name="b{index}" pos="{_text(local[:3, 3])}" quat="{_text((w, x, y, z))}">'
        text += f'<inertial pos="0 0 0" mass="{described.mass}" diaginertia="{_text(described.inertia)}"/>'
        at, axes, slides = axis_of(joint)
        own = inverse(T[index])
        for axis, slide in zip(axes, slides, strict=True):
            kind = "slide" if slide else "hinge"
            pivot, direction = _text(own[:3, :3] @ at + own[:3, 3]), _text(own[:3, :3] @ axis)
            text += f'<joint type="{kind}" pos="{pivot}" axis="{direction}"/>'
        return text + "".join(body(c, T[index], j) for c, j in children.get(index, [])) + "</body>"

    roots = [tree.links[0].body for tree in scene.articulations]
    bodies = "".join(body(c, np.eye(4), j) for root in roots for c, j in children.get(root, []))
    points = ""
    for closure in scene.closures:
        joint = scene.joints[closure.joint]
        at, axes, _ = axis_of(closure.joint)
        one, other = sorted((joint.parent, joint.child), key=lambda b: scene.bodies[b].static)
        second = "" if scene.bodies[other].static else f'body2="b{other}"'
        own = inverse(T[one])
        for point in (at,) if joint.type is JointType.P2P else (at, at + 0.1 * axes[0]):
            anchor = _text(own[:3, :3] @ point + own[:3, 3])
            points += f'<connect body1="b{one}" {second} anchor="{anchor}"/>'
    gravity = next(b.gravity for b in scene.bodies if not b.static)
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler angle="radian"/><option timestep="{dt}" gravity="{_text(gravity)}" integrator="implicit" '
        f'iterations="200" tolerance="1e-14"/><default><equality solref="{4 * dt} 1" solimp="0.999 0.9999 0.001"/>'
        f"</default><worldbody>{bodies}</worldbody><equality>{points}</equality></mujoco>"
    )


def motion(scene: Scene, poses: Array, ticks: int, dt: float = 1e-5) -> Array:
    """Centres of mass (ticks, b, 3) after each millisecond, by ticks of ``dt``; those of static bodies are 0."""
    model = model_of(scene, poses, dt)
    data = mujoco.MjData(model)
    rows = {b.index: model.body(f"b{b.index}").id for b in scene.bodies if not b.static}
    centres = np.zeros((ticks, len(scene.bodies), 3))
    for k in range(ticks):
        mujoco.mj_step(model, data, round(1e-3 / dt))
        for index, row in rows.items():
            centres[k, index] = data.xipos[row]
    return centres
