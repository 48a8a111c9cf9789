"""Shader programs of scene files: compiled after translation, fed with the state that OpenGL 2 kept for them.

Lights, planes and matrices are in eye space, metres, as the fixed-function state was.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from ligature.adf import AdfError, Diagnostic, Mark, Resolver, Severity
from ligature.model.shapes import Colour, ShaderFiles
from ligature.render.geometry import Triangles
from ligature.render.lights import LIGHT_AMBIENT, LIGHT_MODEL_AMBIENT, LightKind, Lights, LightSettings
from ligature.render.programs import Program
from ligature.render.surface import Surface
from ligature.render.textures import Textures
from ligature.render.translate import MAX_CLIP_PLANES, MAX_COORDS, MAX_LIGHTS, PREFIX, translate

Array = NDArray[np.float64]

MAX_SHADER_BYTES = 1 << 20

_MESA = re.compile(r"^\d+:(\d+)\((\d+)\): (?:preprocessor )?error: (.*)$", re.MULTILINE)
_NVIDIA = re.compile(r"^\d+\((\d+)\) : (error .*)$", re.MULTILINE)
_OTHERS = re.compile(r"^ERROR: \d+:(\d+): (.*)$", re.MULTILINE)
_LINKER = "GLSL Linker failed"
"""How moderngl begins the log of a program whose stages compile and do not fit together."""

_ATTRIBUTES = {
    "aPosition": "positions", f"{PREFIX}Vertex": "positions",
    "aNormal": "normals", f"{PREFIX}Normal": "normals",
    "aTexCoord": "uvs", **{f"{PREFIX}MultiTexCoord{i}": "uvs" for i in range(8)},
    "aColor": "colours", f"{PREFIX}Color": "colours", f"{PREFIX}SecondaryColor": "secondary",
    "aTangent": "tangents", "aBitangent": "bitangents",
}  # fmt: skip
"""What feeds each attribute that authors use."""

_UNITS = {"diffuseMap": 0, "albedoMap": 0, "normalMap": 1, "metallicMap": 2, "roughnessMap": 3, "aoMap": 4,
          "uMatcapMap": 5, "shadowMap": 8, "skybox": 9, "uVolume": 10}  # fmt: skip
"""Texture unit of each sampler that authors use."""

DIFFUSE_UNIT, _FIRST_FREE_UNIT = _UNITS["diffuseMap"], 11


class ShaderError(AdfError):
    """Shaders of a scene file that cannot be used; ``diagnostics`` give places and reasons."""


@dataclass(frozen=True)
class Fixed:
    """What the shaders know of a picture: view and projection (4, 4), the lights, the shadow map."""

    view: Array
    projection: Array
    lights: Lights


def compiled(context: moderngl.Context, files: ShaderFiles, resolver: Resolver) -> Program:
    """The program of ``files``, translated; raises `ShaderError` naming file and line."""
    texts = [_text(path, resolver, files.mark) for path in (files.vertex, files.fragment)]
    stages = translate(*texts)
    try:
        program = Program(context.program(stages.vertex, stages.fragment))
    except moderngl.Error as error:
        raise ShaderError(*findings(str(error), files)) from None
    unknown = sorted(set(program.attributes) - set(_ATTRIBUTES))
    if unknown:
        message = f"needs the vertex attribute '{unknown[0]}', which no object has"
        hint = f"it can use {', '.join(name for name in _ATTRIBUTES if not name.startswith(PREFIX))}"
        raise ShaderError(Diagnostic(Severity.ERROR, message, Mark(files.vertex, 1, 1), hint, "render"))
    for unit, name in enumerate((n for n in program.samplers if n not in _UNITS), _FIRST_FREE_UNIT):
        program.set(name, unit)  # samplers of different kinds may not share a unit
    for name in program.samplers:
        if name in _UNITS:
            program.set(name, _UNITS[name])
    return program


def findings(log: str, files: ShaderFiles) -> list[Diagnostic]:
    """What the driver's ``log`` states, by file and line; a program that does not link is blamed on both files."""
    path = files.fragment if "fragment_shader\n" in log else files.vertex
    found = [(int(m[1]), int(m[2]), m[3]) for m in _MESA.finditer(log)]
    found += [(int(m[1]), 1, m[2]) for pattern in (_NVIDIA, _OTHERS) for m in pattern.finditer(log)]
    if log.startswith(_LINKER):
        found = []  # NVIDIA's linker gives lines, but not of which shader
    hint = "the built-in shader is used instead; GLSL 1.10, 1.20 and 3.30 core are understood"
    if not found:
        reason = " ".join(line for line in log.split("\n")[1:] if line.strip(" =") and not line.endswith("_shader"))
        message = f"does not link with {files.fragment.name}: {reason.strip()[:300]}"
        return [Diagnostic(Severity.ERROR, message, Mark(files.vertex, 1, 1), hint, "render")]
    return [
        Diagnostic(
            Severity.ERROR, f"does not compile: {text.replace(PREFIX, 'gl_')}", Mark(path, line, column), hint, "render"
        )
        for line, column, text in found
    ]


