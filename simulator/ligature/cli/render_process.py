"""The camera process: draws the newest state of the bus for subscribers, and publishes the pictures on ROS.

It never holds up physics: it has a lower priority, takes the newest state, and leaves out what comes too late.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from ligature.bus import Block
from ligature.cli.options import RunOptions
from ligature.cli.process import Run, run_process
from ligature.model.optics import Calibration, stereo_partners
from ligature.model.scene import Camera, Scene
from ligature.model.state import new_state
from ligature.process import report
from ligature.render import CameraView, ImageSensor, LightKind, Renderer, RenderUnavailable, unproject, view_of
from ligature.render.calibration import Eye, calibrations
from ligature.render.clouds import with_clouds
from ligature.render.sensor import IDEAL
from ligature.render.shutter import Shutter
from ligature.ros.camera_facts import CameraFacts, facts
from ligature.ros.cameras import CameraNode, CameraTopics, Picture, Wishes
from ligature.ros.clouds import Clouds
from ligature.ros.master import MasterWatch
from ligature.ros.parameters import Follower
from ligature.ros.registrations import NameTaken

NAP = 0.05
"""Maximum sleep in seconds between two checks of the stop signal and the physics process."""


def main() -> None:
    """Entry point; see `ligature.cli.process`."""
    run_process(_draw)


def _draw(run: Run) -> None:
    try:
        renderer = Renderer(run.scene)
        studio = Studio(run.scene, renderer, run.block, run.options)
    except (RenderUnavailable, NameTaken) as error:
        run.decline("pictures", error)
    for problem in renderer.problems:
        report("finding", str(problem.diagnostics[0]))
    report("ready", f"pictures of {', '.join(camera.identity.name for camera in studio.cameras)}")
    while run.active:
        studio.turn(time.monotonic())


class _Exposure:
    """One camera or eye: its topics, and the shutters of its pictures and clouds."""

    def __init__(self, topics: CameraTopics) -> None:
        self.topics = topics
        self.key = (topics.camera.index, topics.eye)
        self._picture = Shutter(topics.image_interval)
        self._cloud = None if topics.depth_interval is None else Shutter(topics.depth_interval)
        self._drawn = False

    @property
    def due(self) -> float:
        """The earliest deadline."""
        return self._picture.due if self._cloud is None else min(self._picture.due, self._cloud.due)

    def open(self, now: float, update: int) -> tuple[Wishes, int]:
        """The due topics with subscribers and a new state, and the number of frames dropped since the last call."""
        missed = self._picture.missed(now) if self._drawn else 0
        picture = self._picture.open(now, update)
        cloud = self._cloud is not None and self._cloud.open(now, update)
        wishes = self.topics.wishes(picture, cloud)
        if picture:
            self._drawn = bool(wishes.passes)
        return wishes, missed


class Studio:
    """One turn draws what is due and wanted from one reading of the state, so that all of it shows one moment."""

    def __init__(self, scene: Scene, renderer: Renderer, block: Block, options: RunOptions) -> None:
        self._scene, self._renderer, self._block = scene, renderer, block
        self._state = new_state(scene)
        self._partners = stereo_partners(scene)
        self.cameras = options.shown_cameras(scene)
        self._node = CameraNode(scene, self.cameras, bool(options.cameras))
        self._follower = Follower(scene)
        self._facts, self._seen = CameraFacts(), new_state(scene)
        self._clouds = Clouds(scene)
        MasterWatch(self._look_at_parameters).start()
        self._rejected: set[str] = set()
        self._exposures = [_Exposure(topics) for topics in self._node.topics]

    def _look_at_parameters(self) -> None:
        """Read the parameters that users set, and write derived ones; runs on the thread that watches the master."""
        self._follower.poll()
        self._clouds.poll()
        if self._block.filled and self._block.read(self._seen):
            poses = self._seen["camera_world"][0]
            found = self._calibrations(poses)
            shown = {topics.camera.index: topics for topics in self._node.topics if not topics.eye}
            self._facts.write({
                topics.camera.identity.topic: facts(found[index, ""], poses[index], topics.optical_frame)
                for index, topics in shown.items()
            })  # fmt: skip

    def turn(self, now: float) -> None:
        """Wait for the next deadline, or draw what is due."""
        nap = min(exposure.due for exposure in self._exposures) - now
        if nap > 0.0:
            time.sleep(min(nap, NAP))
        elif self._block.read(self._state):
            self._shoot(now)

    def _shoot(self, now: float) -> None:
        update, stamp = int(self._state["update"][0]), float(self._state["stamp"][0])
        poses = self._state["camera_world"][0]
        calls, missed = [], 0
        for exposure in self._exposures:
            if exposure.due <= now:
                wishes, late = exposure.open(now, update)
                calls.append((exposure, wishes))
                missed += late
        self._node.publish_frames(poses, [e.topics.camera for e, wishes in calls if wishes.picture_due], stamp)
        if any(wishes.info for _, wishes in calls):
            self._publish_infos(calls, poses, stamp)
        self._set_lights()
        wanted = [(exposure, wishes) for exposure, wishes in calls if wishes.drawing]
        for exposure, wishes in wanted:
            self._draw(exposure, wishes, stamp)
        self._count(len(wanted), missed, time.monotonic() - now)

    def _publish_infos(self, calls: list[tuple[_Exposure, Wishes]], poses: np.ndarray, stamp: float) -> None:
        found = self._calibrations(poses)
        for exposure, wishes in calls:
            if wishes.info:
                exposure.topics.publish_info(found[exposure.key], stamp)

    def _calibrations(self, poses: np.ndarray) -> dict[Eye, Calibration]:
        """Calibrations of all cameras as their parameters have them now, at ``poses`` (n, 7)."""
        cameras = [self._camera(camera.index) for camera in self._scene.cameras]
        lenses = {camera.index: self._follower.sensors[camera.index]["distortion"] for camera in cameras}
        return calibrations(cameras, poses, self._partners, lenses)

    def _draw(self, exposure: _Exposure, wishes: Wishes, stamp: float) -> None:
        index, eye = exposure.key
        camera = self._camera(index)
        view = view_of(camera, self._state["camera_world"][0, index], eye=eye)
        sensor = self._sensor(camera, view)
        moment = (index, int(self._state["tick"][0]))
        passes = wishes.passes | {"rgb", "depth"} if wishes.cloud else wishes.passes
        clouds = self._clouds.shown(self._state["body_pose"][0])
        passes = passes | {"depth"} if clouds else passes
        drawn = self._renderer.render(self._state, sensor.view(view), sorted(passes), camera.preprocessing_shaders)
        drawn = with_clouds(drawn, clouds, sensor.view(view)) if clouds else drawn
        frame = sensor.expose(drawn, view, moment)
        if wishes.passes:
            exposure.topics.publish_picture(Picture(frame.rgb, frame.depth, frame.ids), stamp)
        if wishes.cloud:
            points = self._points(camera, frame.depth, view)
            if camera.depth_noise is not None:
                mean, deviation, bias = camera.depth_noise
                random = np.random.default_rng((sensor.seed, *moment))
                grain = random.standard_normal(frame.depth.shape, dtype=np.float32)
                points[..., 2] -= np.float32(mean + bias) + np.float32(deviation) * grain
            exposure.topics.publish_cloud(points, frame.rgb, stamp)

    def _sensor(self, camera: Camera, view: CameraView) -> ImageSensor:
        """The sensor of a camera by its parameters; one without faults, with one warning, when they are invalid."""
        values = self._follower.sensors[camera.index]
        wrong = f"{camera.identity.topic}: {values}"
        if wrong in self._rejected:
            return IDEAL
        try:
            sensor = ImageSensor(**values)
            sensor.view(view)
        except ValueError as error:
            report("warning", f"{camera.identity.topic}/sensor: {error}; rendering without sensor faults")
            self._rejected.add(wrong)
            return IDEAL
        return sensor

    def _points(self, camera: Camera, depth: np.ndarray, view: CameraView) -> np.ndarray:
        """Points (h, w, 3) in the optical frame, by the camera's own ``depth compute shaders`` where it has some."""
        if camera.depth_shaders is not None:
            own = self._renderer.points(depth, view, camera.depth_shaders)
            if own is not None:
                return own[..., [1, 2, 0]] * np.array([1, -1, -1], dtype=np.float32)  # from the camera frame
        return unproject(depth, view)

    def _camera(self, index: int) -> Camera:
        """A camera as its parameters have it now; eyes exist from the start or not at all."""
        camera = self._follower.cameras[index]
        started = self._scene.cameras[index]
        return camera if (camera.stereo is None) == (started.stereo is None) else started

    def _set_lights(self) -> None:
        """Set the lights to their parameters' values of now."""
        settings = self._renderer.lights.settings
        for index in range(len(settings)):
            values = self._follower.lights[index]
            settings[index] = replace(
                settings[index], kind=LightKind(values.type), cutoff=values.cutoff, attenuation=values.attenuation
            )

    def _count(self, drawn: int, missed: int, seconds: float) -> None:
        figures = self._block.figures
        figures["frames"] += np.uint64(drawn)
        figures["frames_dropped"] += np.uint64(missed)
        if drawn:
            figures["frame_seconds"] = seconds
