"""Reads the mesh files that a model had, as far as its export needs them; nothing of Blender."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

from .ligature.adf import AdfError, Resolver
from .mesh_source import HIGH, LOW, NEW_FOLDERS, MeshSource

LIBRARY_WITHIN = 65536
"""Bytes of an OBJ file in which its material libraries are named."""

_LIBRARY = re.compile(rb"(?:\A|[\r\n])mtllib[ \t]+([^\r\n]+)")
_BREAK = re.compile(rb"(\r\n|[\r\n])")


class OldMeshes:
    """The mesh files of a model that was at ``before``, None for a new one, and is to go to ``path``.

    Attributes
    ----------
    folder, moves
        Where the model was, and whether it goes to another folder: then its meshes are copied.
    given
        The folders of meshes that the model names.
    files
        By folder key and object: where its mesh is, if that is there and may be opened.
    contents
        Each of these files with its material libraries and textures, for a model that moves: bytes by path from its
        folder.
    """

    def __init__(
        self, sources: list[MeshSource], top: dict, path: Path, before: Path | None, resolver: Resolver
    ) -> None:
        self.folder = (before or path).parent.resolve()
        self.moves = self.folder != path.parent.resolve()
        self.given = {key: top.get(key, NEW_FOLDERS[key] if before is None else "") for key in (HIGH, LOW)}
        self.files: dict[tuple[str, str], Path] = {}
        self.contents: dict[Path, dict[str, bytes]] = {}
        self._resolver = resolver
        self._known: dict[Path, bytes | None] = {}
        for source in sources:
            for key in (HIGH, LOW) if self.moves else (LOW,) if source.changed else ():
                own, name = source.places[key]
                file = joined(self.folder, self.given[key], own, name)
                if name and self._read(file) is not None:
                    self.files[key, source.key] = file
                    if self.moves and file not in self.contents:
                        self.contents[file] = dict(self._with_companions(file))

    def _read(self, path: Path) -> bytes | None:
        """The content of a file that may be opened; None for any other."""
        if path not in self._known:
            try:
                self._known[path] = self._resolver.read_bytes(path) if self._resolver.exists(path) else None
            except (AdfError, OSError):
                self._known[path] = None
        return self._known[path]

    def _with_companions(self, path: Path) -> Iterator[tuple[str, bytes]]:
        """A mesh file, its material libraries and the textures that these name.

        Textures that lie elsewhere come beside the mesh, and the library names them there.
        """
        data = self._read(path) or b""
        yield path.name, data
        libraries = [match.decode("utf-8", "replace").strip() for match in _LIBRARY.findall(data[:LIBRARY_WITHIN])]
        for library in dict.fromkeys([*libraries, path.with_suffix(".mtl").name, path.with_suffix(".MTL").name]):
            text = self._read(path.parent / library) if _stays(library) else None
            if text is None:
                continue
            pieces = _BREAK.split(text)
            for number, line in enumerate(pieces):
                words = line.decode("utf-8", "replace").split(None, 1)
                if len(words) < 2 or not words[0].startswith("map_"):
                    continue
                name = words[1].strip()
                content = self._read(joined(path.parent, os.path.dirname(library), name))
                if content is None:
                    continue
                if not _stays(name):
                    name = os.path.basename(name)
                    pieces[number] = f"{words[0]} {name}".encode()
                yield os.path.join(os.path.dirname(library), name), content
            yield library, b"".join(pieces)


def joined(folder: Path, *parts: str) -> Path:
    """Parts joined as the format joins them."""
    return Path(os.path.normpath(os.path.join(folder, *parts)))


def _stays(name: str) -> bool:
    """Whether a path stays below the folder that it is read from."""
    return not os.path.isabs(name) and not os.path.normpath(name).startswith("..")
