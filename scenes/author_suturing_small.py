"""Authors the scene `suturing_small`: two PSM-like arms, a block, a needle and a thread, of primitive shapes.

Run ``python scenes/author_suturing_small.py`` to write the ADF files again; the results are committed
and a test compares. Lengths in metres. The arms follow the modified DH table of the PSM
(`ligature.robots.psm`, instrument 420006); every body frame is the DH frame of its joint, except the tool
yaw link, whose frame is T_7 · RPY(-pi/2, 0, -pi/2) as clients of the suturing challenge expect.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import yaml
from ligature.model.frames import minimal_rotation, pose_matrix

HERE = Path(__file__).resolve().parent / "suturing_small"
HALF_PI = np.pi / 2

TOOL_ID = 420006
TOOLS = {420006: (-0.4318, 0.4826), 400006: (-0.4389, 0.416)}
"""Insertion offset and length of the shaft with each large needle driver."""

PITCH_TO_YAW = 0.009
BASE_POSES = {
    "psm1": ((0.1313066, 0.3967149, 0.8777097), (0.69743, -0.51874, -3.13917)),
    "psm2": ((-0.0713554, 0.396989, 0.876246), (0.714168, 0.508757, -3.08779)),
}

NEEDLE_RADIUS, NEEDLE_THICKNESS = 0.0097, 0.0004
NEEDLE_START, NEEDLE_END, NEEDLE_SEGMENTS = np.radians(175.0), np.radians(45.0), 9
STEEL_DENSITY = 7800.0

THREAD_ELEMENTS, THREAD_LENGTH, THREAD_RADIUS = 40, 0.10, 0.0002
THREAD_DENSITY, THREAD_MODULUS = 1200.0, 2.0e9 * 0.02
"""Braided silk bends far more easily than a solid filament: 2 GPa scaled by the braid's 2 %."""

Matrix = np.ndarray


def number(value: float) -> float:
    """``value`` to a tenth of a nanometre, without a negative zero."""
    return float(round(float(value), 10)) + 0.0


def vector(values: Any) -> dict[str, float]:
    """An ADF vector block."""
    return dict(zip("xyz", (number(v) for v in values), strict=True))


def pose(T: Matrix) -> dict[str, Any]:
    """An ADF pose block of the homogeneous matrix ``T`` (4, 4)."""
    R = T[:3, :3]
    rpy = (np.arctan2(R[2, 1], R[2, 2]), np.arcsin(np.clip(-R[2, 0], -1, 1)), np.arctan2(R[1, 0], R[0, 0]))
    return {
        "position": vector(T[:3, 3]),
        "orientation": dict(zip("rpy", (number(v) for v in rpy), strict=True)),
    }


def dh(alpha: float, a: float, d: float, theta: float) -> Matrix:
    """Modified DH transform RotX(alpha) TransX(a) RotZ(theta) TransZ(d)."""
    return pose_matrix((a, 0, 0), (alpha, 0, 0)) @ pose_matrix((0, 0, d), (0, 0, theta))


def joint(
    name: str, kind: str, parent: str, child: str, T_parent_axis: Matrix, T_child_axis: Matrix, **keys: Any
) -> dict[str, Any]:
    """An ADF joint turning about (or sliding along) the common Z axis of two frames.

    ``T_parent_axis`` and ``T_child_axis`` are one and the same frame at joint position zero, seen
    from the parent and from the child body.
    """
    axis_parent, axis_child = T_parent_axis[:3, 2], T_child_axis[:3, 2]
    wanted = T_parent_axis[:3, :3] @ T_child_axis[:3, :3].T
    twist = wanted @ minimal_rotation(axis_child, axis_parent).T
    sine = np.array([twist[2, 1] - twist[1, 2], twist[0, 2] - twist[2, 0], twist[1, 0] - twist[0, 1]]) / 2
    return {
        "name": name,
        "type": kind,
        "parent": parent,
        "child": child,
        "parent axis": vector(axis_parent),
        "parent pivot": vector(T_parent_axis[:3, 3]),
        "child axis": vector(axis_child),
        "child pivot": vector(T_child_axis[:3, 3]),
        "offset": number(np.arctan2(sine @ axis_parent, (np.trace(twist) - 1) / 2)),
        **keys,
    }


