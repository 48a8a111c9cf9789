"""``ligature convert``: a URDF or MJCF robot as an ADF model with its meshes."""

from __future__ import annotations

import re
from pathlib import Path

from rich.console import Console

from ligature.adf.patch import PatchError
from ligature.adf.update import new_text
from ligature.authoring.conversion import Converted
from ligature.authoring.mjcf import from_mjcf
from ligature.authoring.objfile import MeshWriteError, Paint, Surface, obj_texts
from ligature.authoring.save import SaveError, checked_text, save_all
from ligature.authoring.urdf import from_urdf
from ligature.authoring.xml_files import XmlError, check_xml
from ligature.paths import real_path


def convert(source: Path, out: Path, namespace: str, console: Console) -> int:
    """Write the model and its meshes; returns the exit status."""
    if source.suffix.lower() not in (".urdf", ".xml"):
        console.print(f"{source}: only URDF (.urdf) and MJCF (.xml) are converted", style="red", markup=False)
        return 1
    if not source.is_file():
        console.print(f"{source}: file not found", style="red", markup=False)
        return 1
    try:
        check_xml(source)
        converted = _mjcf(source) if _is_mjcf(source) else _urdf(source)
        written = save_all(_files(converted, real_path(out), namespace))
    except (SaveError, PatchError, MeshWriteError, MissingReaderError, XmlError) as error:
        console.print(str(error), style="red", markup=False)
        return 1
    except Exception as error:  # what a library raises for bad files is its own affair
        kind = "an MJCF" if _is_mjcf(source) else "a URDF"
        console.print(f"{source}: this is not {kind} that can be read: {error}", style="red", markup=False)
        return 1
    for note in converted.notes:
        console.print(f"note: {note}", style="yellow", markup=False)
    kinds = [item.kind for item in converted.parts.items]
    console.print(
        f"{out}: {kinds.count('body')} bodies, {kinds.count('joint')} joints, {len(written)} files", markup=False
    )
    return 0


class MissingReaderError(Exception):
    """A package that reads the format is not installed; the message names the command that installs it."""


def _is_mjcf(source: Path) -> bool:
    """Whether the file's root element, which comes before all others, is that of MJCF."""
    try:
        text = source.read_text("utf-8", errors="replace")
    except OSError:
        return False
    found = re.search(r"<([A-Za-z]\w*)", re.sub(r"<!--.*?-->|<\?.*?\?>", "", text, flags=re.DOTALL))
    return found is not None and found[1] in ("mujoco", "mujocoinclude")


def _urdf(source: Path) -> Converted:
    import yourdfpy

    # meshes are read by our own reader, so that the file's paths mean what its folder makes of them
    robot = yourdfpy.URDF.load(str(source), build_scene_graph=False, load_meshes=False).robot
    return from_urdf(robot, real_path(source).parent)


def _mjcf(source: Path) -> Converted:
    try:
        import mujoco
    except ImportError as error:
        raise MissingReaderError(
            f"{source}: reading MJCF needs MuJoCo, which is not installed; run: pip install 'ligature-sim[convert]'"
        ) from error
    return from_mjcf(mujoco.MjModel.from_xml_path(str(source)))


def _files(converted: Converted, out: Path, namespace: str) -> dict[Path, bytes]:
    files: dict[Path, bytes] = {}
    for name, mesh in converted.parts.meshes.items():
        target = out.parent / ("low_res" if name.endswith("_collision.OBJ") else "high_res") / name
        surfaces = [
            Surface(
                Paint(part.name, diffuse=part.material.diffuse if part.material else (0.8, 0.8, 0.8)),
                part.vertices,
                part.faces,
            )
            for part in mesh.parts
        ]
        library = target.with_suffix(".mtl")
        obj, mtl = obj_texts(surfaces, library.name, name)
        files |= {target: obj.encode(), library: mtl.encode()}
    top = {
        **converted.top,
        "namespace": namespace,
        "high resolution path": "./high_res/",
        "low resolution path": "./low_res/",
    }
    files[out] = checked_text(new_text("model", top, converted.parts.items), out)
    return files
