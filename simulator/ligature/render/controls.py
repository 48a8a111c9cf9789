"""What all windows of a run share: pause, what is drawn beside the scene, the arm of the mouse, renderers."""

from __future__ import annotations

import colorsys
from collections.abc import Callable
from dataclasses import replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from ligature.bus.codec import Message
from ligature.bus.pacing import Throttle
from ligature.model.commands import Reset, WatchContacts
from ligature.model.scene import Scene
from ligature.model.shapes import Collider, Colour, TriMesh, Visual
from ligature.render.arm_drive import ArmDrive
from ligature.render.camera import CameraView
from ligature.render.renderer import Frame, Renderer

TOGGLES = {
    "C": ("collision", "collision shapes"),
    "F": ("frames", "frames"),
    "J": ("joints", "joint axes"),
    "N": ("contacts", "contact forces"),
    "T": ("tension", "thread tension"),
    "H": ("help", "this help"),
}
"""Key, name and meaning of what can be switched on and off in all windows."""


class Controls:
    """The keys and the renderers of all windows; ``send`` takes the commands that people give."""

    def __init__(self, scene: Scene, send: Callable[[Message], None], context: moderngl.Context | None = None) -> None:
        self.scene, self.send = scene, send
        self._context = context
        self._renderer = Renderer(scene, context=context)
        self._shapes: Renderer | None = None
        self.shown: set[str] = set()
        self.paused = False
        self.moves_cameras = False
        self._clock = False
        self.arm = ArmDrive(scene, send)

    def key(self, key: str, control: bool, state: NDArray[np.void] | None) -> None:
        """A key: a letter, ``" "`` or ``"."``; ``state`` (1,) is what is shown."""
        if control:
            if key == "R":
                self.send(Reset(bodies_only=True))
        elif key == " ":
            self.paused = not self.paused
            self.send(Throttle(self.paused, self._clock, 1 if self.paused else 0))
        elif key == "." and self.paused:
            self._clock = not self._clock
            self.send(Throttle(True, self._clock, 1))
        elif key == "M":
            self.moves_cameras = not self.moves_cameras
        elif key == "A":
            self.arm.next()
            if state is not None:
                self.arm.make_ready(state)
        elif key == "G" and state is not None:
            self.arm.toggle_jaw(state)
        elif key in TOGGLES:
            self.shown ^= {TOGGLES[key][0]}
            if key == "N":
                self.send(WatchContacts("contacts" in self.shown))

    def colours(self, state: NDArray[np.void], view: CameraView) -> NDArray[np.uint8]:
        """The scene of ``state`` (1,), or its collision shapes: (height, width, 3)."""
        renderer = self._collision_renderer() if "collision" in self.shown else self._renderer
        return renderer.render(state, view, ("rgb",)).rgb

    def distances(self, state: NDArray[np.void], view: CameraView) -> Frame:
        """Depth and ids of ``state`` (1,)."""
        return self._renderer.render(state, view, ("depth", "ids"))

    def _collision_renderer(self) -> Renderer:
        """Draws collision shapes in place of visual meshes; made when it is wanted first."""
        if self._shapes is None:
            grids = {tissue.body: tissue.form for tissue in self.scene.tissues}
            surfaces = {
                body: (Collider(TriMesh(form.grid.nodes, form.triangles.astype(np.int32)), np.eye(4)),)
                for body, form in grids.items()
            }
            bodies = tuple(
                replace(
                    body,
                    visual=Visual(shapes=surfaces.get(body.index, body.colliders), colour=_tint(body.index)),
                )
                for body in self.scene.bodies
            )
            self._shapes = Renderer(replace(self.scene, bodies=bodies), context=self._context)
        return self._shapes


def _tint(index: int) -> Colour:
    """A colour that distinguishes one body's collision shapes from its neighbours'; hues a golden angle apart."""
    r, g, b = colorsys.hsv_to_rgb(0.618034 * index % 1.0, 0.55, 0.9)
    return Colour(diffuse=(r, g, b), ambient=(0.5 * r, 0.5 * g, 0.5 * b), specular=(0.2, 0.2, 0.2))
