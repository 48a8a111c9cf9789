"""``ligature convert``: a URDF, SDF or MJCF robot as an ADF model with its meshes, and a model as URDF or SDF."""

from __future__ import annotations

import re
from pathlib import Path

from rich.console import Console

from ligature.adf import AdfError, Resolver, read_any
from ligature.adf.patch import PatchError
from ligature.adf.update import new_text
from ligature.authoring.conversion import COLLIDING, Converted
from ligature.authoring.mjcf import from_mjcf
from ligature.authoring.objfile import MeshWriteError, Paint, Surface, obj_texts
from ligature.authoring.robot import exported, read_sdf, read_urdf, sdf_text, to_adf, urdf_text
from ligature.authoring.save import SaveError, checked_text, refuse_input, save_all
from ligature.authoring.xml_files import XmlError, check_xml
from ligature.cli.numbers import counted
from ligature.paths import real_path, reason
from ligature.process import signals_held

MODELS = (".yaml", ".yml", ".ambf")
READ = (".urdf", ".sdf", ".world", ".xml", *MODELS)
WRITTEN = {".urdf": urdf_text, ".sdf": sdf_text}


def convert(source: Path, out: Path, namespace: str, console: Console) -> int:
    """Write the model and its meshes; returns the exit status."""
    kind = source.suffix.lower()
    if kind not in READ:
        console.print(
            f"{source}: only URDF (.urdf), SDF (.sdf, .world), MJCF (.xml) and ADF models (.yaml) are converted",
            style="red", markup=False,
        )  # fmt: skip
        return 1
    if not source.is_file():
        console.print(f"{source}: file not found", style="red", markup=False)
        return 1
    if kind in MODELS:
        return _export(source, out, console)
    try:
        check_xml(source)
        converted = _robot(source)
        with signals_held():
            refuse_input(out, source)
            written = save_all(_files(converted, real_path(out), namespace), [real_path(out).parent])
    except (SaveError, PatchError, MeshWriteError) as error:
        console.print(f"{source}: it cannot be written as ADF: {error}", style="red", markup=False)
        return 1
    except (MissingReaderError, XmlError) as error:
        console.print(str(error), style="red", markup=False)
        return 1
    except OSError as error:
        console.print(f"{source}: {reason(error)}", style="red", markup=False)
        return 1
    except Exception as error:  # what a library raises for bad files is its own affair
        name = "an MJCF" if _is_mjcf(source) else "a URDF" if kind != ".sdf" else "an SDF"
        console.print(f"{source}: this is not {name} that can be read: {error}", style="red", markup=False)
        return 1
    for note in converted.notes:
        console.print(f"note: {note}", style="yellow", markup=False)
    kinds = [item.kind for item in converted.parts.items]
    console.print(
        f"{out}: {counted(kinds.count('body'), 'body', 'bodies')}, {counted(kinds.count('joint'), 'joint')}, "
        f"{counted(len(written), 'file')}",
        markup=False,
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


def _robot(source: Path) -> Converted:
    """A robot in whichever of the three formats it is."""
    if _is_mjcf(source):
        return _mjcf(source)
    robot = read_urdf(source) if source.suffix.lower() in (".urdf", ".xml") else read_sdf(source)
    return to_adf(robot, real_path(source).parent)


def _export(source: Path, out: Path, console: Console) -> int:
    """Write a model as URDF or SDF with its meshes; returns the exit status."""
    if out.suffix.lower() not in WRITTEN:
        console.print(
            f"{out}: unknown format; the name of the output must end in .urdf or .sdf", style="red", markup=False
        )
        return 1
    try:
        resolver = Resolver.for_file(source)
        document = read_any(source, resolver)
        if document.kind != "model":
            console.print(f"{source}: this is a {document.kind} file; give a model", style="red", markup=False)
            return 1
        refuse_input(out, source)
        done = exported(document, resolver, out.stem)
        text, notes = WRITTEN[out.suffix.lower()](done.robot)
        folder = real_path(out).parent
        with signals_held():
            files = {folder / name: data for name, data in done.files.items()}
            written = save_all({**files, real_path(out): text.encode()}, [folder])
    except (AdfError, SaveError) as error:
        console.print(str(error), style="red", markup=False)
        return 1
    for note in (*done.notes, *notes):
        console.print(f"note: {note}", style="yellow", markup=False)
    links, joints = len(done.robot.links), len(done.robot.joints)
    console.print(
        f"{out}: {counted(links, 'link')}, {counted(joints, 'joint')}, {counted(len(written), 'file')}", markup=False
    )
    return 0


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
        target = out.parent / ("low_res" if name.endswith(COLLIDING) else "high_res") / name
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