def _text(path: Path, resolver: Resolver, mark: Mark | None) -> str:
    try:
        return resolver.read_text(path, MAX_SHADER_BYTES, mark or Mark(path, 1, 1))
    except AdfError as error:
        first = error.diagnostics[0]
        message = f"shader: {first.message}"
        hint = first.hint or "the built-in shader is used instead"
        raise ShaderError(Diagnostic(Severity.ERROR, message, first.mark, hint, "render")) from None


class LegacyBuffers:
    """The vertices of one batch, one buffer for each quantity that some program reads."""

    def __init__(self, context: moderngl.Context, triangles: Triangles) -> None:
        self._context = context
        self.triangles = triangles
        self._buffers: dict[str, moderngl.Buffer] = {}
        self._indices = context.buffer(np.ascontiguousarray(triangles.faces, dtype="i4").tobytes())
        self._arrays: dict[Program, moderngl.VertexArray] = {}

    def load(self, triangles: Triangles) -> None:
        """Take the same number of new vertices."""
        self.triangles = triangles
        for name, buffer in self._buffers.items():
            buffer.write(self._values(name))

    def array(self, program: Program) -> moderngl.VertexArray:
        """The buffers bound to the attributes that ``program`` reads."""
        if program not in self._arrays:
            content = [(self._buffer(_ATTRIBUTES[name]), _format(name), name) for name in program.attributes]
            self._arrays[program] = self._context.vertex_array(program.linked, content, index_buffer=self._indices)
        return self._arrays[program]

    def _buffer(self, name: str) -> moderngl.Buffer:
        if name not in self._buffers:
            self._buffers[name] = self._context.buffer(self._values(name))
        return self._buffers[name]

    def _values(self, name: str) -> bytes:
        t = self.triangles
        n = len(t.positions)
        if name == "colours":
            values = np.ones((n, 4))
        elif name == "secondary":
            values = np.tile(BLACK, (n, 1))
        elif name == "uvs":
            values = np.hstack([t.uvs, np.zeros((n, 1))])
        elif name in ("tangents", "bitangents"):
            tangents = t.tangents()
            values = tangents[:, :3]
            if name == "bitangents":
                values = np.cross(t.normals, values) * tangents[:, 3:]
        else:
            values = getattr(t, name)
        return np.ascontiguousarray(values, dtype="f4").tobytes()


def _format(name: str) -> str:
    return "4f" if _ATTRIBUTES[name] in ("colours", "secondary") else "3f"


