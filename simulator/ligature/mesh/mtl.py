"""Reads Wavefront MTL files: the materials of an OBJ file, colours in 0..1."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from pathlib import Path

from ligature.adf.diagnostics import Severity
from ligature.adf.resolver import Resolver
from ligature.mesh.mesh import LOOK, MAX_PARTS, Findings, Material, Triple, failure
from ligature.mesh.texture import texture_file

_COLOURS = ("Ka", "Kd", "Ks", "Ke")
_SCALARS = ("Ns", "d", "Tr", "Pr", "Pm", "Pc", "Pcr")
"""The reference honours the first three; the rest are roughness, metallic, clear coat and its roughness, as Blender
and others write them for physically based rendering."""

_TEXTURES = ("map_Kd", "map_Bump", "map_Pr", "map_Pm", "map_ao", "refl")
"""The last two are what shades from ambient light, and the sphere that a surface mirrors, which shaders call matcap."""

_LINE_END = re.compile("\r\n|\r|\n")

_OPTIONS = {
    "-blendu": 1, "-blendv": 1, "-bm": 1, "-boost": 1, "-cc": 1, "-clamp": 1, "-imfchan": 1, "-mm": 2,
    "-o": 3, "-s": 3, "-t": 3, "-texres": 1, "-type": 1,
}  # fmt: skip
"""Options that may stand before a texture's file name, with the number of their values."""


@dataclass
class _Draft:
    """A material while its lines are read: the values of each keyword."""

    name: str
    colours: dict[str, Triple] = field(default_factory=dict)
    scalars: dict[str, float] = field(default_factory=dict)
    textures: dict[str, Path] = field(default_factory=dict)

    def material(self) -> Material:
        """The material; the reference lights ambient with Ka times Kd and takes ``Tr`` for ``d``.

        Exporters that write both mean 1 - d by ``Tr``, so that ``d`` is right whatever ``Tr`` means.
        """
        plain = Material(self.name)
        kd = self.colours.get("Kd", plain.diffuse)
        ka = self.colours.get("Ka")
        return Material(
            self.name,
            ambient=plain.ambient if ka is None else (ka[0] * kd[0], ka[1] * kd[1], ka[2] * kd[2]),
            diffuse=kd,
            specular=self.colours.get("Ks", plain.specular),
            shininess=self.scalars.get("Ns", plain.shininess),
            alpha=min(self.scalars.get("d", self.scalars.get("Tr", plain.alpha)), 1.0),
            texture=self.textures.get("map_Kd"),
            normal_map=self.textures.get("map_Bump"),
            emission=self.colours.get("Ke", plain.emission),
            roughness=self.scalars.get("Pr"),
            metallic=self.scalars.get("Pm"),
            coat=self.scalars.get("Pc"),
            coat_roughness=self.scalars.get("Pcr", plain.coat_roughness),
            roughness_map=self.textures.get("map_Pr"),
            metallic_map=self.textures.get("map_Pm"),
            occlusion_map=self.textures.get("map_ao"),
            sphere_map=self.textures.get("refl"),
        )


def read_mtl(text: str, path: Path, folder: Path, resolver: Resolver, findings: Findings) -> list[Material]:
    """The materials of an MTL file, in order; lines that cannot be read have no effect but a finding.

    Parameters
    ----------
    text, path
        Content of the file and where it is.
    folder
        Folder of the OBJ file, next to which textures are looked up.
    resolver
        Decides which textures may be opened.
    findings
        Takes what has no effect.
    """
    drafts: list[_Draft] = []
    for number, line in enumerate(_LINE_END.split(text), 1):
        words = line.split(None, 1)
        if not words or words[0].startswith("#"):
            continue
        word, rest = words[0], words[1].strip() if len(words) > 1 else ""
        if word == "newmtl":
            drafts.append(_Draft(rest))
            if len(drafts) > MAX_PARTS:
                raise failure(path, f"the library has more than {MAX_PARTS} materials", number, "join alike ones")
        elif not drafts:
            findings.add(path, f"'{word[:40]}' comes before the first newmtl and has no effect", number)
        elif word in _TEXTURES:
            name = _without_options(rest)
            found = texture_file(name, path, number, folder, resolver, findings) if name else None
            if found is not None:
                drafts[-1].textures[word] = found
        else:
            _value(drafts[-1], word, rest, path, number, findings)
    return [draft.material() for draft in drafts]


def _value(draft: _Draft, word: str, rest: str, path: Path, number: int, findings: Findings) -> None:
    count = 3 if word in _COLOURS else 1 if word in _SCALARS else 0
    if not count:
        hint = f"{', '.join((*_COLOURS, *_SCALARS, *_TEXTURES))} are honoured"
        findings.add(path, f"'{word[:40]}' has no effect", number, hint, Severity.DEBUG, LOOK)
        return
    try:
        values = [float(value) for value in rest.split()[:count]]
    except ValueError:
        values = []
    if len(values) < count or not all(map(math.isfinite, values)):
        hint = f"{count} finite numbers were expected"
        findings.add(path, f"'{word} {rest[:40]}' has no effect", number, hint, code=LOOK)
    elif count == 3:
        draft.colours[word] = (_unit(values[0]), _unit(values[1]), _unit(values[2]))
    else:
        draft.scalars[word] = max(values[0], 0.0)


def _unit(value: float) -> float:
    return min(max(value, 0.0), 1.0)


def _without_options(rest: str) -> str:
    """The file name, which may hold blanks, after options such as ``-bm 0.5``."""
    words = rest.split(" ")
    while words and words[0] in _OPTIONS:
        words = words[1 + _OPTIONS[words[0]] :]
    return " ".join(words).strip()
