"""``ligature render``: one moment of a scene as a camera sees it, written as pictures, arrays and annotations."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

import ligature
from ligature.paths import as_file_name, check_folder
from ligature.render import Frame, ImageSensor, RenderUnavailable
from ligature.render.annotations import coco, mask_image
from ligature.render.files import write_calibration, write_frame, write_json, write_png
from ligature.render.target import saturated_share

ANNOTATIONS = ("coco", "mask")
MAX_SATURATED = 0.5
"""Share of saturated pixels above which a picture is overexposed."""

PASSES = ("rgb", "depth", "ids", "normals")


def render(
    launch: Path,
    models: tuple[int, ...] | None,
    roots: Sequence[Path],
    camera: str,
    out: Path,
    seconds: float,
    resolution: tuple[int, int],
    format: str,
    annotations: Sequence[str],
    sensor: ImageSensor,
    console: Console,
) -> int:
    """Write what ``camera`` sees after ``seconds`` below ``out``; returns the exit status.

    A 0 in ``resolution`` is the camera's own width or height.
    """
    try:
        scene = ligature.load(launch, models, roots=roots)
        simulation = ligature.Simulation(scene)
        handle = simulation.cameras[camera]
        check_folder(out)
        own = handle.camera.resolution
        size = resolution[0] or own[0], resolution[1] or own[1]
        simulation.step(max(1, round(seconds / simulation.dt)))
        frame = handle.capture(size, passes=PASSES, sensor=sensor)
        name = as_file_name(handle.camera.identity.name)
        files = write_frame(frame, out, name, format)
        calibration = handle.calibration(size, sensor=sensor)
        files.append(write_calibration(calibration, handle.pose, out / f"{name}_camera.json"))
        files += [_annotate(kind, frame, scene.drawn_names, out, name) for kind in annotations]
    except ligature.SceneError as error:
        for diagnostic in error.diagnostics:
            console.print(str(diagnostic), style="red", markup=False)
        return 2
    except (KeyError, ValueError, RenderUnavailable) as error:
        console.print(str(error), style="red", markup=False)
        return 1
    white = saturated_share(frame.rgb)
    if white > MAX_SATURATED:
        text = f"{white:.0%} of the picture of {name} is saturated (white)"
        hint = "lower --exposure, give the lights an attenuation, or correct the shaders of the scene"
        console.print(f"{text}; {hint}", style="yellow", markup=False)
    for problem in handle.problems:
        console.print(str(problem.diagnostics[0]), style="yellow", markup=False)
    console.print("\n".join(str(path) for path in files), markup=False)
    return 0


def _annotate(kind: str, frame: Frame, names: dict[int, str], out: Path, name: str) -> Path:
    if kind == "mask":
        table = {str(number): names[number] for number in sorted(set(frame.ids[frame.ids > 0].tolist()))}
        write_json(table, out / f"{name}_mask.json")
        return write_png(mask_image(frame.ids), out / f"{name}_mask.png")
    return write_json(coco(frame.ids, names, f"{name}.png"), out / f"{name}_coco.json")