def bind_picture(program: Program, picture: Fixed) -> None:
    """Fill what does not depend on the object: lights, planes of the shadow map, the camera's matrices.

    What no scene has holds its initial value (OpenGL 2.1, tables 6.7 to 6.17).
    """
    program.write("viewMat", picture.view)
    program.write("projectionMat", picture.projection)
    program.write("invProjection", np.linalg.inv(picture.projection))
    program.set(f"{PREFIX}LightModel.ambient", (LIGHT_MODEL_AMBIENT,) * 3 + (1.0,))
    lights = picture.lights.eye_space()
    for i in range(MAX_LIGHTS):
        for name, value in (_source(*lights[i]) if i < len(lights) else ABSENT_LIGHT).items():
            program.set(f"{PREFIX}LightSource[{i}].{name}", value)
    for name, value in _INITIAL.items():
        program.set(f"{PREFIX}{name}", value)
    shadow = picture.lights.shadow()
    program.set("uEnableShadow", shadow is not None)
    for number, axis in enumerate("STRQ"):
        planes = [_PLANES[axis]] * MAX_COORDS
        program.set(f"{PREFIX}ObjectPlane{axis}", planes)
        if shadow is not None:
            planes[SHADOW_COORDS] = tuple(map(float, shadow[1][number]))
        program.set(f"{PREFIX}EyePlane{axis}", planes)


BLACK, WHITE = (0.0, 0.0, 0.0, 1.0), (1.0, 1.0, 1.0, 1.0)

ABSENT_LIGHT: dict[str, Any] = {
    "ambient": BLACK, "diffuse": BLACK, "specular": BLACK, "position": (0.0, 0.0, 1.0, 0.0),
    "halfVector": (0.0, 0.0, 1.0, 0.0), "spotDirection": (0.0, 0.0, -1.0), "spotExponent": 0.0, "spotCutoff": 180.0,
    "spotCosCutoff": -1.0, "constantAttenuation": 1.0, "linearAttenuation": 0.0, "quadraticAttenuation": 0.0,
}  # fmt: skip
"""A light that is missing: initial values (OpenGL 2.1, table 2.10), black, so that it adds nothing to any sum."""

_INITIAL: dict[str, Any] = {
    "Fog.color": (0.0,) * 4, "Fog.density": 1.0, "Fog.start": 0.0, "Fog.end": 1.0, "Fog.scale": 1.0,
    "Point.size": 1.0, "Point.sizeMin": 0.0, "Point.sizeMax": 1.0, "Point.fadeThresholdSize": 1.0,
    "Point.distanceConstantAttenuation": 1.0, "Point.distanceLinearAttenuation": 0.0,
    "Point.distanceQuadraticAttenuation": 0.0,
    "ClipPlane": [(0.0,) * 4] * MAX_CLIP_PLANES, "TextureEnvColor": [(0.0,) * 4] * MAX_COORDS,
}  # fmt: skip
"""State that neither ADF nor AMBF sets."""

_NO_PLANE: tuple[float, ...] = (0.0,) * 4
_PLANES = {"S": (1.0, 0.0, 0.0, 0.0), "T": (0.0, 1.0, 0.0, 0.0), "R": _NO_PLANE, "Q": _NO_PLANE}
"""Initial planes of generated texture coordinates."""

SHADOW_COORDS = 1
"""Texture coordinates whose eye planes lead to the shadow map."""


def _source(settings: LightSettings, T_eye_light: Array) -> dict[str, Any]:
    """The members of ``gl_LightSource[i]`` of a light of the scene; white, as ADF has no colour of lights."""
    spot, directional = settings.kind is LightKind.SPOT, settings.kind is LightKind.DIRECTIONAL
    position = (*-T_eye_light[:3, 0], 0.0) if directional else (*T_eye_light[:3, 3], 1.0)
    constant, linear, quadratic = (1.0, 0.0, 0.0) if directional else settings.attenuation
    return ABSENT_LIGHT | {
        "ambient": (LIGHT_AMBIENT,) * 3 + (1.0,),
        "diffuse": WHITE,
        "specular": WHITE,
        "position": position,
        "halfVector": (*_unit(_unit(np.array(position[:3])) + [0, 0, 1]), 0.0),
        "spotDirection": tuple(T_eye_light[:3, 0]),
        "spotExponent": settings.exponent if spot else 0.0,
        "spotCutoff": float(np.degrees(settings.cutoff)) if spot else 180.0,
        "spotCosCutoff": float(np.cos(settings.cutoff)) if spot else -1.0,
        "constantAttenuation": constant,
        "linearAttenuation": linear,
        "quadraticAttenuation": quadratic,
    }


