"""Translates GLSL 1.10 and 1.20, as AMBF and CHAI3D users write it, to the core profile of OpenGL 3.3.

Text in, text out: fixed-function names become declarations of their own, so that a core profile
compiles them; lines keep their numbers. Which uniforms then have to be filled states `legacy`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

PREFIX = "ligature_"
"""Replaces ``gl_`` in names that the core profile knows no more."""

MAX_LIGHTS = 8
MAX_COORDS = 8
MAX_CLIP_PLANES = 6

_COMMENT = re.compile(r"/\*.*?\*/|//[^\n]*", re.DOTALL)
_VERSION = re.compile(r"^[ \t]*#[ \t]*version[ \t]+(\d+)([^\n]*)", re.MULTILINE)
_EXTENSION = re.compile(r"^[ \t]*#[ \t]*extension[^\n]*", re.MULTILINE)
_NAME = re.compile(r"\bgl_([A-Za-z]\w*)")
_REDECLARED = re.compile(r"\b(?:varying|in|out)\s+vec4\s+gl_TexCoord\s*\[([^\]]*)\]\s*;")
_INDEXED = re.compile(r"\bgl_TexCoord\s*\[\s*(\d+)\s*\]")
_CALL = re.compile(r"\b(texture|dot|(?:texture|shadow)(?:1D|2D|3D|Cube)(?:Rect)?(?:Proj)?(?:Lod)?)(?=\s*\()")
_LATER_KEYWORD = re.compile(
    r"\b(common|partition|active|filter|switch|case|default|uint|smooth|flat|noperspective)\b"
    r"(?!\s+(?:in|out|varying|centroid)\b)"
)
_FRAGMENT_ARRAY = re.compile(r"\bgl_FragData\b")

_CORE = frozenset(
    (
        "Position", "PointSize", "ClipDistance", "VertexID", "InstanceID", "FragCoord", "FrontFacing", "PointCoord",
        "FragDepth", "PrimitiveID", "DepthRange", "DepthRangeParameters", "PerVertex", "in",
    )
)  # fmt: skip
"""Names after ``gl_`` that the core profile still has."""

_STRUCTS = {
    "LightSourceParameters": (
        "vec4 ambient, diffuse, specular, position, halfVector; vec3 spotDirection; float spotExponent, spotCutoff, "
        "spotCosCutoff, constantAttenuation, linearAttenuation, quadraticAttenuation;"
    ),
    "MaterialParameters": "vec4 emission, ambient, diffuse, specular; float shininess;",
    "LightModelParameters": "vec4 ambient;",
    "LightModelProducts": "vec4 sceneColor;",
    "LightProducts": "vec4 ambient, diffuse, specular;",
    "FogParameters": "vec4 color; float density, start, end, scale;",
    "PointParameters": (
        "float size, sizeMin, sizeMax, fadeThresholdSize, "
        "distanceConstantAttenuation, distanceLinearAttenuation, distanceQuadraticAttenuation;"
    ),
}

_UNIFORMS = {
    "NormalMatrix": "mat3 {}",
    "NormalScale": "float {}",
    "LightSource": f"ligature_LightSourceParameters {{}}[{MAX_LIGHTS}]",
    "LightModel": "ligature_LightModelParameters {}",
    "FrontMaterial": "ligature_MaterialParameters {}",
    "BackMaterial": "ligature_MaterialParameters {}",
    "FrontLightModelProduct": "ligature_LightModelProducts {}",
    "BackLightModelProduct": "ligature_LightModelProducts {}",
    "FrontLightProduct": f"ligature_LightProducts {{}}[{MAX_LIGHTS}]",
    "BackLightProduct": f"ligature_LightProducts {{}}[{MAX_LIGHTS}]",
    "Fog": "ligature_FogParameters {}",
    "Point": "ligature_PointParameters {}",
    "ClipPlane": f"vec4 {{}}[{MAX_CLIP_PLANES}]",
    "TextureEnvColor": f"vec4 {{}}[{MAX_COORDS}]",
}
"""Fixed-function state by name after ``gl_``; the matrices and planes are added below."""

for _form in ("", "Inverse", "Transpose", "InverseTranspose"):
    for _matrix in ("ModelViewMatrix", "ProjectionMatrix", "ModelViewProjectionMatrix"):
        _UNIFORMS[_matrix + _form] = "mat4 {}"
    _UNIFORMS["TextureMatrix" + _form] = f"mat4 {{}}[{MAX_COORDS}]"
for _plane in "STRQ":
    _UNIFORMS["EyePlane" + _plane] = _UNIFORMS["ObjectPlane" + _plane] = f"vec4 {{}}[{MAX_COORDS}]"

_ATTRIBUTES = {"Vertex": "vec4", "Normal": "vec3", "Color": "vec4", "SecondaryColor": "vec4"}
_ATTRIBUTES |= {f"MultiTexCoord{i}": "vec4" for i in range(MAX_COORDS)}

_VARYINGS = {"FrontColor": "vec4", "BackColor": "vec4", "FrontSecondaryColor": "vec4", "BackSecondaryColor": "vec4",
             "FogFragCoord": "float"}  # fmt: skip
_FRAGMENT_INPUTS = {"Color": "FrontColor", "SecondaryColor": "FrontSecondaryColor"}
"""What a fragment shader reads of the vertex shader's colours."""

