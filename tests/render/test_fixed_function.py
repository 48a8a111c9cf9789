"""The fixed-function state that old shaders read, against OpenGL 2.1 and GLSL 1.20: every quantity, every kind of light.

A program writes one quantity into each column of a float picture; what is expected is worked out here from the scene by
the formulas of the specifications' sections, which stand beside each quantity.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import ligature
import moderngl
import numpy as np
import pytest
from ligature.adf import Resolver
from ligature.model.frames import axis_rotation, frame
from ligature.model.shapes import Colour, ShaderFiles
from ligature.render import LightKind, legacy
from ligature.render.camera import perspective
from ligature.render.context import create_context
from ligature.render.geometry import Triangles
from ligature.render.lights import HEADLIGHT, Lights, LightSettings
from ligature.render.surface import Surface
from ligature.render.textures import Textures

from tests.opengl import opengl

Array = np.ndarray
COLOUR = Colour(
    diffuse=(0.6, 0.4, 0.1), ambient=(0.3, 0.2, 0.05), specular=(0.3, 0.4, 0.5), emission=(0.1, 0.0, 0.05),
    shininess=20, alpha=0.8,
)  # fmt: skip
MODEL_VIEW = frame(axis_rotation((0.6, 0.0, 0.8), 0.7), (0.1, -0.2, -1.5)) @ np.diag([2.0, 2.0, 2.0, 1.0])
VIEW = frame(axis_rotation((0.0, 0.6, 0.8), -0.4), (0.0, 0.1, -0.5))
PROJECTION = perspective(0.9, 4 / 3, 0.05, 10.0)
SCENE_AMBIENT, LIGHT_AMBIENT = 0.2, 0.15
QUAD = Triangles(
    np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]), np.tile([0.0, 0.0, 1.0], (4, 1)),
    np.tile([0.25, 0.75], (4, 1)), np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32),
)  # fmt: skip


@dataclass
class Case:
    """What a program is fed with: settings and eye-space frames of the lights that exist."""

    lights: list[tuple[LightSettings, Array]]

    def there(self, i: int) -> bool:
        return i < len(self.lights)


Expected = Callable[[Case], Any]


def of_light(i: int, initial: Any, value: Callable[[LightSettings, Array], Any]) -> Expected:
    """``value`` of light ``i``, or the ``initial`` value (OpenGL 2.1, table 2.10) where there is none."""
    return lambda case: value(*case.lights[i]) if case.there(i) else initial


def position(s: LightSettings, T: Array) -> Array:
    return np.append(-T[:3, 0], 0.0) if s.kind is LightKind.DIRECTIONAL else np.append(T[:3, 3], 1.0)


def half_vector(s: LightSettings, T: Array) -> Array:
    """Between the light and a viewer at infinity (GL 2.1 §2.14.1)."""
    P = position(s, T)[:3]
    h = P / (np.linalg.norm(P) + 1e-30) + [0, 0, 1]  # a headlight stands in the viewer's place
    return h / np.linalg.norm(h)


def spot(value: Callable[[LightSettings], float], otherwise: float) -> Callable[[LightSettings, Array], float]:
    return lambda s, _: value(s) if s.kind is LightKind.SPOT else otherwise


def attenuation(which: int) -> Callable[[LightSettings, Array], float]:
    return lambda s, _: (1.0, 0.0, 0.0)[which] if s.kind is LightKind.DIRECTIONAL else s.attenuation[which]


def rgba(rgb: Any) -> Array:
    return np.append(np.asarray(rgb, dtype=float), COLOUR.alpha)


def state() -> list[tuple[str, str, Expected]]:
    """Section, expression, and what it must be."""
    black, grey = [0, 0, 0, 1], [LIGHT_AMBIENT] * 3 + [1]
    rows: list[tuple[str, str, Expected]] = []

    def row(section: str, expression: str, expected: Any) -> None:
        rows.append((section, expression, expected if callable(expected) else lambda _, value=expected: value))

    for i in range(8):
        name, section = f"gl_LightSource[{i}].", "GL 2.1 table 2.10; GLSL 1.20 §7.5"
        row(section, name + "ambient", of_light(i, black, lambda s, T: grey))
        row(section, name + "diffuse", of_light(i, black, lambda s, T: [1, 1, 1, 1]))
        row(section, name + "specular", of_light(i, black, lambda s, T: [1, 1, 1, 1]))
        row(section, name + "position", of_light(i, [0, 0, 1, 0], position))
        row(section, name + "halfVector.xyz", of_light(i, [0, 0, 1], half_vector))
        row(section, name + "spotDirection", of_light(i, [0, 0, -1], lambda s, T: T[:3, 0]))
        row(section, name + "spotExponent", of_light(i, 0, spot(lambda s: s.exponent, 0)))
        row(section, name + "spotCutoff", of_light(i, 180, spot(lambda s: np.degrees(s.cutoff), 180)))
        row(section, name + "spotCosCutoff", of_light(i, -1, spot(lambda s: np.cos(s.cutoff), -1)))
        for which, word in enumerate(("constant", "linear", "quadratic")):
            row(section, f"{name}{word}Attenuation", of_light(i, float(which == 0), attenuation(which)))
        for side in ("Front", "Back"):
            product, section = f"gl_{side}LightProduct[{i}].", "GLSL 1.20 §7.5: products of material and light"
            row(section, product + "ambient", of_light(i, rgba([0] * 3), lambda s, T: rgba(np.array(COLOUR.ambient) * LIGHT_AMBIENT)))  # fmt: skip
            row(section, product + "diffuse", of_light(i, rgba([0] * 3), lambda s, T: rgba(COLOUR.diffuse)))
            row(section, product + "specular", of_light(i, rgba([0] * 3), lambda s, T: rgba(COLOUR.specular)))
    row("GL 2.1 table 2.10, a_cs", "gl_LightModel.ambient", [SCENE_AMBIENT] * 3 + [1])
    for side in ("Front", "Back"):
        material = f"gl_{side}Material."
        for word in ("ambient", "diffuse", "specular", "emission"):
            row("GL 2.1 §2.14.2", material + word, rgba(getattr(COLOUR, word)))
        row("GL 2.1 §2.14.2", material + "shininess", 20.0)
        scene = np.array(COLOUR.emission) + SCENE_AMBIENT * np.array(COLOUR.ambient)
        row("GLSL 1.20 §7.5: emission + ambient * model", f"gl_{side}LightModelProduct.sceneColor", rgba(scene))
    matrices = {"ModelView": MODEL_VIEW, "Projection": PROJECTION, "ModelViewProjection": PROJECTION @ MODEL_VIEW}
    for name, M in matrices.items():
        for form, value in {"": M, "Inverse": np.linalg.inv(M), "Transpose": M.T, "InverseTranspose": np.linalg.inv(M).T}.items():  # fmt: skip
            for column in range(4):
                row("GLSL 1.20 §7.5", f"gl_{name}Matrix{form}[{column}]", value[:, column])
    for column in range(3):
        normal = np.linalg.inv(MODEL_VIEW[:3, :3]).T[:, column]
        row("GLSL 1.20 §7.5: transposed inverse of the upper left 3x3", f"gl_NormalMatrix[{column}]", normal)
    row("GL 2.1 §2.11.3", "gl_NormalScale", 2.0)
    for form in ("", "Inverse", "Transpose", "InverseTranspose"):
        row("GL 2.1 §2.11.2: identity", f"gl_TextureMatrix{form}[3][2]", [0, 0, 1, 0])
    for i in (0, 7):  # plane 1 is the shadow map's where there is one
        for axis, plane in {"S": [1, 0, 0, 0], "T": [0, 1, 0, 0], "R": [0] * 4, "Q": [0] * 4}.items():
            row("GL 2.1 §2.11.4", f"gl_EyePlane{axis}[{i}]", plane)
            row("GL 2.1 §2.11.4", f"gl_ObjectPlane{axis}[{i}]", plane)
    row("GL 2.1 §3.10", "gl_Fog.color", [0] * 4)
    row("GL 2.1 §3.10", "vec4(gl_Fog.density, gl_Fog.start, gl_Fog.end, gl_Fog.scale)", [1, 0, 1, 1])
    row("GL 2.1 §3.3", "vec3(gl_Point.size, gl_Point.sizeMin, gl_Point.fadeThresholdSize)", [1, 0, 1])
    row("GL 2.1 §3.3", "vec3(gl_Point.distanceConstantAttenuation, gl_Point.distanceLinearAttenuation, gl_Point.distanceQuadraticAttenuation)", [1, 0, 0])  # fmt: skip
    row("GL 2.1 §2.12", "gl_ClipPlane[5]", [0] * 4)
    row("GL 2.1 §3.8.13", "gl_TextureEnvColor[0]", [0] * 4)
    row("GL 2.1 §2.11.1", "vec3(gl_DepthRange.near, gl_DepthRange.far, gl_DepthRange.diff)", [0, 1, 1])
    row("GLSL 1.20 §7.4", "float(gl_MaxLights)", 8)
    least = {
        "MaxClipPlanes": 6, "MaxTextureUnits": 2, "MaxTextureCoords": 2, "MaxVertexAttribs": 16, "MaxVaryingFloats": 32,
        "MaxVertexUniformComponents": 512, "MaxVertexTextureImageUnits": 0, "MaxCombinedTextureImageUnits": 2,
        "MaxTextureImageUnits": 2, "MaxFragmentUniformComponents": 64, "MaxDrawBuffers": 1,
    }  # fmt: skip
    for name, smallest in least.items():
        row("GLSL 1.20 §7.4", f"float(gl_{name} >= {smallest})", 1)
    row("GL 2.1 §2.7: current colour", "vColour", [1, 1, 1, 1])
    row("GL 2.1 §2.7: secondary colour", "vSecondary", [0, 0, 0, 1])
    row("GL 2.1 §2.7: fog coordinate", "vFog", 0)
    row("GL 2.1 §2.7: texture coordinates", "vCoords", [0.25, 0.75, 0, 1])
    return rows


STATE = state()
VERTEX = """#version 120
varying vec4 vColour, vSecondary, vCoords;
varying float vFog;
void main() {
    vColour = gl_Color; vSecondary = gl_SecondaryColor; vFog = gl_FogCoord; vCoords = gl_MultiTexCoord0;
    gl_ClipVertex = gl_Vertex;
    gl_FrontColor = vec4(0.5); gl_BackColor = vec4(0.5); gl_FrontSecondaryColor = vec4(0.5);
    gl_BackSecondaryColor = vec4(0.5);
    gl_Position = gl_Vertex;
}
"""
CHUNK = 32
"""Quantities of one program: Mesa takes long over long chains of cases."""

SETTINGS = {
    "no light": (0, LightKind.SPOT),
    **{f"{n} {kind.value.lower()}": (n, kind) for n in (1, 2, 8) for kind in LightKind},
}


@pytest.fixture(scope="module")
def context() -> Iterator[moderngl.Context]:
    with opengl():
        made = create_context()
    yield made
    made.release()


@pytest.fixture(scope="module")
def probes(context: moderngl.Context, tmp_path_factory: pytest.TempPathFactory) -> list[tuple[Any, list[int]]]:
    """Programs that write the state, and the rows of `STATE` that each one writes."""
    folder = tmp_path_factory.mktemp("probes")
    (folder / "probe.vert").write_text(VERTEX)
    made = []
    for first in range(0, len(STATE), CHUNK):
        rows = list(range(first, min(first + CHUNK, len(STATE))))
        cases = "".join(f"    if (k == {place}) v = wide({STATE[row][1]});\n" for place, row in enumerate(rows))
        (folder / f"probe{first}.frag").write_text(
            "#version 120\nvarying vec4 vColour, vSecondary, vCoords;\nvarying float vFog;\n"
            "vec4 wide(vec4 v) { return v; }\nvec4 wide(vec3 v) { return vec4(v, -7.0); }\n"
            "vec4 wide(float v) { return vec4(v, -7.0, -7.0, -7.0); }\n"
            f"void main() {{\n    int k = int(gl_FragCoord.x);\n    vec4 v = vec4(-9.0);\n{cases}    gl_FragColor = v;\n}}\n"
        )
        files = ShaderFiles(folder / "probe.vert", folder / f"probe{first}.frag")
        made.append((legacy.compiled(context, files, Resolver([folder])), rows))
    return made


def placed(context: moderngl.Context, folder: Path, count: int, kind: LightKind, seed: int = 1) -> tuple[Lights, Case]:
    """``count`` lights of a kind at random places, with random settings; a headlight when there is none."""
    path = folder / "m.yaml"
    names = ", ".join(f"L{i}" for i in range(count))
    path.write_text(
        f"bodies: [B]\nlights: [{names}]\nB: {{name: B, mass: 0, shape: BOX, geometry: {{x: 1, y: 1, z: 1}}}}\n"
        + "".join(f"L{i}: {{name: L{i}, location: {{x: 0, y: 0, z: 0}}}}\n" for i in range(count))
    )
    lights = Lights(context, ligature.load(path))
    random = np.random.default_rng(seed)
    lights.settings = [
        LightSettings(kind, random.uniform(0.1, 1.5), random.uniform(0, 3), tuple(random.uniform(0.2, 1.0, 3)), 0)
        for _ in range(count)
    ]
    T_world_light = np.array(
        [
            frame(axis_rotation(axis / np.linalg.norm(axis), angle), p)
            for axis, angle, p in zip(
                random.normal(size=(count, 3)), random.uniform(0, 3, count), random.normal(size=(count, 3)), strict=True
            )
        ]
    ).reshape(-1, 4, 4)
    lights.place(T_world_light, VIEW)
    if not count:
        T = np.eye(4)
        T[:3, 0] = 0, 0, -1  # from the eye, straight ahead
        return lights, Case([(HEADLIGHT, T)])
    return lights, Case(list(zip(lights.settings, VIEW @ T_world_light, strict=True)))


def draw(context: moderngl.Context, program: Any, lights: Lights, size: tuple[int, int], model_view: Array) -> Array:
    """What ``program`` writes (h, w, 4) for a square that fills the picture, or stands at ``model_view``."""
    texture = context.texture(size, 4, dtype="f4")
    buffer = context.framebuffer([texture])
    buffer.use()
    context.disable(moderngl.DEPTH_TEST | moderngl.CULL_FACE | moderngl.BLEND)
    legacy.bind_picture(program, legacy.Fixed(VIEW, PROJECTION, lights))
    legacy.bind_object(program, model_view, PROJECTION)
    legacy.bind_surface(program, Surface(COLOUR), Textures(context, []), lights)
    legacy.LegacyBuffers(context, QUAD).array(program).render()
    return np.frombuffer(texture.read(), dtype="f4").reshape(size[1], size[0], 4)


@pytest.mark.parametrize("lit", SETTINGS)
def test_every_quantity_of_the_fixed_function_state_is_that_of_the_specification(
    context: moderngl.Context, probes: list[tuple[Any, list[int]]], tmp_path: Path, lit: str
) -> None:
    lights, case = placed(context, tmp_path, *SETTINGS[lit])
    wrong = []
    for program, rows in probes:
        written = draw(context, program, lights, (len(rows), 1), MODEL_VIEW)[0]
        for place, row in enumerate(rows):
            section, expression, expected = STATE[row]
            value = np.atleast_1d(np.asarray(expected(case), dtype=float))
            if not np.allclose(written[place, : len(value)], value, rtol=2e-5, atol=2e-5):
                wrong.append(f"{expression} is {written[place, : len(value)]}, not {value} ({section})")
    assert wrong == []


def lit_by(case: Case, p: Array, n: Array) -> Array:
    """Colour (3,) of the surface at ``p`` with normal ``n``, eye space: OpenGL 2.1 §2.14.1, local viewer, lights alone."""
    ambient, diffuse, specular = (np.array(getattr(COLOUR, word)) for word in ("ambient", "diffuse", "specular"))
    colour = np.array(COLOUR.emission) + SCENE_AMBIENT * ambient
    for s, T in case.lights:
        P = position(s, T)
        towards = P[:3] - P[3] * p
        d = float(np.linalg.norm(towards))
        towards = towards / d
        share = 1.0
        if P[3]:
            k0, k1, k2 = s.attenuation
            share /= k0 + k1 * d + k2 * d * d
        if s.kind is LightKind.SPOT:
            middle = float(-towards @ T[:3, 0])
            share *= max(middle, 0.0) ** s.exponent if middle >= np.cos(s.cutoff) else 0.0
        facing = max(float(n @ towards), 0.0)
        half = towards - p / np.linalg.norm(p)
        shine = max(float(n @ half) / float(np.linalg.norm(half)), 0.0) ** COLOUR.shininess if facing > 0 else 0.0
        colour = colour + share * (LIGHT_AMBIENT * ambient + facing * diffuse + shine * specular)
    return colour


@pytest.mark.parametrize("lit", SETTINGS)
def test_a_shader_that_sums_over_all_lights_gets_those_of_the_scene_alone(
    context: moderngl.Context, tmp_path: Path, lit: str
) -> None:
    folder = Path(__file__).parent / "shaders"
    files = ShaderFiles(folder / "all_lights.vert", folder / "all_lights.frag")
    program = legacy.compiled(context, files, Resolver([folder]))
    size = 9
    for seed in range(3):
        lights, case = placed(context, tmp_path, *SETTINGS[lit], seed)
        picture = draw(context, program, lights, (size, size), MODEL_VIEW)
        eye = np.linalg.inv(PROJECTION) @ np.array([0.0, 0.0, 0.0, 1.0])  # a point of the ray through the middle
        ray = eye[:3] / np.linalg.norm(eye[:3])
        n = np.linalg.inv(MODEL_VIEW[:3, :3]).T @ [0.0, 0.0, 1.0]
        n /= np.linalg.norm(n)
        p = ray * float(MODEL_VIEW[:3, 3] @ n) / float(ray @ n)
        n = -n if n @ -p < 0 else n
        assert np.allclose(picture[size // 2, size // 2, :3], lit_by(case, p, n), rtol=1e-3, atol=1e-4)
