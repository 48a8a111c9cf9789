"""Random scenes as authors could write them: mostly sound, in every combination, and some with extreme values.

Scene N is the same in every run. Bodies start where their joints put them; loops and doubled joints close at
the start unless a scene is `torn`. SI units; frames as in `ligature.model.scene`.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import yaml
from ligature.adf.frames import (
    Array,
    axis_rotation,
    inverse,
    joint_frames,
    matrix_rpy,
    minimal_rotation,
    pose_matrix,
)

from tests.fuzz.seeds import ASCII_STL, MTL, OBJ

Block = dict[str, Any]

JOINT_TYPES = (
    "revolute", "continuous", "prismatic", "fixed", "linear spring", "torsion spring", "p2p", "cone twist", "six dof",
    "six dof spring",
)  # fmt: skip
CLOSING_TYPES = ("revolute", "p2p", "fixed", "prismatic")
"""Joints that can close a loop."""

APART = 4.0
"""Distance in metres between the roots of trees: what stands on different ones does not touch at the start."""

PLATE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n"
TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
SPECK = "v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n"
MESHES = {"cube.obj": OBJ, "plate.obj": PLATE, "tetrahedron.obj": TETRAHEDRON, "speck.obj": SPECK, "part.mtl": MTL,
          "triangle.stl": ASCII_STL}  # fmt: skip

TINY_TO_HUGE = (0.0, 1e-12, 1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e9, 1e12, -1e-9, -1.0, -1e6)


@dataclass
class Case:
    """One scene: its ``files`` by name, and what may be expected of it.

    ``torn``: a loop does not close at the start, so that closing it may be fast. ``driven``: it is sent commands,
    so that its bodies may move as fast as commanded.
    """

    number: int
    files: dict[str, str] = field(default_factory=dict)
    torn: bool = False
    driven: bool = False
    extreme: list[str] = field(default_factory=list)

    @property
    def entry(self) -> str:
        """The file that a user loads."""
        return "launch.yaml"


@dataclass
class _Placed:
    """A body, the model file that it is in, and its pose (4, 4) at the start."""

    key: str
    model: int
    block: Block
    T: Array
    tree: int


def scene(number: int) -> Case:
    """Scene ``number``."""
    return _Author(number).case


class _Author:
    """Writes one scene."""

    def __init__(self, number: int) -> None:
        self.rng = random.Random(number)
        self.case = Case(number)
        self.bodies: list[_Placed] = []
        self.joints: list[tuple[str, Block, int]] = []
        count = self.rng.choice((1, 1, 1, 2, 3))
        self.models: list[Block] = [self._model(i) for i in range(count)]
        for tree in range(self.rng.randint(1, 4)):
            self._tree(tree)
        for add, chance in (
            (self._double, 0.15), (self._loop, 0.15), (self._tear, 0.05), (self._rod, 0.1), (self._suture, 0.1),
            (self._sense, 0.25), (self._floor, 0.5), (self._pile, 0.2),
        ):  # fmt: skip
            if self.rng.random() < chance:
                add()
        if self.rng.random() < 0.3:
            for _ in range(self.rng.choice((1, 1, 2, 4))):
                self._exaggerate()
        self.case.driven = self.rng.random() < 0.25
        self._write()

    # --- files ------------------------------------------------------------------------------

    def _model(self, index: int) -> Block:
        rng = self.rng
        model: Block = {"bodies": [], "joints": []}
        if rng.random() < 0.7:
            model["namespace"] = rng.choice(("/ambf/env/", f"/ambf/env/m{index}/", "", "sub/"))
        if rng.random() < 0.3:
            model["gravity"] = _xyz(rng.choice(((0.0, 0.0, 0.0), (0.0, 0.0, -9.81), (0.0, 5.0, 0.0))))
        model["ignore inter-collision"] = rng.random() < 0.5
        if rng.random() < 0.2:
            model["ligature rod"] = False
        return model

    def _write(self) -> None:
        world: Block = {"lights": [], "cameras": [], "namespace": "/ambf/env/"}
        world["gravity"] = _xyz(
            self.rng.choice(((0.0, 0.0, -9.81), (0.0, 0.0, -9.81), (0.0, 0.0, 0.0), (0.0, 3.0, -9.0)))
        )
        names = [f"model{i}.yaml" for i in range(len(self.models))]
        launch = {"world config": "world.yaml", "color config": "colours.yaml", "input devices config": "devices.yaml"}
        launch["multibody configs"] = names
        files = {"launch.yaml": launch, "world.yaml": world, "devices.yaml": {"input devices": []}}
        files["colours.yaml"] = {"white": {"r": 255, "g": 255, "b": 255, "a": 255}}
        for name, block in (files | dict(zip(names, self.models, strict=True))).items():
            self.case.files[name] = yaml.safe_dump(block, sort_keys=False)
        self.case.files |= MESHES

    def _enter(self, model: int, kind: str, key: str, block: Block) -> None:
        self.models[model].setdefault(kind, []).append(key)
        self.models[model][key] = block

    # --- bodies -----------------------------------------------------------------------------

    def _body(self, model: int, T: Array, tree: int, mass: float | None = None) -> _Placed:
        rng = self.rng
        key = f"BODY b{len(self.bodies):03d}"
        block: Block = {"name": rng.choice((key[5:], f"body {key[5:]}", "same name"))}
        block["mass"] = _log(rng, 1e-3, 10.0) if mass is None else mass
        block |= self._shape(block["mass"])
        if rng.random() < 0.4:
            size = rng.uniform(0.02, 0.2)
            block["inertia"] = {k: block["mass"] * size**2 * rng.uniform(0.2, 1.0) for k in ("ix", "iy", "iz")}
        if rng.random() < 0.3:
            block["inertial offset"] = _pose(
                _vector(rng, 0.05), (0.0, 0.0, 0.0) if rng.random() < 0.5 else _vector(rng, 1.0)
            )
        if rng.random() < 0.2:
            block["friction"] = {"static": rng.choice((0.0, 0.5, 1.0, 5.0)), "rolling": rng.choice((0.0, 0.01, 0.1))}
        if rng.random() < 0.2:
            block["damping"] = {"linear": rng.choice((0.0, 0.1, 0.9, 1.0)), "angular": rng.choice((0.0, 0.1, 0.9, 1.0))}
        if rng.random() < 0.2:
            block["restitution"] = rng.choice((0.0, 0.5, 1.0))
        if rng.random() < 0.15:
            block["gravity"] = _xyz(rng.choice(((0.0, 0.0, 0.0), (0.0, 0.0, -9.81), (1.0, 2.0, 3.0))))
        if rng.random() < 0.15:
            block["collision margin"] = rng.choice((0.0, 1e-4, 0.001, 0.01))
        if rng.random() < 0.15:
            block["collision groups"] = rng.sample(range(5), rng.randint(1, 2))
        if rng.random() < 0.2:
            block["controller"] = {
                half: {"P": _log(rng, 1, 100), "I": 0, "D": rng.uniform(0, 10)} for half in ("linear", "angular")
            }
            if rng.random() < 0.5:
                block["controller output type"] = rng.choice(("VELOCITY", "FORCE"))
        if rng.random() < 0.1:
            block["passive"] = True
        placed = _Placed(key, model, block, T, tree)
        block["location"] = _pose(T[:3, 3], matrix_rpy(T[:3, :3]))
        self.bodies.append(placed)
        self._enter(model, "bodies", key, block)
        return placed

    def _shape(self, mass: float) -> Block:
        rng = self.rng
        kind = rng.choice(("none", "primitive", "primitive", "primitive", "compound", "mesh"))
        if kind == "primitive":
            shape, geometry = self._primitive(mass == 0.0)
            offset = {"collision offset": _pose(_vector(rng, 0.03), _vector(rng, 1.0))} if rng.random() < 0.2 else {}
            return {"collision shape": shape, "collision geometry": geometry, **offset}
        if kind == "compound":
            items = []
            for _ in range(rng.randint(1, 4)):
                shape, geometry = self._primitive(False)
                items.append(
                    {"shape": shape, "geometry": geometry, "offset": _pose(_vector(rng, 0.05), _vector(rng, 1.0))}
                )
            return {"compound collision shape": items}
        if kind == "mesh":
            name = rng.choice(("cube.obj", "cube.obj", "tetrahedron.obj", "plate.obj", "triangle.stl"))
            type_ = rng.choice(("CONVEX_HULL", "CONVEX_HULL", "TRIMESH", "POINT_CLOUD", "CONVEX_MESH"))
            return {
                "mesh": name,
                "collision mesh": name,
                "collision mesh type": type_,
                "scale": rng.choice((0.02, 0.05, 0.1)),
            }
        return {}

    def _primitive(self, plane: bool) -> tuple[str, Block]:
        rng = self.rng
        kind = rng.choice(("BOX", "SPHERE", "CYLINDER", "CAPSULE", "CONE", *(("PLANE",) if plane else ())))
        radius = _log(rng, 0.003, 0.1)
        geometry: dict[str, Block] = {
            "BOX": {k: _log(rng, 0.005, 0.2) for k in "xyz"},
            "SPHERE": {"radius": radius},
            "PLANE": {"normal": _xyz((0.0, 0.0, 1.0)), "offset": -1.0},
        }
        return kind, geometry.get(
            kind, {"radius": radius, "height": radius * rng.uniform(0.5, 10.0), "axis": rng.choice("XYZ")}
        )

    def _tree(self, tree: int) -> None:
        """A root and what hangs on it, every body where its joint says at zero."""
        rng = self.rng
        turn = _vector(rng, 3.0) if rng.random() < 0.5 else (0.0, 0.0, 0.0)
        T = pose_matrix((APART * tree, rng.uniform(-0.5, 0.5), rng.uniform(0.5, 2.0)), turn)
        model = rng.randrange(len(self.models))
        members = [self._body(model, T, tree, 0.0 if rng.random() < 0.5 else None)]
        for _ in range(rng.choice((0, 0, 1, 2, 3, 6))):
            parent = rng.choice(members)
            child = self._body(
                rng.randrange(parent.model, len(self.models)), np.eye(4), tree, 0.0 if rng.random() < 0.05 else None
            )
            joint = self._joint_block(parent, child)
            child.T = parent.T @ _child_at_zero(parent.block, child.block, joint)
            child.block["location"] = _pose(child.T[:3, 3], matrix_rpy(child.T[:3, :3]))
            members.append(child)
            self._join(joint, parent, child)

    # --- joints -----------------------------------------------------------------------------

    def _join(self, joint: Block, parent: _Placed, child: _Placed) -> None:
        key = f"JOINT {len(self.joints)}"
        model = max(parent.model, child.model)
        self.joints.append((key, joint, model))
        self._enter(model, "joints", key, joint)

    def _joint_block(self, parent: _Placed, child: _Placed, type_: str | None = None) -> Block:
        rng = self.rng
        kind = type_ or rng.choice(JOINT_TYPES)
        reach = rng.choice((0.0, 0.02, 0.1, 0.3))
        joint: Block = {
            "name": rng.choice((f"j{len(self.joints)}", "joint")), "type": kind,
            "parent": parent.key, "child": child.key,
            "parent pivot": _xyz(_vector(rng, reach)), "child pivot": _xyz(_vector(rng, reach)),
            "parent axis": _xyz(self._direction()), "child axis": _xyz(self._direction()),
        }  # fmt: skip
        if rng.random() < 0.3:
            joint["offset"] = rng.uniform(-3.0, 3.0)
        if rng.random() < 0.1:
            joint["joint offset"] = rng.uniform(-3.0, 3.0)
        self._limits(joint, kind)
        if rng.random() < 0.3:
            joint["controller"] = {"P": _log(rng, 1.0, 1000.0), "I": rng.choice((0, 0.1)), "D": rng.uniform(0.0, 10.0)}
            if rng.random() < 0.5:
                joint["controller output type"] = rng.choice(("VELOCITY", "FORCE"))
        if rng.random() < 0.3:
            joint["max motor impulse"] = _log(rng, 1e-3, 1.0)
        for key, chance in (("enable feedback", 0.2), ("passive", 0.1)):
            if rng.random() < chance:
                joint[key] = True
        if rng.random() < 0.1:
            joint["ignore inter-collision"] = False
        return joint

    def _direction(self) -> tuple[float, ...]:
        rng = self.rng
        axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (-1.0, 0.0, 0.0))
        return rng.choice(axes) if rng.random() < 0.7 else tuple(np.add(_vector(rng, 1.0), (0.0, 0.0, 1.5)).tolist())

    def _limits(self, joint: Block, kind: str) -> None:
        rng = self.rng
        length = kind in ("prismatic", "linear spring")
        span = rng.choice((0.01, 0.05, 0.2)) if length else rng.choice((0.1, 1.0, 2.5))
        if kind in ("linear spring", "torsion spring"):
            joint |= {"stiffness": _log(rng, 0.01, 100.0), "damping": _log(rng, 1e-4, 1.0)}
            joint["equilibrium point"] = rng.uniform(-span, span)
        if kind == "cone twist":
            joint["joint limits"] = {k: rng.uniform(0.05, 1.5) for k in "xyz"}
        elif kind.startswith("six dof"):
            linear = [rng.choice(((0.0, 0.0), (0.0, 0.0), (-0.05, 0.05))) for _ in range(3)]
            angular = [rng.choice(((0.0, 0.0), (-0.5, 0.5), (1.0, -1.0))) for _ in range(3)]
            joint["joint limits"] = {
                half: {end: _xyz([pair[i] for pair in pairs]) for i, end in enumerate(("low", "high"))}
                for half, pairs in (("linear", linear), ("angular", angular))
            }
            if kind == "six dof spring":
                for key, scale in (("stiffness", 10.0), ("damping", 0.1)):
                    joint[key] = {
                        half: _xyz([scale * rng.random() for _ in range(3)]) for half in ("linear", "angular")
                    }
        elif kind != "fixed" and (length or rng.random() < 0.7):
            joint["joint limits"] = {"low": -span * rng.random(), "high": span * rng.random()}

    def _pair(self) -> tuple[_Placed, _Placed] | None:
        """Two bodies of one tree."""
        pairs = [(a, b) for a in self.bodies for b in self.bodies if a.tree == b.tree and a is not b]
        return self.rng.choice(pairs) if pairs else None

    def _double(self) -> None:
        """A joint once more, under another name, alike or of another type that closes, either way round."""
        if not self.joints:
            return
        for _ in range(self.rng.choice((1, 1, 3))):
            _, joint, model = self.rng.choice(self.joints)
            copy = dict(joint)
            key = f"JOINT {len(self.joints)}"
            if self.rng.random() < 0.3:
                copy["type"] = "p2p"
            self.joints.append((key, copy, model))
            self._enter(model, "joints", key, copy)

    def _loop(self, slip: float = 0.0) -> None:
        """A joint between two bodies of one tree that fits where they are, but for ``slip`` metres."""
        pair = self._pair()
        if pair is None:
            return
        parent, child = pair
        joint = self._joint_block(parent, child, self.rng.choice(CLOSING_TYPES))
        joint.pop("joint offset", None)
        at = np.append((parent.T[:3, 3] + child.T[:3, 3]) / 2 + _vector(self.rng, 0.05), 1.0)
        along = np.array(self._direction())
        along /= np.linalg.norm(along)
        away = at + np.append(_vector(self.rng, slip), 0.0)
        joint["parent pivot"] = _xyz((inverse(parent.T) @ at)[:3] / parent.block.get("scale", 1.0))
        joint["child pivot"] = _xyz((inverse(child.T) @ away)[:3] / child.block.get("scale", 1.0))
        joint["parent axis"], joint["child axis"] = _xyz(parent.T[:3, :3].T @ along), _xyz(child.T[:3, :3].T @ along)
        joint["offset"] = _twist(parent, child, joint)
        self._join(joint, parent, child)

    def _tear(self) -> None:
        self.case.torn = True
        self._loop(slip=self.rng.choice((0.001, 0.05, 0.5)))

    # --- threads, sensors, surroundings --------------------------------------------------------

    def _rod(self) -> None:
        """A chain of capsules joined by springs, free or fixed to a body at its start."""
        rng = self.rng
        model = rng.randrange(len(self.models))
        n, length = rng.choice((3, 5, 12)), rng.choice((0.005, 0.02))
        start = pose_matrix((APART * 10, 0.0, rng.uniform(0.2, 2.0)), _vector(rng, 3.0))
        chain = []
        for i in range(n):
            T = start @ pose_matrix((0.0, 0.0, (i + 0.5) * length), (0.0, 0.0, 0.0))
            body = self._body(model, T, 100, _log(rng, 1e-5, 1e-3))
            for key in ("mesh", "collision mesh", "collision mesh type", "scale", "compound collision shape",
                        "collision offset", "inertial offset", "inertia"):  # fmt: skip
                body.block.pop(key, None)
            body.block |= {
                "collision shape": "CAPSULE",
                "collision geometry": {"radius": 0.001, "height": length, "axis": "Z"},
            }
            chain.append(body)
        for a, b in zip(chain, chain[1:], strict=False):
            bend = rng.choice((1e-4, 1e-2, 1.0))
            joint: Block = {
                "name": "bend", "type": "six dof spring", "parent": a.key, "child": b.key,
                "parent pivot": _xyz((0, 0, length / 2)), "child pivot": _xyz((0, 0, -length / 2)),
                "parent axis": _xyz((0, 0, 1)), "child axis": _xyz((0, 0, 1)),
                "joint limits": {"linear": {e: _xyz((0, 0, 0)) for e in ("low", "high")},
                                 "angular": {"low": _xyz((-3, -3, -3)), "high": _xyz((3, 3, 3))}},
                "stiffness": {half: _xyz((bend,) * 3) for half in ("linear", "angular")},
                "damping": {half: _xyz((0.01 * bend,) * 3) for half in ("linear", "angular")},
            }  # fmt: skip
            self._join(joint, a, b)

    def _suture(self) -> None:
        rng = self.rng
        model = rng.randrange(len(self.models))
        block: Block = {"name": "thread", "length": rng.choice((0.02, 0.1, 0.3)), "elements": rng.choice((4, 10, 40))}
        block |= rng.choice(({"diameter": 0.0003}, {"USP size": "2-0"}, {"diameter": 0.002}))
        if rng.random() < 0.5:
            block["parent"] = rng.choice([b.key for b in self.bodies])
            if rng.random() < 0.5:
                block["release force"] = rng.choice((0.0, 1e-3, 1.0, 1e6))
        else:
            block["location"] = _pose((APART * 12, 0.0, 1.0), _vector(rng, 3.0))
        self._enter(model, "sutures", "SUTURE thread", block)

    def _sense(self) -> None:
        rng = self.rng
        for kind in ("sensors", "actuators", "ghost objects"):
            for i in range(rng.randint(0, 2)):
                body = rng.choice(self.bodies)
                key = f"{kind[:-1].upper()} {i}"
                if key in self.models[body.model]:
                    continue
                block: Block = {
                    "name": f"{kind[:2]}{i}",
                    "parent": body.key,
                    "location": _pose(_vector(rng, 0.1), _vector(rng, 1.0)),
                }
                if kind == "sensors":
                    block["type"] = rng.choice(("Proximity", "Resistance", "Contact"))
                    block["range"] = rng.choice((0.01, 0.5, 5.0))
                    block["array"] = [
                        {"offset": _xyz(_vector(rng, 0.1)), "direction": _xyz(self._direction())} for _ in range(3)
                    ]
                    block |= {"friction": {"static": 1.0, "damping": 0.1, "dynamic": 0.5}, "contact stiffness": 1.0}
                elif kind == "actuators":
                    block["type"] = "Constraint"
                else:
                    shape, geometry = self._primitive(False)
                    block |= {"collision shape": shape, "collision geometry": geometry}
                self._enter(body.model, kind, key, block)

    def _floor(self) -> None:
        block = {"name": "floor", "mass": 0.0, "collision shape": "BOX", "collision geometry": {"x": 100.0, "y": 20.0, "z": 0.1},
                 "location": _pose((0.0, 0.0, self.rng.choice((-0.05, -2.0))), (0.0, 0.0, 0.0))}  # fmt: skip
        self._enter(0, "bodies", "BODY floor", block)

    def _pile(self) -> None:
        """Bodies that touch or overlap where they start."""
        rng = self.rng
        model = rng.randrange(len(self.models))
        centre = np.array((APART * 15, 0.0, 0.3))
        for _ in range(rng.randint(2, 6)):
            self._body(model, pose_matrix(centre + _vector(rng, rng.choice((0.02, 0.1, 0.3))), _vector(rng, 3.0)), 200)

    # --- what no sober author writes ---------------------------------------------------------

    def _exaggerate(self) -> None:
        """Replace one number of the scene by a tiny, huge or negative one, or a reference by a strange one."""
        rng = self.rng
        changes: list[Callable[[], str]] = [
            self._odd_number,
            self._odd_number,
            self._odd_number,
            self._odd_key,
            self._odd_reference,
        ]
        self.case.extreme.append(rng.choice(changes)())

    def _odd_number(self) -> str:
        leaves: list[tuple[Block | list[Any], Any, str]] = []

        def walk(node: Any, path: str) -> None:
            entries = node.items() if isinstance(node, dict) else enumerate(node)
            for key, value in list(entries):
                if isinstance(value, dict | list):
                    walk(value, f"{path}.{key}")
                elif isinstance(value, float):
                    leaves.append((node, key, f"{path}.{key}"))

        walk(self.models, "")
        block, key, path = self.rng.choice(leaves)
        block[key] = self.rng.choice(TINY_TO_HUGE)
        return f"{path}={block[key]}"

    def _odd_key(self) -> str:
        """A key that the scene may lack, with a strange value."""
        rng = self.rng
        value: Any = rng.choice(TINY_TO_HUGE)
        body = rng.choice(self.bodies).block
        options: list[tuple[Block, str, Any]] = [
            (body, "mass", value), (body, "scale", value), (body, "collision margin", value),
            (body, "inertia", {"ix": value, "iy": rng.choice((value, 1e-3)), "iz": rng.choice((value, 1e-3))}),
            (body, "inertial offset", _pose((value, 0.0, 0.0), (0.0, 0.0, 0.0))),
            (body, "friction", {"static": value, "rolling": value}), (body, "restitution", value),
            (body, "damping", {"linear": value, "angular": value}),
            (body, "collision mesh", "speck.obj"), (body, "gravity", _xyz((0.0, 0.0, value))),
            (body, "controller", {half: {"P": value, "I": value, "D": value} for half in ("linear", "angular")}),
            (body, "collision groups", [-1, 5000]), (body, "name", ""),
        ]  # fmt: skip
        if self.joints:
            joint = rng.choice(self.joints)[1]
            spring: Any = value
            if str(joint["type"]).startswith("six dof"):
                spring = {half: _xyz((value, value, value)) for half in ("linear", "angular")}
            options += [
                (joint, "controller", {"P": value, "I": value, "D": value}), (joint, "max motor impulse", value),
                (joint, "stiffness", spring), (joint, "damping", spring), (joint, "equilibrium point", spring),
                (joint, "joint limits", {"low": value, "high": rng.choice((value, -value, 1.0))}),
                (joint, "joint limits", {"x": value, "y": value, "z": value}),
                (joint, "parent axis", _xyz((value, 0.0, 0.0))), (joint, "parent pivot", _xyz((value, 0.0, 0.0))),
                (joint, "offset", value), (joint, "joint offset", value), (joint, "joint erp", value),
                (joint, "joint cfm", value), (joint, "type", rng.choice(JOINT_TYPES)), (joint, "enable motor", 0),
            ]  # fmt: skip
        block, key, new = rng.choice(options)
        block[key] = new
        return f"{key}={new}"

    def _odd_reference(self) -> str:
        """Joints of a body with itself, to bodies that are missing, and other families than trees."""
        rng = self.rng
        if not self.joints:
            return ""
        joint = rng.choice(self.joints)[1]
        what = rng.choice(("parent", "child"))
        joint[what] = rng.choice([b.key for b in self.bodies] + ["BODY nobody", "same name"])
        self.case.torn = True
        return f"{what}={joint[what]}"


def _child_at_zero(parent: Block, child: Block, joint: Block) -> Array:
    """Pose (4, 4) of the child's body frame in the parent's at joint position zero."""
    T_parent, T_child = (_inertial(block) for block in (parent, child))
    keys = ("parent pivot", "child pivot", "parent axis", "child axis")
    parent_pivot, child_pivot, parent_axis, child_axis = (tuple(joint[key].values()) for key in keys)
    frames = joint_frames(
        T_parent, T_child, parent_pivot, child_pivot, parent_axis, child_axis,
        joint.get("offset", 0.0), joint.get("joint offset", 0.0), joint["type"] == "prismatic",
    )  # fmt: skip
    T: Array = T_parent @ _scaled(frames.T_parent_child, parent, child, joint, T_parent, T_child) @ inverse(T_child)
    return T


def _scaled(T: Array, parent: Block, child: Block, joint: Block, T_parent: Array, T_child: Array) -> Array:
    """``T`` for pivots multiplied by the scales of their bodies."""
    scales = parent.get("scale", 1.0), child.get("scale", 1.0)
    if scales == (1.0, 1.0):
        return T
    pivots = [
        np.array(tuple(joint[k].values())) * s for k, s in zip(("parent pivot", "child pivot"), scales, strict=True)
    ]
    R = T[:3, :3]
    on_parent = (inverse(T_parent) @ np.append(pivots[0], 1.0))[:3]
    on_child = (inverse(T_child) @ np.append(pivots[1], 1.0))[:3]
    scaled = T.copy()
    scaled[:3, 3] = on_parent - R @ on_child
    return scaled


def _inertial(body: Block) -> Array:
    offset = body.get("inertial offset")
    if offset is None:
        return np.eye(4)
    return pose_matrix(*(tuple(offset[k].values()) for k in ("position", "orientation")))


def _twist(parent: _Placed, child: _Placed, joint: Block) -> float:
    """The ``offset`` with which a joint between two bodies is at zero where they are."""
    T_parent, T_child = _inertial(parent.block), _inertial(child.block)
    R = (inverse(parent.T @ T_parent) @ child.T @ T_child)[:3, :3]
    a = T_parent[:3, :3].T @ np.array(tuple(joint["parent axis"].values()))
    b = T_child[:3, :3].T @ np.array(tuple(joint["child axis"].values()))
    turn = R @ minimal_rotation(b, a).T
    angles = np.linspace(-np.pi, np.pi, 7)[:-1]
    best = min(angles, key=lambda angle: float(np.abs(axis_rotation(a, angle) - turn).sum()))
    rest = axis_rotation(a, best).T @ turn
    skew = np.array([rest[2, 1] - rest[1, 2], rest[0, 2] - rest[2, 0], rest[1, 0] - rest[0, 1]])
    return float(best + np.arctan2(skew @ a / 2, (np.trace(rest) - 1) / 2))


def _log(rng: random.Random, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _vector(rng: random.Random, size: float) -> tuple[float, float, float]:
    return rng.uniform(-size, size), rng.uniform(-size, size), rng.uniform(-size, size)


def _xyz(values: Any) -> Block:
    return {k: float(v) for k, v in zip("xyz", values, strict=True)}


def _pose(position: Any, rpy: Any) -> Block:
    return {"position": _xyz(position), "orientation": {k: float(v) for k, v in zip("rpy", rpy, strict=True)}}
