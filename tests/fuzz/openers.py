"""Every place of Ligature that opens a file for reading, found in its source, and what fuzzes it.

A place is a module and a function. Those that read what strangers write name campaigns of `tests.fuzz.run`: kinds of
`tests.fuzz.readers.READERS`, or ends of the names of scene files in `tests.fuzz.seeds`. The others read what Ligature
itself wrote or ships, or what runs as a program by the wish of its user.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2] / "simulator" / "ligature"

CALLS = frozenset({
    "read_bytes", "read_text", "Bag", "InferenceSession", "from_xml_path", "from_xml_string", "fromstring", "memmap",
    "fromfile", "loadtxt", "genfromtxt", "read_table", "imread", "exec_module", "fdopen", "FileIO", "open_file",
})  # fmt: skip
"""Functions and methods that read files, whoever has them."""

QUALIFIED = frozenset({
    "open", "os.open", "io.open", "h5py.File", "Image.open", "np.load", "av.open", "mmap.mmap", "yaml.parse", "yaml.safe_load",
    "json.load", "OpenEXR.File", "tarfile.open", "zipfile.ZipFile", "gzip.open", "wave.open",
})  # fmt: skip
"""The same by their whole names, where the last part means something else elsewhere."""

STRANGERS: dict[str, tuple[str, ...]] = {
    "adf/contents.py:mistaken": ("bag", "dataset"),
    "adf/nodes.py:_Composer.__init__": (".yaml",),
    "adf/reader.py:_opened": (".yaml",),
    "adf/reader.py:_content": (".yaml",),
    "adf/resolver.py:Resolver.read_bytes": (".yaml", ".obj", ".stl", ".3ds", ".mtl"),
    "adf/resolver.py:Resolver.read_text": (".yaml",),
    "adf/resolver.py:_named_files": (".yaml",),
    "authoring/robot/description.py:root_of": ("URDF", "SDF"),
    "authoring/xml_files.py:check_xml": ("URDF", "SDF", "MJCF"),
    "bus/record.py:Record.read": ("record", "sealed record"),
    "bus/record.py:is_record": ("record", "bag"),
    "cli/convert.py:_is_mjcf": ("URDF", "MJCF"),
    "cli/convert.py:_mjcf": ("MJCF",),
    "datasets/store.py:opened": ("dataset", "rebuilt dataset"),
    "environments/policies.py:_network": ("network",),
    "environments/randomisation.py:_read": ("ranges",),
    "environments/randomisation.py:_check_flat": ("ranges",),
    "mesh/load.py:load_mesh": (".obj", ".stl", ".3ds"),
    "mesh/obj.py:_Reader._read_library": (".mtl",),
    "model/pictures.py:read_picture": ("PNG", "JPEG", "BMP", "TGA", "TIFF", "GIF", "PPM", "WEBP"),
    "ros/bags.py:opened": ("bag", "packed bag"),
    "teleop/config.py:text_of": ("teleoperation", "input devices"),
    "teleop/record.py:_rows": ("recorded input",),
}
"""Places that read files of strangers, and what fuzzes them."""

OURS: dict[str, str] = {
    "paths.py:open_file": "opens for all that name it, which are places themselves",
    "cli/command.py:_open_streams": "opens streams of the null device in place of closed ones",
    "cli/command.py:open_null": "opens the null device",
    "cli/check.py:_shaders": "shaders, which are only tried for whether they can be read",
    "authoring/lint/files.py:material_dialect": "reads by a resolver what `mesh.obj` has read",
    "authoring/lint/files.py:file_unreferenced": "looks for names in scene files, by a resolver",
    "authoring/lint/files.py:_same_bytes": "compares bytes, by a resolver",
    "authoring/save.py:_content": "compares bytes with those to be written",
    "blas.py:_has_avx2": "what Linux says of the processor",
    "blas.py:loaded": "what Linux says of the process",
    "bus/block.py:Block.__init__": "shared memory of the run",
    "cache.py:write_atomically": "writes",
    "cockpit/assets.py:asset": "files of the page",
    "cockpit/assets.py:_page": "files of the page",
    "datasets/lerobot/video.py:encode": "writes",
    "datasets/probe.py:_answer": "a pipe",
    "datasets/probe.py:probe": "a pipe",
    "datasets/store.py:PartFile.__init__": "writes",
    "datasets/store.py:_sync_folder": "a folder",
    "environments/policies.py:_module": "a program of the user's",
    "kernel_cache.py:KernelCache._take_turn": "a lock in the cache",
    "kernel_cache.py:_source": "sources of Ligature",
    "mesh/cache.py:_kept": "the cache",
    "mesh/coacd_process.py:main": "the cache",
    "mesh/decompose.py:_cached_hulls": "the cache",
    "mesh/decompose.py:_stored_hulls": "the cache",
    "mesh/decompose.py:_solid_hulls": "the cache",
    "mesh/hulls.py:_stored": "the cache",
    "physics/bullet.py:_segments": "memory of the process",
    "physics/bullet.py:_word": "memory of the process",
    "physics/quiet.py:import_quietly": "/dev/null",
    "plugins/loading.py:_module": "a program that the user allows",
    "process.py:lower_priority": "/proc",
    "render/files.py:_write_exr": "writes",
    "render/legacy.py:_text": "shaders, which run on the graphics card as they are",
    "render/programs.py:source": "shaders of Ligature",
    "teleop/devices/keyboard.py:Adapter.__init__": "a terminal",
    "teleop/devices/mouse.py:Adapter.__init__": "a terminal",
}
"""Places that read nothing of strangers, or nothing that has a form; and why."""


NAMED = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)


def places() -> set[str]:
    """All places of the source that open a file for reading: ``module:function``."""
    return {place for path in SOURCE.rglob("*.py") for place in _places(path)}


def _places(path: Path) -> Iterator[str]:
    def walk(node: ast.AST, names: tuple[str, ...]) -> Iterator[str]:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.Call) and _reads(child):
                yield f"{path.relative_to(SOURCE).as_posix()}:{'.'.join(names)}"
            yield from walk(child, (*names, child.name) if isinstance(child, NAMED) else names)

    return walk(ast.parse(path.read_text("utf-8")), ())


def _reads(call: ast.Call) -> bool:
    """Whether a call opens a file, and not for writing alone."""
    name = ast.unparse(call.func)
    last = name.rpartition(".")[2]
    if last == "open" and name not in QUALIFIED:
        return bool(call.args) and isinstance(call.args[0], ast.Constant) and "r" in str(call.args[0].value)
    return last in CALLS or name in QUALIFIED