def shape(
    kind: str, at: tuple[float, float, float], rpy: tuple[float, ...] = (0, 0, 0), **geometry: Any
) -> dict[str, Any]:
    """One element of a compound shape, placed in the body frame."""
    return {"shape": kind, "geometry": geometry, "offset": pose(pose_matrix(at, rpy))}


def colour(r: float, g: float, b: float, specular: float = 0.3, shininess: int | None = None) -> dict[str, Any]:
    """An ADF colour block; a grey with a strong and sharp highlight is drawn as bare metal."""
    return {
        "ambient": {"level": 0.5},
        "diffuse": {"r": r, "g": g, "b": b},
        "specular": {"r": specular, "g": specular, "b": specular},
        **({} if shininess is None else {"shininess": shininess}),
        "transparency": 1.0,
    }


def body(name: str, T_world_body: Matrix, mass: float, shapes: list[dict[str, Any]], **keys: Any) -> dict[str, Any]:
    """An ADF body whose looks and collisions are the same primitive shapes."""
    block: dict[str, Any] = {
        "name": name,
        "mass": mass,
        "location": pose(T_world_body),
        "inertial offset": pose(np.eye(4)),
        "collision margin": 0.0001,
        "friction": {"static": 0.5, "rolling": 0.0},
        "restitution": 0.0,
        "damping": {"linear": 0.04, "angular": 0.1},
        "publish children names": False,
        "publish joint names": False,
        "publish joint positions": False,
        "passive": False,
    }
    if shapes:
        block["compound shape"] = shapes
        block["compound collision shape"] = shapes
    else:
        block["mesh"] = ""
    block.update(keys)
    return block


def slit(size: tuple[float, float, float], top: float) -> dict[str, Any]:
    """A wound of width, length and depth ``size``, across the middle of a side of tissue at the height ``top``."""
    width, length, depth = size
    return {
        "from": vector((-width / 2, -length / 2, top - depth)),
        "to": vector((width / 2, length / 2, top)),
    }


def looks(block: dict[str, Any], mesh: str) -> None:
    """Draw a body as a mesh of `author_instruments`; without shapes to collide with it touches nothing."""
    block.pop("compound shape", None)
    block["mesh"] = mesh
    if "compound collision shape" not in block:
        block["collision mesh"] = ""


