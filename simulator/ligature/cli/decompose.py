"""``ligature decompose``: a concave mesh as convex parts for ADF."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console

from ligature.adf import AdfError, Resolver
from ligature.authoring.save import SaveError, refuse_input, save_all
from ligature.cli.numbers import counted
from ligature.mesh import load_mesh
from ligature.mesh.decompose import decompose as cut
from ligature.mesh.decompose import obj_text
from ligature.paths import real_path
from ligature.process import signals_held


def decompose(mesh: Path, out: Path | None, threshold: float, max_hulls: int, console: Console) -> int:
    """Write ``out`` (default: beside the mesh) and its MTL; returns the exit status."""
    target = out or mesh.with_name(f"{mesh.stem}_collision.obj")
    library = target.parent / f"{target.stem}.mtl"
    try:
        refuse_input(target, mesh)
        result = cut(load_mesh(real_path(mesh), Resolver([real_path(mesh).parent])), threshold, max_hulls)
        text, materials = obj_text(result.hulls, library.name)
        with signals_held():
            save_all({real_path(library): materials.encode(), real_path(target): text.encode()})
    except SaveError as error:
        console.print(str(error), style="red", markup=False)
        return 1
    except AdfError as error:
        console.print(str(error.diagnostics[0]), style="red", markup=False)
        return 1
    except ValueError as error:
        console.print(f"{mesh}: {error}", style="red", markup=False)
        return 1
    share = result.volume_error
    volume = "volume unknown (the mesh is not closed)" if share is None else f"volume error {100 * share:.2f} %"
    console.print(
        f"{target}: {counted(len(result.hulls), 'hull')}, {volume}, Hausdorff distance {1e3 * result.distance:.3f} mm",
        markup=False,
    )
    console.print("use it with 'collision mesh' and 'collision mesh type: CONVEX_HULL'", style="dim")
    return 0
