"""Loads a mesh file by its extension, through the scene's resolver."""

from __future__ import annotations

from pathlib import Path

from ligature.adf.contents import content_of
from ligature.adf.resolver import Resolver
from ligature.mesh.mesh import Mesh, MeshError, failure
from ligature.mesh.obj import read_obj
from ligature.mesh.stl import read_stl
from ligature.mesh.tds import read_3ds

_KINDS = {".obj": "an OBJ mesh", ".stl": "an STL mesh", ".3ds": "a 3DS mesh"}
EXTENSIONS = tuple(_KINDS)


def load_mesh(path: Path, resolver: Resolver) -> Mesh:
    """The mesh of ``path``, opened by ``resolver``.

    Raises `MeshError`, or `ResolutionError` when it may not be opened.
    """
    extension, data = path.suffix.lower(), resolver.read_bytes(path)
    if extension not in EXTENSIONS:
        raise _unsupported(path, data)
    try:
        return _read(data, path, extension, resolver)
    except MeshError:
        content = content_of(data)
        if content is None or content[0] == _KINDS[extension]:
            raise
        message = f"'{path.name}' is {content[0]}, not {_KINDS[extension]}"
        raise failure(path, message, hint=content[1]) from None


def _unsupported(path: Path, data: bytes) -> MeshError:
    """The error for a file whose name ends otherwise."""
    use = f"use {', '.join(EXTENSIONS)}"
    content = content_of(data)
    if content is None:
        return failure(path, f"the mesh format of '{path.name}' is not supported", hint=use)
    what, remedy = content
    ending = next((extension for extension, kind in _KINDS.items() if kind == what), "")
    if ending:
        return failure(
            path, f"'{path.name}' is {what}, but not named as one", hint=f"rename it to '{path.stem}{ending}'"
        )
    return failure(path, f"'{path.name}' is {what}, whose format is not supported", hint=f"{use}: {remedy}")


def _read(data: bytes, path: Path, extension: str, resolver: Resolver) -> Mesh:
    if extension == ".obj":
        return read_obj(data, path, resolver)
    if extension == ".stl":
        return read_stl(data, path)
    return read_3ds(data, path, resolver)