def psm(name: str, tool: int = TOOL_ID) -> dict[str, Any]:
    """One arm: base, six joints of the instrument, two jaws and the body that names the tool.

    With a tool that is shorter below the remote centre, the arm stands nearer by as much.
    """
    insertion_offset, shaft_length = TOOLS[tool]
    nearer = sum(TOOLS[TOOL_ID]) - (insertion_offset + shaft_length)
    T_world_base = pose_matrix(*BASE_POSES[name]) @ pose_matrix((0, 0, -nearer), (0, 0, 0))
    table = [
        ("yaw link", dh(HALF_PI, 0, 0, HALF_PI)),
        ("pitch end link", dh(-HALF_PI, 0, 0, -HALF_PI)),
        ("main insertion link", dh(HALF_PI, 0, insertion_offset, 0)),
        ("tool roll link", dh(0, 0, shaft_length, 0)),
        ("tool pitch link", dh(-HALF_PI, 0, 0, -HALF_PI)),
        ("tool yaw link", dh(-HALF_PI, PITCH_TO_YAW, 0, -HALF_PI)),
    ]
    T_6_yaw = dh(-HALF_PI, 0, 0, HALF_PI) @ pose_matrix((0, 0, 0), (-HALF_PI, 0, -HALF_PI))
    shapes = {
        "yaw link": ([], 2.0, "psm_yaw"),
        "pitch end link": ([], 2.0, "psm_pitch"),
        "main insertion link": ([shape("BOX", (0, 0, -0.03), x=0.06, y=0.05, z=0.05)], 1.0, "psm_insertion"),
        "tool roll link": (
            [shape("CYLINDER", (0, 0, -0.2), axis="Z", radius=0.00425, height=0.4)],
            0.3,
            "psm_shaft",
        ),
        "tool pitch link": (
            [shape("CAPSULE", (0.0045, 0, 0), axis="X", radius=0.0032, height=0.0154)],
            0.1,
            "psm_wrist",
        ),
        "tool yaw link": ([shape("CYLINDER", (0, 0, 0), axis="Z", radius=0.0024, height=0.0036)], 0.1, "psm_hub"),
    }
    touching_nothing = {"ix": 0.02, "iy": 0.02, "iz": 0.02}
    groups = {
        "base link": [0], "yaw link": [1], "pitch end link": [2], "main insertion link": [3],
        "tool roll link": [4], "tool pitch link": [5], "tool yaw link": [6],
    }  # fmt: skip
    published = ("base link", "tool pitch link", "tool yaw link")
    bodies: dict[str, Any] = {}
    joints: dict[str, Any] = {}

    def add_body(link: str, T: Matrix, links: list[dict[str, Any]], mass: float, mesh: str) -> None:
        block = body(link, T, mass, links, **{"collision groups": groups[link], "passive": link not in published})
        if mass and not links:
            block["inertia"] = touching_nothing
        looks(block, f"{mesh}.obj")
        bodies[f"BODY {link}"] = block

    add_body("base link", T_world_base, [], 0.0, "psm_base")
    kinds = ["revolute", "revolute", "prismatic", "revolute", "revolute", "revolute"]
    names = [
        "base link-yaw link", "yaw link-pitch end link", "pitch end link-main insertion link",
        "main insertion link-tool roll link", "tool roll link-tool pitch link", "tool pitch link-tool yaw link",
    ]  # fmt: skip
    limits = [(-1.605, 1.5991), (-0.93, 0.93), (0.0, 0.24), None, (-1.5708, 1.5708), (-1.39626, 1.39626)]
    wrist = {"P": 30, "I": 0, "D": 0.4}
    T_world_parent, T_parent_body = T_world_base, np.eye(4)
    parent = "base link"
    for index, (link, T_link) in enumerate(table):
        T_world_link = T_world_parent @ T_link
        T_link_body = T_6_yaw if link == "tool yaw link" else np.eye(4)
        links, mass, mesh = shapes[link]
        add_body(link, T_world_link @ T_link_body, links, mass, mesh)
        keys: dict[str, Any] = {
            "controller output type": "VELOCITY",
            "enable feedback": True,
            "passive": False,
        }
        if limits[index] is not None:
            keys["joint limits"] = {"low": limits[index][0], "high": limits[index][1]}
        if index == 5:
            keys["controller"] = wrist
        joints[f"JOINT {names[index]}"] = joint(
            names[index], kinds[index], f"BODY {parent}", f"BODY {link}",
            np.linalg.inv(T_parent_body) @ T_link, np.linalg.inv(T_link_body), **keys,
        )  # fmt: skip
        T_world_parent, T_parent_body, parent = T_world_link, T_link_body, link

    T_world_yaw = T_world_parent @ T_parent_body
    for number_, (side, roll_pitch_yaw, axis_rpy) in enumerate(
        [("left", (np.pi, 0, 0), (np.pi, 0, 0)), ("right", (0, 0, np.pi), (0, 0, 0))]
    ):
        link = f"tool gripper {side} link"
        T_yaw_jaw = pose_matrix((0, 0, 0), roll_pitch_yaw)
        T_yaw_axis = pose_matrix((0, 0, 0), axis_rpy)
        jaw = [
            shape("CYLINDER", (0, 0, 0), axis="Z", radius=0.0022, height=0.0032),
            shape("BOX", (-0.0006, 0.0052, 0), x=0.0011, y=0.0088, z=0.0025),
        ]
        groups[link] = [10 + number_]
        add_body(link, T_world_yaw @ T_yaw_jaw, jaw, 0.05, "psm_jaw")
        title = f"tool yaw link-{link}"
        joints[f"JOINT {title}"] = joint(
            title, "revolute", "BODY tool yaw link", f"BODY {link}", T_yaw_axis,
            np.linalg.inv(T_yaw_jaw) @ T_yaw_axis,
            **{
                "joint limits": {"low": 0.0, "high": 1.5708},
                "controller": wrist,
                "controller output type": "VELOCITY",
                "enable feedback": True,
                "passive": False,
            },
        )  # fmt: skip
    bodies["BODY tool id"] = {
        "name": f"tool_id_{tool}",
        "mesh": "",
        "mass": 0.0,
        "location": pose(T_world_yaw),
        "passive": False,
    }
    return {
        "bodies": list(bodies),
        "joints": list(joints),
        "high resolution path": "high_res/",
        "ignore inter-collision": False,
        "gravity": vector((0, 0, 0)),
        "namespace": f"/ambf/env/{name}/",
        **bodies,
        **joints,
    }