def bind_object(program: Program, model_view: Array, projection: Array) -> None:
    """Fill the matrices of one object that stands at ``model_view`` (4, 4)."""
    product = projection @ model_view
    matrices = {"ModelViewMatrix": model_view, "ProjectionMatrix": projection, "ModelViewProjectionMatrix": product}
    for name, matrix in matrices.items():
        for form, value in (("", matrix), ("Inverse", np.linalg.inv(matrix))):
            program.write(f"{PREFIX}{name}{form}", value)
            program.write(f"{PREFIX}{name}{form}Transpose", value.T)
    inverse = np.linalg.inv(model_view[:3, :3])
    program.write(f"{PREFIX}NormalMatrix", inverse.T)
    program.set(f"{PREFIX}NormalScale", float(1.0 / np.linalg.norm(inverse[2])))  # OpenGL 2.1 §2.11.3
    for form in ("", "Inverse", "Transpose", "InverseTranspose"):
        program.write(f"{PREFIX}TextureMatrix{form}", np.tile(np.eye(4), (MAX_COORDS, 1, 1)))


def bind_surface(program: Program, surface: Surface, textures: Textures, lights: Lights) -> None:
    """Fill the material, its products with the lights, and its textures; white where it has none."""
    _bind_material(program, surface.colour, len(lights.eye_space()))
    look = surface.physical
    maps: dict[str, Path | None] = {
        "diffuseMap": surface.texture, "albedoMap": surface.texture, "normalMap": surface.normal_map,
        "metallicMap": look.metallic_map if look else None, "roughnessMap": look.roughness_map if look else None,
        "aoMap": surface.occlusion_map, "uMatcapMap": surface.sphere_map,
    }  # fmt: skip
    for name, path in maps.items():
        if name in program:
            (textures.get(path) or textures.white).use(_UNITS[name])
    program.set("uTextureEnabled", surface.texture is not None)
    program.set("vEnableNormalMapping", surface.normal_map is not None)
    if "skybox" in program:
        textures.around.use(_UNITS["skybox"])
    if "shadowMap" in program:
        shadow = lights.shadow()
        (shadow[0] if shadow else textures.lit).use(_UNITS["shadowMap"])


def _bind_material(program: Program, colour: Colour, lights: int) -> None:
    """Fill both sides of the material and its products with the light model and the first ``lights`` lights.

    Products are of GLSL 1.20 §7.5; the alpha of a lit colour is that of the diffuse colour (OpenGL 2.1 §2.14.1).
    """
    ambient, diffuse, specular, emission = (
        (*rgb, colour.alpha) for rgb in (colour.ambient, colour.diffuse, colour.specular, colour.emission)
    )
    given = {"ambient": (LIGHT_AMBIENT, ambient), "diffuse": (1.0, diffuse), "specular": (1.0, specular)}
    products = {name: (*(level * c for c in values[:3]), colour.alpha) for name, (level, values) in given.items()}
    black = (0.0, 0.0, 0.0, colour.alpha)
    scene = (*(e + LIGHT_MODEL_AMBIENT * a for e, a in zip(emission[:3], ambient[:3], strict=True)), colour.alpha)
    for side in ("Front", "Back"):
        for name, value in (("ambient", ambient), ("diffuse", diffuse), ("specular", specular), ("emission", emission)):
            program.set(f"{PREFIX}{side}Material.{name}", value)
        program.set(f"{PREFIX}{side}Material.shininess", float(max(colour.shininess, 1)))
        program.set(f"{PREFIX}{side}LightModelProduct.sceneColor", scene)
        for i in range(MAX_LIGHTS):
            for name, product in products.items():
                program.set(f"{PREFIX}{side}LightProduct[{i}].{name}", product if i < lights else black)


def _unit(vector: Array) -> Array:
    unit: Array = vector / max(float(np.linalg.norm(vector)), 1e-9)  # a headlight stands in the eye
    return unit
