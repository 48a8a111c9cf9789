"""``ligature render``: one moment of a scene as a camera sees it, written as pictures and arrays."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image
from rich.console import Console

import ligature
from ligature.model.lookup import find_by_text
from ligature.render import Renderer, RenderUnavailable, view_of


def render(
    launch: Path,
    models: tuple[int, ...] | None,
    roots: Sequence[Path],
    camera: str,
    out: Path,
    seconds: float,
    resolution: tuple[int, int] | None,
    console: Console,
) -> int:
    """Write colour as PNG, depth and ids as NPY below ``out``; returns the exit status."""
    try:
        scene = ligature.load(launch, models, roots=roots)
        index = find_by_text([c.identity.topic for c in scene.cameras], camera)
        if index is None:
            names = ", ".join(c.identity.topic for c in scene.cameras) or "none"
            console.print(
                f"no camera is called '{camera}', or several are; there are: {names}", style="red", markup=False
            )
            return 1
        simulation = ligature.Simulation(scene)
        simulation.step(max(1, round(seconds / simulation.dt)))
        renderer = Renderer(scene)
        frame = renderer.render(
            simulation.state, view_of(scene.cameras[index], simulation.state["camera_world"][0, index], resolution)
        )
        out.mkdir(parents=True, exist_ok=True)
        name = scene.cameras[index].identity.name
        Image.fromarray(frame.rgb).save(out / f"{name}.png")
        np.save(out / f"{name}_depth.npy", frame.depth)
        np.save(out / f"{name}_ids.npy", frame.ids)
    except ligature.SceneError as error:
        for diagnostic in error.diagnostics:
            console.print(str(diagnostic), style="red", markup=False)
        return 2
    except (RenderUnavailable, OSError) as error:
        console.print(str(error), style="red", markup=False)
        return 1
    for problem in renderer.problems:
        console.print(str(problem.diagnostics[0]), style="yellow", markup=False)
    console.print(f"{out / name}.png, {name}_depth.npy (metres), {name}_ids.npy (1 + body index)", markup=False)
    return 0