def ghosts_and_actuator(name: str) -> dict[str, Any]:
    """Finger ghosts and the grasp actuator of one arm."""
    volume = {"x": 0.0004, "y": 0.0052, "z": 0.0016}
    document: dict[str, Any] = {
        "ghost objects": ["GHOST right finger", "GHOST left finger"],
        "actuators": ["ACTUATOR Actuator0"],
        "namespace": f"/ambf/env/ghosts/{name}/",
    }
    for side in ("right", "left"):
        document[f"GHOST {side} finger"] = {
            "name": f"{side}_finger_ghost",
            "parent": f"{name}/BODY tool gripper {side} link",
            "location": pose(pose_matrix((0, 0.0066, 0), (0, 0, 0))),
            "collision shape": "BOX",
            "collision geometry": volume,
            "collision margin": 0.0001,
            "collision groups": [],
            "visible": False,
            "passive": False,
        }
    document["ACTUATOR Actuator0"] = {
        "name": "Actuator0",
        "type": "Constraint",
        "parent": f"{name}/BODY tool yaw link",
        "location": pose(pose_matrix((0, -0.01, 0), (0, 0, 0))),
    }
    return document


def arc_shapes() -> tuple[list[dict[str, Any]], np.ndarray, float]:
    """Capsules along the needle's arc, its centre of mass (3,) and its mass."""
    angles = np.linspace(NEEDLE_START, NEEDLE_END, NEEDLE_SEGMENTS + 1)
    points = NEEDLE_RADIUS * np.column_stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)])
    shapes, centres, lengths = [], [], []
    for start, end in zip(points[:-1], points[1:], strict=True):
        middle, along = (start + end) / 2, end - start
        length = float(np.linalg.norm(along))
        yaw = float(np.arctan2(along[1], along[0]))
        shapes.append(
            shape("CAPSULE", tuple(middle), (0, 0, yaw), axis="X", radius=NEEDLE_THICKNESS,
                  height=number(length + 2 * NEEDLE_THICKNESS))
        )  # fmt: skip
        centres.append(middle)
        lengths.append(length)
    mass = STEEL_DENSITY * np.pi * NEEDLE_THICKNESS**2 * sum(lengths)
    return shapes, np.average(centres, axis=0, weights=lengths), mass


def needle_tail() -> np.ndarray:
    """Pose (4, 4) of the start of its thread in the needle's frame."""
    tail = NEEDLE_RADIUS * np.array([np.cos(NEEDLE_START), np.sin(NEEDLE_START), 0.0])
    return pose_matrix(tuple(tail), (HALF_PI, 0, NEEDLE_START - np.pi))


