"""``ligature convert``: a URDF robot as an ADF model with its meshes."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console

from ligature.adf.patch import PatchError
from ligature.adf.update import new_text
from ligature.authoring.objfile import MeshWriteError, Paint, Surface, obj_texts
from ligature.authoring.save import SaveError, checked_text, save_all
from ligature.authoring.urdf import Converted, from_urdf


def convert(source: Path, out: Path, namespace: str, console: Console) -> int:
    """Write the model and its meshes; returns the exit status."""
    if source.suffix.lower() not in (".urdf", ".xml"):
        console.print(f"{source}: only URDF is converted", style="red", markup=False)
        return 1
    try:
        import yourdfpy

        # meshes are read by our own reader, so that the file's paths mean what its folder makes of them
        robot = yourdfpy.URDF.load(str(source), build_scene_graph=False, load_meshes=False).robot
        converted = from_urdf(robot, source.resolve().parent)
        written = save_all(_files(converted, out.resolve(), namespace))
    except (SaveError, PatchError, MeshWriteError) as error:
        console.print(str(error), style="red", markup=False)
        return 1
    except Exception as error:  # what an XML library raises for bad files is its own affair
        console.print(f"{source}: this is not a URDF that can be read: {error}", style="red", markup=False)
        return 1
    for note in converted.notes:
        console.print(f"note: {note}", style="yellow", markup=False)
    kinds = [item.kind for item in converted.parts.items]
    console.print(
        f"{out}: {kinds.count('body')} bodies, {kinds.count('joint')} joints, {len(written)} files", markup=False
    )
    return 0


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
    top = {"namespace": namespace, "high resolution path": "./high_res/", "low resolution path": "./low_res/"}
    files[out] = checked_text(new_text("model", top, converted.parts.items), out)
    return files
