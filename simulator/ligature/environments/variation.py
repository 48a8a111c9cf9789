"""What was drawn for an episode, put into effect: on the scene, on its looks, and on what passes to and from the agent.

World axes, metres, radians.
"""

from __future__ import annotations

from copy import deepcopy
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.camera_simulation import Simulation
from ligature.environments import layout
from ligature.environments.randomisation import Drawn, things_of
from ligature.model.commands import PlaceCommand
from ligature.model.frames import axis_rotation, frame, matrix_pose7, matrix_quaternion, quaternion_matrix
from ligature.model.piercing import Needle
from ligature.model.scene import Body, Joint, Scene
from ligature.model.shapes import Box, Capsule, Collider, Cone, Cylinder, Hull, Shape, Sphere, TriMesh

Array = NDArray[np.float64]


# --- the scene ------------------------------------------------------------------------------


def varied(scene: Scene, drawn: Drawn) -> Scene:
    """The scene with the masses, frictions and the needle that were drawn."""
    if drawn.needle_size is not None:
        for needle in scene.needles:
            scene = _resized(scene, needle, drawn.needle_size)
    bodies = list(scene.bodies)
    for name, members in things_of(scene):
        mass, friction = (drawn.mass or {}).get(name, 1.0), (drawn.friction or {}).get(name, 1.0)
        for index in members:
            body = bodies[index]
            bodies[index] = replace(
                body, mass=body.mass * mass, inertia=body.inertia * mass, friction=body.friction * friction
            )
    return replace(scene, bodies=tuple(bodies))


def _resized(scene: Scene, needle: Needle, size: float) -> Scene:
    """The scene with a needle whose lengths are ``size`` times as long about its frame, and its thread at its end."""
    old, arc = scene.bodies[needle.body], needle.arc
    joints, bodies = list(scene.joints), list(scene.bodies)
    bodies[needle.body] = _scaled_body(old, size)
    for rod in scene.rods:
        for index in rod.anchors:
            if needle.body in (joints[index].parent, joints[index].child):
                joints[index], shift = _moved_anchor(joints[index], old, size)
                for element in rod.bodies if len(rod.anchors) == 1 else ():
                    T = bodies[element].T_world_body.copy()
                    T[:3, 3] += shift
                    bodies[element] = replace(bodies[element], T_world_body=T)
    resized = replace(needle, arc=replace(arc, centre=arc.centre * size, radius=arc.radius * size))
    needles = tuple(resized if other is needle else other for other in scene.needles)
    return replace(scene, bodies=tuple(bodies), joints=tuple(joints), needles=needles)


def _scaled_body(body: Body, size: float) -> Body:
    visual = replace(body.visual, scale=body.visual.scale * size, shapes=_scaled(body.visual.shapes, size))
    return replace(
        body, mass=body.mass * size**3, inertia=body.inertia * size**5, visual=visual,
        T_body_inertial=_further(body.T_body_inertial, size), colliders=_scaled(body.colliders, size),
    )  # fmt: skip


def _further(T: Array, size: float) -> Array:
    """A frame whose origin is ``size`` times as far away."""
    found = T.copy()
    found[:3, 3] *= size
    return found


def _scaled(parts: tuple[Collider, ...], size: float) -> tuple[Collider, ...]:
    return tuple(Collider(_scaled_shape(part.shape, size), _further(part.T_body_shape, size)) for part in parts)


def _scaled_shape(shape: Shape, size: float) -> Shape:
    if isinstance(shape, Box):
        return replace(shape, size=shape.size * size)
    if isinstance(shape, Sphere):
        return replace(shape, radius=shape.radius * size)
    if isinstance(shape, Cylinder | Capsule | Cone):
        return replace(shape, radius=shape.radius * size, height=shape.height * size)
    if isinstance(shape, Hull | TriMesh):
        return replace(shape, vertices=shape.vertices * size)
    return shape


def _moved_anchor(joint: Joint, needle: Body, size: float) -> tuple[Joint, Array]:
    """The joint between a needle and its thread where the end of the larger needle is, and the way (3,) there."""
    is_parent = joint.parent == needle.index
    T_pivot = joint.T_parent_a if is_parent else joint.T_child_b
    moved = (size - 1.0) * (needle.T_body_inertial @ T_pivot)[:3, 3]
    T_zero = joint.T_parent_child_zero.copy()
    T_zero[:3, 3] += moved if is_parent else -T_zero[:3, :3] @ moved
    shift = needle.T_world_body[:3, :3] @ moved
    pivot = _further(T_pivot, size)
    found = replace(joint, T_parent_child_zero=T_zero)
    found = replace(found, T_parent_a=pivot) if is_parent else replace(found, T_child_b=pivot)
    return found, np.asarray(shift)