def needle(T_world_needle: np.ndarray) -> dict[str, Any]:
    """The needle, there."""
    shapes, centre, mass = arc_shapes()
    block = body(
        "Needle", T_world_needle, number(mass), shapes,
        **{
            "inertial offset": pose(pose_matrix(tuple(centre), (0, 0, 0))),
            "damping": {"linear": 0.1, "angular": 0.1},
        },
    )  # fmt: skip
    looks(block, "needle.obj")
    return block


def phantom(elements: int | None = None) -> dict[str, Any]:
    """The block, the needle, a thread of ``elements`` (`THREAD_ELEMENTS`), and the frame that carries the cameras."""
    top = 0.715
    T_world_block = pose_matrix((0.03, 0.18, top - 0.015), (0, 0, 0))
    block_shape = [shape("BOX", (0, 0, 0), x=0.1, y=0.2, z=0.03)]
    bodies: dict[str, Any] = {"BODY Block": body("Block", T_world_block, 0.0, block_shape)}
    T_world_camera = pose_matrix((0.0307, 0.25102, 0.81025), (0.69813, 0, -3.14158))
    bodies["BODY CameraFrame"] = body("CameraFrame", T_world_camera, 0.0, [])

    looks(bodies["BODY Block"], "block.obj")  # of author_looks.py, as the needle's
    T_world_needle = pose_matrix((0.005, 0.2, top + NEEDLE_THICKNESS + 0.0002), (0, 0, 0))
    bodies["BODY Needle"] = needle(T_world_needle)

    length = THREAD_LENGTH / THREAD_ELEMENTS
    area = np.pi * THREAD_RADIUS**2
    bending = THREAD_MODULUS * np.pi * THREAD_RADIUS**4 / 4 / length
    T_needle_tail = needle_tail()
    joints: dict[str, Any] = {}
    names = ["Thread"] + [f"Thread_{i:03d}" for i in range(1, elements or THREAD_ELEMENTS)]
    mass_element = THREAD_DENSITY * area * length
    for i, name in enumerate(names):
        at = T_world_needle @ T_needle_tail @ pose_matrix((0, 0, (i + 0.5) * length), (0, 0, 0))
        bodies[f"BODY {name}"] = body(
            name, at, float(f"{mass_element:.6g}"),
            [shape("CAPSULE", (0, 0, 0), axis="Z", radius=THREAD_RADIUS, height=number(length))],
            **{
                "inertia": {
                    "ix": float(f"{mass_element * length**2 / 12:.6g}"),
                    "iy": float(f"{mass_element * length**2 / 12:.6g}"),
                    "iz": float(f"{mass_element * THREAD_RADIUS**2 / 2:.6g}"),
                },
                "passive": True,
                "color components": colour(0.1, 0.1, 0.35),
            },
        )  # fmt: skip
    free, locked = vector((0.6, 0.6, 0.6)), vector((0, 0, 0))
    stiffness = {axis: float(f"{bending:.6g}") for axis in "xyz"}
    spring = {
        "joint limits": {
            "linear": {"low": locked, "high": locked},
            "angular": {"low": vector((-0.6, -0.6, -0.6)), "high": free},
        },
        "stiffness": {"linear": locked, "angular": stiffness},
        "damping": {"linear": locked, "angular": {axis: float(f"{bending * 0.002:.6g}") for axis in "xyz"}},
        "equilibrium point": {"linear": locked, "angular": locked},
        "passive": True,
    }
    joints["JOINT Needle-Thread"] = joint(
        "Needle-Thread", "fixed", "BODY Needle", "BODY Thread", T_needle_tail,
        pose_matrix((0, 0, -length / 2), (0, 0, 0)), passive=True,
    )  # fmt: skip
    for before, after in zip(names[:-1], names[1:], strict=True):
        joints[f"JOINT {before}-{after}"] = joint(
            f"{before}-{after}", "six dof spring", f"BODY {before}", f"BODY {after}",
            pose_matrix((0, 0, length / 2), (0, 0, 0)), pose_matrix((0, 0, -length / 2), (0, 0, 0)), **spring,
        )  # fmt: skip
    return {
        "bodies": list(bodies),
        "joints": list(joints),
        "high resolution path": "high_res/",
        "ignore inter-collision": False,
        "namespace": "/ambf/env/phantom/",
        **bodies,
        **joints,
    }