_CONSTANTS = {"MaxLights": MAX_LIGHTS, "MaxTextureUnits": MAX_COORDS, "MaxTextureCoords": MAX_COORDS,
              "MaxClipPlanes": MAX_CLIP_PLANES, "MaxVaryingFloats": 64, "MaxTextureImageUnits": 16, "MaxDrawBuffers": 8,
              "MaxVertexAttribs": 16, "MaxVertexUniformComponents": 1024, "MaxVertexTextureImageUnits": 16,
              "MaxCombinedTextureImageUnits": 32, "MaxFragmentUniformComponents": 1024}  # fmt: skip
"""What every OpenGL 3.3 has, at least what OpenGL 2.1 demands (GLSL 1.20 §7.4)."""

_IDLE = {"FogCoord": "const float {} = 0.0;", "ClipVertex": "vec4 {};"}
"""Names of the vertex stage without effect: no object has fog coordinates, no plane clips."""

_FUNCTIONS = """
float ligature_dot(float a, float b) { return a * b; }
float ligature_dot(vec2 a, vec2 b) { return dot(a, b); }
float ligature_dot(vec3 a, vec3 b) { return dot(a, b); }
float ligature_dot(vec4 a, vec4 b) { return dot(a, b); }
float ligature_dot(vec4 a, vec3 b) { return dot(a.xyz, b); }
float ligature_dot(vec3 a, vec4 b) { return dot(a, b.xyz); }
vec4 ligature_texture(sampler1D s, float p) { return texture(s, p); }
vec4 ligature_texture(sampler2D s, vec2 p) { return texture(s, p); }
vec4 ligature_texture(sampler2D s, vec3 p) { return texture(s, p.xy); }
vec4 ligature_texture(sampler3D s, vec3 p) { return texture(s, p); }
vec4 ligature_texture(samplerCube s, vec3 p) { return texture(s, p); }
float ligature_texture(sampler2DShadow s, vec3 p) { return texture(s, p); }
vec4 ligature_texture1D(sampler1D s, float p) { return texture(s, p); }
vec4 ligature_texture1DProj(sampler1D s, vec2 p) { return textureProj(s, p); }
vec4 ligature_texture1DProj(sampler1D s, vec4 p) { return textureProj(s, p); }
vec4 ligature_texture1DLod(sampler1D s, float p, float l) { return textureLod(s, p, l); }
vec4 ligature_texture2D(sampler2D s, vec2 p) { return texture(s, p); }
vec4 ligature_texture2D(sampler2D s, vec3 p) { return texture(s, p.xy); }
vec4 ligature_texture2DProj(sampler2D s, vec3 p) { return textureProj(s, p); }
vec4 ligature_texture2DProj(sampler2D s, vec4 p) { return textureProj(s, p); }
vec4 ligature_texture2DLod(sampler2D s, vec2 p, float l) { return textureLod(s, p, l); }
vec4 ligature_texture3D(sampler3D s, vec3 p) { return texture(s, p); }
vec4 ligature_texture3DProj(sampler3D s, vec4 p) { return textureProj(s, p); }
vec4 ligature_texture3DLod(sampler3D s, vec3 p, float l) { return textureLod(s, p, l); }
vec4 ligature_textureCube(samplerCube s, vec3 p) { return texture(s, p); }
vec4 ligature_textureCubeLod(samplerCube s, vec3 p, float l) { return textureLod(s, p, l); }
vec4 ligature_shadow1D(sampler1DShadow s, vec3 p) { return vec4(texture(s, p)); }
vec4 ligature_shadow1DProj(sampler1DShadow s, vec4 p) { return vec4(textureProj(s, p)); }
vec4 ligature_shadow2D(sampler2DShadow s, vec3 p) { return vec4(texture(s, p)); }
vec4 ligature_shadow2DProj(sampler2DShadow s, vec4 p) { return vec4(textureProj(s, p)); }
"""
_BIASED = """
vec4 ligature_texture(sampler2D s, vec2 p, float b) { return texture(s, p, b); }
vec4 ligature_texture(sampler3D s, vec3 p, float b) { return texture(s, p, b); }
vec4 ligature_texture(samplerCube s, vec3 p, float b) { return texture(s, p, b); }
vec4 ligature_texture1D(sampler1D s, float p, float b) { return texture(s, p, b); }
vec4 ligature_texture2D(sampler2D s, vec2 p, float b) { return texture(s, p, b); }
vec4 ligature_texture2DProj(sampler2D s, vec3 p, float b) { return textureProj(s, p, b); }
vec4 ligature_texture3D(sampler3D s, vec3 p, float b) { return texture(s, p, b); }
vec4 ligature_textureCube(samplerCube s, vec3 p, float b) { return texture(s, p, b); }
"""