# --- cameras and lights ---------------------------------------------------------------------


def place(simulation: Simulation, drawn: Drawn) -> None:
    """Move cameras and lights to where they were drawn; they stay there until a reset or a restore."""
    scene = simulation.scene
    moved = _camera_poses(scene, drawn) if drawn.camera_shift or drawn.camera_turn else {}
    for camera in scene.cameras:
        if camera.index in moved:
            simulation.apply(PlaceCommand("camera", camera.index, tuple(matrix_pose7(moved[camera.index]).tolist())))
    for light in scene.lights:
        shift = (drawn.light_shift or {}).get(light.identity.identifier)
        if shift is not None:
            T = light.attachment.T_parent_object.copy()
            T[:3, 3] += shift
            simulation.apply(PlaceCommand("light", light.index, tuple(matrix_pose7(T).tolist())))
    simulation.step(0)


def _camera_poses(scene: Scene, drawn: Drawn) -> dict[int, Array]:
    """Poses (4, 4) of cameras on what carries them, turned about the first camera that it carries."""
    turn = np.array(drawn.camera_turn or (0.0, 0.0, 0.0))
    angle = float(np.linalg.norm(turn))
    R = axis_rotation(turn / angle, angle) if angle > 0.0 else np.eye(3)
    shift = np.array(drawn.camera_shift or (0.0, 0.0, 0.0))
    pivots: dict[tuple[str, int] | None, Array] = {}
    found: dict[int, Array] = {}
    for camera in scene.cameras:
        T = camera.attachment.T_parent_object
        pivot = pivots.setdefault(camera.attachment.parent, T[:3, 3])
        found[camera.index] = frame(R @ T[:3, :3], pivot + shift + R @ (T[:3, 3] - pivot))
    return found


def dress(simulation: Simulation, drawn: Drawn, camera: str) -> None:
    """Have pictures show lights, colours and the field of view that were drawn."""
    from ligature.render.look import Look

    scene = simulation.scene
    handle = simulation.cameras[camera]
    stated = scene.cameras[handle.camera.index]
    factor = 1.0 if drawn.field_of_view is None else drawn.field_of_view
    handle.camera = replace(stated, field_of_view=stated.field_of_view * factor)
    brightness = tuple((drawn.light or {}).get(light.identity.identifier, 1.0) for light in scene.lights)
    tints = {scene.body_index[name]: tint for name, tint in (drawn.colour or {}).items()}
    simulation.change_look(Look(brightness, tints))


# --- what passes to and from the agent ------------------------------------------------------


class Channel:
    """Delays of actions and observations, and noise of what is observed, in one episode of ``arms`` arms."""

    def __init__(self, drawn: Drawn, arms: int) -> None:
        self._drawn = drawn
        self._angles = layout.angles(arms)
        self._noise = np.random.default_rng(drawn.noise_seed)
        self._actions = [np.zeros(layout.action_width(arms)) for _ in range(drawn.action_delay or 0)]
        self._seen: list[Any] = []

    def act(self, action: Array) -> Array:
        """The action that arrives now; before the first ones have, the arms stay."""
        self._actions.append(action)
        return self._actions.pop(0)

    def sense(self, state: Array) -> Array:
        """A state observation as sensors have it."""
        drawn, seen, noise = self._drawn, state.copy(), self._noise
        if drawn.joint_noise:
            seen[self._angles] += drawn.joint_noise * noise.standard_normal(len(self._angles))
        if drawn.position_noise:
            error = drawn.position_noise * noise.standard_normal(3)
            seen[layout.PLACE] += error
            seen[layout.TARGET] += error
        if drawn.angle_noise:
            turn = drawn.angle_noise * noise.standard_normal(3)
            angle = float(np.linalg.norm(turn))
            q = state[layout.TURN]
            turned = matrix_quaternion(axis_rotation(turn / angle, angle) @ quaternion_matrix(q))
            seen[layout.TURN] = turned if turned @ q >= 0.0 else -turned
        return seen

    def late(self, observation: Any) -> Any:
        """What is seen now, of an ``observation`` of now."""
        self._seen.append(observation)
        if len(self._seen) > 1 + (self._drawn.observation_delay or 0):
            del self._seen[0]
        return deepcopy(self._seen[0])

    @property
    def last(self) -> Any:
        """What was seen last."""
        return deepcopy(self._seen[0])
