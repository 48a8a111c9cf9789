"""The cameras of a running simulation: pictures on demand, of the state as it is.

Poses are x y z qx qy qz qw of the camera frame, world axes; the camera looks along -X. Metres, pixels.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ligature.adf import AdfError
from ligature.model.commands import PlaceCommand
from ligature.model.handles import Handles, pose_numbers
from ligature.model.optics import Calibration, stereo_partners
from ligature.model.scene import Camera
from ligature.render.calibration import calibrations
from ligature.render.camera import CameraView, view_of
from ligature.render.context import check_process
from ligature.render.look import Look
from ligature.render.renderer import Renderer
from ligature.render.sensor import IDEAL, ImageSensor
from ligature.render.target import Exposure, Frame
from ligature.simulation import Simulation

Array = NDArray[np.float64]


class Studio:
    """Draws the cameras of a simulation with one renderer, which is created for the first picture."""

    def __init__(self, simulation: Simulation) -> None:
        self.scene = simulation.scene
        self.partners = stereo_partners(self.scene)
        self._renderer: Renderer | None = None
        self._look: Look | None = None
        self._closed = False
        self.handles = [CameraHandle(simulation, self, camera) for camera in simulation.scene.cameras]

    @property
    def renderer(self) -> Renderer:
        """The renderer; raises `RenderUnavailable` where no OpenGL is available, RuntimeError after `close`."""
        if self._closed:
            raise RuntimeError("the simulation is closed: its cameras can take no pictures")
        check_process()
        if self._renderer is None:
            self._renderer = Renderer(self.scene)
            if self._look is not None:
                self._renderer.change_look(self._look)
        return self._renderer

    def change_look(self, look: Look) -> None:
        """Have the scene look otherwise from the next picture on."""
        self._look = look
        if self._renderer is not None:
            self._renderer.change_look(look)

    def close(self) -> None:
        """Give OpenGL back."""
        self._closed = True
        if self._renderer is not None:
            self._renderer.release()
            self._renderer = None


class CameraHandle:
    """One camera of a running simulation.

    ``camera`` is its description; put another one there (`dataclasses.replace`) to change the lens.
    """

    def __init__(self, simulation: Simulation, studio: Studio, camera: Camera) -> None:
        self._simulation, self._studio = simulation, studio
        self.camera = camera

    @property
    def pose(self) -> Array:
        """Pose (7,) in world axes."""
        return np.array(self._simulation.state["camera_world"][0, self.camera.index])

    @property
    def problems(self) -> list[AdfError]:
        """What could not be drawn, after the first picture."""
        return self._studio.renderer.problems

    def place(self, pose: ArrayLike) -> None:
        """Put the camera at ``pose``, (7,) or (4, 4), in its parent's frame, from the next tick on."""
        self._simulation.apply(PlaceCommand("camera", self.camera.index, pose_numbers("place", pose)))

    def view(self, resolution: tuple[int, int] | None = None, eye: str = "") -> CameraView:
        """What is to be drawn now: eye pose, projection and the pinhole matrix ``intrinsics``."""
        return view_of(self.camera, self.pose, resolution, eye)

    def capture(
        self,
        resolution: tuple[int, int] | None = None,
        *,
        passes: Sequence[str] = ("rgb", "depth", "ids"),
        eye: str = "",
        sensor: ImageSensor = IDEAL,
    ) -> Frame:
        """Take a picture of the state as it is.

        Parameters
        ----------
        resolution
            Width and height in pixels; the camera's own when not given.
        passes
            What the picture holds, of `ligature.render.PASSES`: ``rgb``, ``depth``, ``ids``, ``parts``, ``normals``,
            ``flow``.
        eye
            ``"left"`` or ``"right"`` of a camera with a ``stereo`` block.
        sensor
            What the lens and the sensor do to the picture; nothing when not given.

        Raises
        ------
        RenderUnavailable
            When the machine has no OpenGL.
        """
        return self.expose(resolution, passes=passes, eye=eye, sensor=sensor).frame()

    def expose(
        self,
        resolution: tuple[int, int] | None = None,
        *,
        passes: Sequence[str] = ("rgb", "depth", "ids"),
        eye: str = "",
        sensor: ImageSensor = IDEAL,
    ) -> Exposure:
        """Begin a picture like `capture`: with software rendering it is drawn while the simulation continues."""
        state = self._simulation.state
        view, moment = self.view(resolution, eye), (self.camera.index, int(state["tick"][0]))
        shaders = self.camera.preprocessing_shaders
        drawn = self._studio.renderer.expose(state, sensor.view(view), passes, shaders)
        return drawn.then(lambda frame: sensor.expose(frame, view, moment))

    def calibration(
        self, resolution: tuple[int, int] | None = None, *, eye: str = "", sensor: ImageSensor = IDEAL
    ) -> Calibration:
        """What a calibration would find; in a stereo pair the right one holds the baseline."""
        cameras = [handle.camera for handle in self._studio.handles]
        lenses = {camera.index: sensor.distortion for camera in cameras}
        poses = self._simulation.state["camera_world"][0]
        return calibrations(cameras, poses, self._studio.partners, lenses, resolution)[self.camera.index, eye]


def camera_handles(studio: Studio) -> Handles[CameraHandle]:
    """All cameras of a simulation by name."""
    return Handles("camera", studio.scene.cameras, studio.handles)