@dataclass(frozen=True)
class Translated:
    """A vertex and a fragment shader for the core profile."""

    vertex: str
    fragment: str


def translate(vertex: str, fragment: str) -> Translated:
    """Both stages of a program for GLSL 3.30, or for the later version that they ask for."""
    vertex, fragment = _blanked(vertex), _blanked(fragment)
    used = _names(vertex) | _names(fragment)
    version = max([330, *(int(match[1]) for match in map(_VERSION.search, (vertex, fragment)) if match)])
    between = _between(used, _names(fragment), vertex + fragment)
    return Translated(_stage(vertex, "vertex", version, between), _stage(fragment, "fragment", version, between))


def _blanked(text: str) -> str:
    """``text`` without comments, line for line."""
    text = text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n").replace("\\\n", " \n")
    return _COMMENT.sub(lambda match: " " + "\n" * match[0].count("\n"), text)


def _names(text: str) -> set[str]:
    return set(_NAME.findall(text))


def _between(used: set[str], fragment: set[str], text: str) -> dict[str, str]:
    """Declarations of what passes from vertex to fragment shader; equal in both, or they would not link."""
    names = used & set(_VARYINGS) | {_FRAGMENT_INPUTS[name] for name in fragment & set(_FRAGMENT_INPUTS)}
    between = {name: f"{_VARYINGS[name]} {PREFIX}{name}" for name in sorted(names)}
    if "TexCoord" in used:
        text = _REDECLARED.sub(r"gl_TexCoord[\1]", text)
        constant = len(_INDEXED.findall(text)) == len(re.findall(r"\bgl_TexCoord\b", text))
        count = max(map(int, _INDEXED.findall(text)), default=0) + 1 if constant else MAX_COORDS
        between["TexCoord"] = f"vec4 {PREFIX}TexCoord[{count}]"
    return between