def environment() -> dict[str, Any]:
    """A table below everything."""
    table = body(
        "Table", pose_matrix((0, 0.2, 0.6), (0, 0, 0)), 0.0,
        [shape("BOX", (0, 0, 0), x=1.2, y=1.0, z=0.05)],
        **{"color components": colour(0.35, 0.45, 0.42)},
    )  # fmt: skip
    return {"bodies": ["BODY Table"], "joints": [], "namespace": "/ambf/env/", "BODY Table": table}


def world() -> dict[str, Any]:
    """World with a stereo endoscope and one light on the camera frame."""
    document: dict[str, Any] = {
        "environment": "environment.yaml",
        "namespace": "/ambf/env/",
        "gravity": vector((0, 0, -9.81)),
        "max iterations": 50,
        "lights": ["light2"],
        "cameras": ["cameraL", "cameraR"],
        "light2": {
            "namespace": "lights/", "name": "light2", "parent": "BODY CameraFrame",
            "location": vector((0, 0, 0)), "direction": vector((0, 0, -1)),
            "spot exponent": 0.9, "cutoff angle": 1.5, "shadow quality": 3,
        },
    }  # fmt: skip
    for side, x in (("L", -0.002), ("R", 0.002)):
        document[f"camera{side}"] = {
            "namespace": "cameras/", "name": f"camera{side}", "parent": "BODY CameraFrame",
            "location": vector((x, 0, -0.05)), "look at": vector((x, 0, -1)), "up": vector((0, 1, 0)),
            "clipping plane": {"near": 0.001, "far": 10.0}, "field view angle": 1.2,
            "publish image": True, "publish image interval": 4,
            "publish image resolution": {"width": 640, "height": 480},
        }  # fmt: skip
    return document


def documents() -> dict[str, dict[str, Any]]:
    """Every file of the scene by name, as plain values."""
    return {
        "launch.yaml": {
            "world config": "world.yaml",
            "color config": "colors.yaml",
            "input devices config": "input_devices.yaml",
            "multibody configs": [
                "phantom.yaml", "psm1.yaml", "ghosts_actuators_psm1.yaml", "psm2.yaml", "ghosts_actuators_psm2.yaml",
            ],
        },
        "world.yaml": world(),
        "environment.yaml": environment(),
        "colors.yaml": {"white": {"r": 255, "g": 255, "b": 255, "a": 255}},
        "input_devices.yaml": {"input devices": []},
        "phantom.yaml": phantom(),
        "psm1.yaml": psm("psm1"),
        "psm2.yaml": psm("psm2"),
        "psm1_400006.yaml": psm("psm1", 400006),
        "psm2_400006.yaml": psm("psm2", 400006),
        "ghosts_actuators_psm1.yaml": ghosts_and_actuator("psm1"),
        "ghosts_actuators_psm2.yaml": ghosts_and_actuator("psm2"),
    }  # fmt: skip


class Dumper(yaml.SafeDumper):
    """Writes repeated values in full instead of as anchors."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def text(document: dict[str, Any], script: str = "author_suturing_small.py") -> str:
    """The YAML text of one file, which names the script that wrote it."""
    header = f"# Written by scenes/{script}\n"
    return header + yaml.dump(document, Dumper=Dumper, sort_keys=False, default_flow_style=None, width=110)


def texts() -> dict[str, str]:
    """Text of every file of the scene by name."""
    return {name: text(document) for name, document in documents().items()}


def main() -> None:
    """Write every file of the scene."""
    HERE.mkdir(exist_ok=True)
    for name, written in texts().items():
        (HERE / name).write_text(written, encoding="utf-8")


if __name__ == "__main__":
    main()