def _stage(text: str, stage: str, version: int, between: dict[str, str]) -> str:
    """One stage: a header of declarations, then the author's lines under their own numbers."""
    declared = _VERSION.search(text)
    number = int(declared[1]) if declared else 110
    legacy = number < 330 or (declared is not None and "compatibility" in declared[2])
    extensions = _EXTENSION.findall(text)
    text = _REDECLARED.sub("", _EXTENSION.sub("", _VERSION.sub("", text)))
    names = _names(text)
    header = [f"#version {version} core", *extensions]
    if legacy:
        text = re.sub(r"\battribute\b", "in", text)
        text = re.sub(r"\bvarying\b", "out" if stage == "vertex" else "in", text)
        if number <= 120 and not _uses_qualifiers(text):
            text = _LATER_KEYWORD.sub(PREFIX + r"\1", text)
        header.append(_FUNCTIONS + (_BIASED if stage == "fragment" else ""))
        text = _CALL.sub(PREFIX + r"\1", text)
    header += _state(names)
    direction = "out" if stage == "vertex" else "in"
    header += [f"{direction} {declaration};" for declaration in between.values()]
    if stage == "vertex":
        header += [f"in {_ATTRIBUTES[name]} {PREFIX}{name};" for name in sorted(names & set(_ATTRIBUTES))]
        header += [_IDLE[name].format(PREFIX + name) for name in sorted(names & set(_IDLE))]
        if re.search(r"\bftransform\b", text):
            header += _transform(names)
    else:
        text = re.sub(r"\bgl_(Color|SecondaryColor)\b", lambda m: f"gl_{_FRAGMENT_INPUTS[m[1]]}", text)
        header += _outputs(text)
    text = _NAME.sub(lambda match: match[0] if match[1] in _CORE else PREFIX + match[1], text)
    text = re.sub(r"\bftransform\b", PREFIX + "ftransform", text)
    return "\n".join([*header, "#line 1", text])


def _uses_qualifiers(text: str) -> bool:
    """Whether an author who gave no version wrote in a later language all the same."""
    return (
        re.search(r"\blayout\s*\(|\b(?:flat|smooth|noperspective)\s+(?:in|out)\b|\buint\s+\w+\s*[;=]", text) is not None
    )


def _state(names: set[str]) -> list[str]:
    """Declarations of the fixed-function uniforms, structures and constants among ``names``."""
    uniforms = [_UNIFORMS[name].format(PREFIX + name) for name in sorted(names & set(_UNIFORMS))]
    wanted = {s for s in _STRUCTS if s in names or any(PREFIX + s + " " in u for u in uniforms)}
    structs = [f"struct {PREFIX}{name} {{ {_STRUCTS[name]} }};" for name in sorted(wanted)]
    constants = [f"const int {PREFIX}{name} = {_CONSTANTS[name]};" for name in sorted(names & set(_CONSTANTS))]
    return [*structs, *(f"uniform {uniform};" for uniform in uniforms), *constants]


def _transform(names: set[str]) -> list[str]:
    lines = [] if "ModelViewProjectionMatrix" in names else [f"uniform mat4 {PREFIX}ModelViewProjectionMatrix;"]
    lines += [] if "Vertex" in names else [f"in vec4 {PREFIX}Vertex;"]
    product = f"{PREFIX}ModelViewProjectionMatrix * {PREFIX}Vertex"
    return [*lines, f"vec4 {PREFIX}ftransform() {{ return {product}; }}"]


def _outputs(text: str) -> list[str]:
    if re.search(r"\bgl_FragColor\b", text):
        return [f"layout(location = 0) out vec4 {PREFIX}FragColor;"]
    if _FRAGMENT_ARRAY.search(text):
        return [f"layout(location = 0) out vec4 {PREFIX}FragData[1];"]
    return []
