"""Shaders of scene files: every name that authors use, what they compute, and what is stated of broken ones."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature import Simulation
from ligature.render import CameraView, Frame, Renderer, view_of
from ligature.render.context import create_context
from ligature.render.legacy import findings
from ligature.render.translate import translate

from tests.opengl import opengl

SHADERS = Path(__file__).parent / "shaders"
PROGRAMS = sorted({path.stem for path in SHADERS.iterdir()})

NAMES = [
    "aPosition",
    "aNormal",
    "aTexCoord",
    "aColor",
    "aTangent",
    "aBitangent",
    "layout(location",
    "gl_Vertex",
    "ftransform",
    "gl_ModelViewMatrix",
    "gl_ModelViewMatrixInverse",
    "gl_ModelViewProjectionMatrix",
    "gl_NormalMatrix",
    "gl_TextureMatrix",
    "gl_TexCoord",
    "gl_EyePlaneS",
    "gl_EyePlaneT",
    "gl_EyePlaneR",
    "gl_EyePlaneQ",
    "gl_LightSource",
    ".position",
    ".spotDirection",
    ".spotCosCutoff",
    ".spotCutoff",
    ".spotExponent",
    ".constantAttenuation",
    ".linearAttenuation",
    ".quadraticAttenuation",
    "gl_MaxLights",
    "gl_FrontMaterial",
    ".diffuse",
    ".emission",
    ".shininess",
    "gl_FrontLightProduct",
    ".ambient",
    ".specular",
    "gl_FrontLightModelProduct",
    ".sceneColor",
    "gl_FragColor",
    "gl_Position",
    "gl_FragDepth",
    "gl_DepthRange",
    ".near",
    ".far",
    ".diff",
    "texture2D",
    "texture3D",
    "shadow2DProj",
    "textureCube",
    "sampler2DShadow",
    "shadowMap",
    "diffuseMap",
    "normalMap",
    "uTextureEnabled",
    "vEnableNormalMapping",
    "uEnableShadow",
    "metallicMap",
    "roughnessMap",
    "aoMap",
    "albedoMap",
    "uMatcapMap",
    "invProjection",
    "viewMat",
    "projectionMat",
    "skybox",
    "uVolume",
    "uMinCorner",
    "uMaxCorner",
    "uTextureScale",
    "uGradientDelta",
    "uResolution",
    "uIsosurface",
    "uSmoothVolume",
    "uSmoothingLevel",
]
"""What the shader reference lists."""

SCENE = (
    "bodies: [Wall, Ball]\ncameras: [C]\nlights: [L]\nnamespace: /ambf/env/\n"
    "Wall: {name: Wall, mass: 0, shape: BOX, geometry: {x: 0.2, y: 4, z: 4}, location: {position: {x: -2.1, y: 0, z: 0}}, "
    "color rgba: {r: 0.5, g: 0.25, b: 0.75, a: 1}}\n"
    "Ball: {name: Ball, mass: 0, shape: SPHERE, geometry: {radius: 0.3}, location: {position: {x: -1.4, y: 0, z: 0}}, "
    "color components: {diffuse: {r: 0.6, g: 0.4, b: 0.1}, specular: {r: 0.3, g: 0.4, b: 0.5}, ambient: {level: 0.5}, "
    "emission: {r: 0.1, g: 0.0, b: 0.05}, shininess: 20, transparency: 1}}\n"
    "C: {name: C, location: {x: 0, y: 0, z: 0}, look at: {x: -1, y: 0, z: 0}, up: {x: 0, y: 0, z: 1}, "
    "field view angle: 0.9, clipping plane: {near: 0.05, far: 10}, publish image resolution: {width: 160, height: 120}}\n"
    "L: {name: L, location: {x: 0, y: 0.6, z: 0.5}, direction: {x: -0.9, y: -0.3, z: -0.25}, cutoff angle: 0.6, "
    "spot exponent: 1.5, attenuation: {constant: 0.4, linear: 0.3, quadratic: 0.05}, shadow quality: 4}\n"
)

Drawn = tuple[Renderer, Simulation, CameraView]


@pytest.fixture
def stage(tmp_path: Path) -> Callable[..., Drawn]:
    """The scene with the given shader texts (name to text) as the model's own, or with none."""

    def make(vertex: str | None = None, fragment: str | None = None, scene: str = SCENE) -> Drawn:
        text = scene
        if vertex is not None and fragment is not None:
            (tmp_path / "own.vert").write_text(vertex)
            (tmp_path / "own.frag").write_text(fragment)
            text += "shaders: {path: ./, vertex: own.vert, fragment: own.frag}\n"
        path = tmp_path / "m.yaml"
        path.write_text(text)
        simulation = Simulation(ligature.load(path))
        with opengl():
            renderer = Renderer(simulation.scene, samples=0)
        return renderer, simulation, view_of(simulation.scene.cameras[0], simulation.state["camera_world"][0, 0])

    return make


def shader(name: str) -> str:
    return (SHADERS / name).read_text()


def well_inside(frame: Frame, owner: int) -> np.ndarray:
    """Pixels (h, w) of an object that lie off its outline: scene files' programs draw facets, ids are exact."""
    mask = np.pad(frame.ids == owner, 1)
    inside = mask[1:-1, 1:-1].copy()
    for axis in (0, 1):
        for step in (-1, 1):
            inside &= np.roll(mask, step, axis)[1:-1, 1:-1]
    return inside


def test_the_test_shaders_use_every_name_of_the_reference() -> None:
    text = "\n".join(re.sub(r"/\*.*?\*/|//[^\n]*", "", path.read_text(), flags=re.S) for path in SHADERS.iterdir())
    assert [name for name in NAMES if name not in text] == []


@pytest.mark.parametrize("name", PROGRAMS)
def test_every_test_shader_compiles_in_a_core_profile(name: str) -> None:
    with opengl():
        context = create_context()
    stages = translate(shader(f"{name}.vert"), shader(f"{name}.frag"))
    context.program(stages.vertex, stages.fragment).release()
    context.release()


@pytest.mark.parametrize("name", ["phong", "maps", "located", "labels", "volume"])
def test_a_scene_is_drawn_with_its_own_shader(stage: Callable[..., Drawn], name: str) -> None:
    renderer, simulation, view = stage(shader(f"{name}.vert"), shader(f"{name}.frag"))
    frame = renderer.render(simulation.state, view)
    plain, *_ = stage()
    assert renderer.problems == []
    assert frame.rgb[frame.ids > 0].max() > 30
    assert (frame.ids == plain.render(simulation.state, view).ids).all()


def test_lights_materials_and_shadows_mean_to_an_old_shader_what_they_mean_to_the_built_in_one(stage) -> None:
    renderer, simulation, view = stage(shader("phong.vert"), shader("phong.frag"))
    plain, *_ = stage()
    frame = renderer.render(simulation.state, view)
    built_in = plain.render(simulation.state, view).rgb.astype(int)
    difference = np.abs(frame.rgb - built_in).max(axis=2)[well_inside(frame, 1) | well_inside(frame, 2)]
    assert built_in.std() > 20
    assert (difference > 2).mean() < 0.02  # the edge of the shadow is smoothed by the built-in one only


def is_painted(frame: Frame, body: int, colour: tuple[float, float, float]) -> bool:
    """Whether every inner pixel of a body has one colour of 255; OpenGL leaves open how a half is rounded."""
    painted = np.unique(frame.rgb[well_inside(frame, body)], axis=0)
    return len(painted) == 1 and bool((np.abs(painted[0] - colour) <= 0.5).all())


def test_a_preprocessing_shader_paints_labels_and_nothing_between_them(tmp_path: Path, stage) -> None:
    renderer, simulation, view = stage()
    for ending in ("vert", "frag"):
        (tmp_path / f"labels.{ending}").write_text(shader(f"labels.{ending}"))
    files = ligature.model.shapes.ShaderFiles(tmp_path / "labels.vert", tmp_path / "labels.frag")
    frame = renderer.render(simulation.state, view, ("rgb", "ids"), shaders=files)
    assert renderer.problems == []
    assert is_painted(frame, 1, (127.5, 63.75, 191.25))
    assert is_painted(frame, 2, (153, 102, 25.5))


def test_a_camera_draws_with_its_preprocessing_shaders(tmp_path: Path, stage) -> None:
    for ending in ("vert", "frag"):
        (tmp_path / f"labels.{ending}").write_text(shader(f"labels.{ending}"))
    block = "preprocessing shaders: {path: ./, vertex: labels.vert, fragment: labels.frag}, clipping plane"
    _, simulation, _ = stage(scene=SCENE.replace("clipping plane", block))
    frame = simulation.cameras["C"].capture()
    assert is_painted(frame, 2, (153, 102, 25.5))


def test_depth_compute_shaders_turn_depth_into_points(tmp_path: Path, stage) -> None:
    from ligature.render import unproject

    for ending in ("vert", "frag"):
        (tmp_path / f"depth.{ending}").write_text(shader(f"depth.{ending}"))
    block = "depth compute shaders: {path: ./, vertex: depth.vert, fragment: depth.frag}, clipping plane"
    renderer, simulation, view = stage(scene=SCENE.replace("clipping plane", block))
    depth = renderer.render(simulation.state, view, ("depth",)).depth
    points = renderer.points(depth, view, simulation.scene.cameras[0].depth_shaders)
    assert renderer.problems == []
    known = unproject(depth, view)
    seen = np.isfinite(depth)
    # the shader writes back, right, up in place of right, down, forward; its depth buffer is in single precision
    assert np.abs(points[seen] - known[seen][:, [2, 0, 1]] * [-1, 1, -1]).max() < 2e-4


PROBES = {
    "gl_LightSource[0].spotCosCutoff": [np.cos(0.6)] * 3,
    "gl_LightSource[0].spotExponent / 2.0": [0.75] * 3,
    "gl_LightSource[0].spotCutoff / 90.0": [np.degrees(0.6) / 90] * 3,
    "gl_LightSource[0].constantAttenuation": [0.4] * 3,
    "gl_LightSource[0].quadraticAttenuation * 10.0": [0.5] * 3,
    "gl_LightSource[0].position.w": [1.0] * 3,
    "gl_LightSource[0].position.xyz": [0.6, 0.5, 0.0],  # of the camera's axes: right, up, back
    "-gl_LightSource[0].spotDirection": np.array([0.3, 0.25, 0.9]) / np.linalg.norm([0.3, 0.25, 0.9]),
    "gl_FrontMaterial.specular.rgb": [0.3, 0.4, 0.5],
    "gl_FrontMaterial.shininess / 40.0": [0.5] * 3,
    "gl_FrontLightModelProduct.sceneColor.rgb": [0.1 + 0.2 * 0.3, 0.2 * 0.2, 0.05 + 0.2 * 0.05],
    "gl_FrontLightProduct[0].ambient.rgb": [0.15 * 0.3, 0.15 * 0.2, 0.15 * 0.05],
    "gl_DepthRange.diff": [1.0] * 3,
    "float(gl_MaxLights) / 16.0": [0.5] * 3,
    "-(gl_ModelViewMatrix * vec4(0.0, 0.0, 0.0, 1.0)).xyz / 2.0": [0.0, 0.0, 0.7],
    "-(gl_ModelViewMatrixInverse * vec4(0.0, 0.0, -1.0, 1.0)).xyz": [0.0, 0.0, 0.0],
    "(gl_ModelViewMatrixInverse * vec4(0.0, 0.0, 0.0, 1.0)).xyz / 2.0": [0.7, 0.0, 0.0],
    "gl_NormalMatrix * vec3(0.0, 0.0, 1.0)": [0.0, 1.0, 0.0],  # world z is up
    "vec3(gl_ProjectionMatrix[1][1]) / 4.0": [1 / np.tan(0.45) / 4] * 3,
    "vec3(gl_TextureMatrix[0][2][2])": [1.0] * 3,
    "vec3(uTextureEnabled ? 1.0 : 0.25)": [0.25] * 3,
    "vec3(dot(vec4(0.5, 0.25, 0.0, 9.0), vec3(1.0)))": [0.75] * 3,
}


@pytest.mark.parametrize("expression", PROBES)
def test_fixed_function_state_has_its_value(stage: Callable[..., Drawn], expression: str) -> None:
    fragment = f"uniform bool uTextureEnabled;\nvoid main() {{ gl_FragColor = vec4(vec3({expression}), 1.0); }}\n"
    renderer, simulation, view = stage("void main() { gl_Position = ftransform(); }\n", fragment)
    frame = renderer.render(simulation.state, view, ("rgb", "ids"))
    assert renderer.problems == []
    ball = frame.rgb[well_inside(frame, 2)]
    assert np.abs(ball - 255.0 * np.clip(PROBES[expression], 0, 1)).max() <= 1.01


def test_a_directional_light_has_no_position_and_no_cone(stage: Callable[..., Drawn]) -> None:
    from dataclasses import replace

    from ligature.render import LightKind

    fragment = (
        "void main() { gl_FragColor = vec4(gl_LightSource[0].position.x, gl_LightSource[0].position.w, "
        "-gl_LightSource[0].spotCosCutoff, 1.0); }"
    )
    renderer, simulation, view = stage("void main() { gl_Position = ftransform(); }\n", fragment)
    renderer.lights.settings[0] = replace(renderer.lights.settings[0], kind=LightKind.DIRECTIONAL)
    frame = renderer.render(simulation.state, view, ("rgb", "ids"))
    towards = 0.3 / np.linalg.norm([0.3, 0.25, 0.9])
    assert np.abs(frame.rgb[well_inside(frame, 2)] - np.array([255 * towards, 0, 255])).max() <= 1.01


def test_a_shader_that_does_not_compile_is_named_by_file_and_line_and_the_picture_is_drawn(stage) -> None:
    broken = "uniform float a;\n/* one\n two */\nvoid main() {\n    gl_FragColor = vec4(a, undeclared, 0.0, 1.0);\n}\n"
    renderer, simulation, view = stage(shader("labels.vert"), broken)
    (problem,) = renderer.problems
    assert problem.diagnostics[0].mark.file.name == "own.frag"
    assert problem.diagnostics[0].mark.line == 5
    assert "undeclared" in problem.diagnostics[0].message
    assert "built-in shader is used" in problem.diagnostics[0].hint
    plain, *_ = stage()
    assert (renderer.render(simulation.state, view).rgb == plain.render(simulation.state, view).rgb).all()


def test_an_error_in_the_vertex_shader_names_the_vertex_shader(stage: Callable[..., Drawn]) -> None:
    renderer, *_ = stage("attribute vec3 aPosition;\nvoid main() { gl_Position = 3; }\n", shader("labels.frag"))
    mark = renderer.problems[0].diagnostics[0].mark
    assert (mark.file.name, mark.line) == ("own.vert", 2)


def test_an_error_of_the_preprocessor_names_the_shader_and_the_line(stage: Callable[..., Drawn]) -> None:
    renderer, *_ = stage(shader("labels.vert"), "uniform float a;\n/* void main() {}\n")
    found = renderer.problems[0].diagnostics[0]
    assert found.mark.file.name == "own.frag" and "comment" in found.message


def test_shaders_that_do_not_link_are_reported(stage: Callable[..., Drawn]) -> None:
    vertex = "varying vec4 vWay;\nvoid main() { gl_Position = ftransform(); vWay = gl_Position; }\n"
    renderer, *_ = stage(vertex, "varying vec3 vWay;\nvoid main() { gl_FragColor = vec4(vWay, 1.0); }\n")
    message = renderer.problems[0].diagnostics[0].message
    assert "does not link with own.frag" in message and "vWay" in message


LINKER_LOGS = {
    "Mesa": "Program\n=======\nerror: vertex shader output `vWay' declared as type `vec4', but fragment shader input "
    "declared as type `vec3'\n",
    "NVIDIA": 'Program\n=======\nFragment info\n-------------\n0(2) : error C5108: unknown semantics "ATTR0.xyz" '
    'specified for "vWay"\n',
    "Apple": "Program\n=======\nERROR: 0:2: Type mismatch of varying 'vWay'\n",
}


@pytest.mark.parametrize("driver", LINKER_LOGS)
def test_errors_of_a_linker_are_distinguished_from_those_of_a_compiler(driver: str) -> None:
    files = ligature.model.shapes.ShaderFiles(Path("own.vert"), Path("own.frag"))
    (found,) = findings(f"GLSL Linker failed\n\n{LINKER_LOGS[driver]}", files)
    assert found.message.startswith("does not link with own.frag: ") and "vWay" in found.message
    assert found.mark.file.name == "own.vert"


def test_an_attribute_that_no_object_has_is_reported(stage: Callable[..., Drawn]) -> None:
    vertex = "attribute vec3 aBoneWeights;\nvoid main() { gl_Position = ftransform() + vec4(aBoneWeights, 0.0); }\n"
    renderer, *_ = stage(vertex, shader("labels.frag"))
    assert "needs the vertex attribute 'aBoneWeights'" in renderer.problems[0].diagnostics[0].message


def test_a_missing_shader_is_reported_once_where_the_scene_names_it(stage: Callable[..., Drawn]) -> None:
    scene = SCENE + "shaders: {path: ./, vertex: nowhere.vert, fragment: nowhere.frag}\n"
    renderer, simulation, view = stage(scene=scene)
    (problem,) = renderer.problems
    assert "nowhere.vert' does not exist" in problem.diagnostics[0].message
    assert (problem.diagnostics[0].mark.file.name, problem.diagnostics[0].mark.line) == ("m.yaml", 9)
    assert renderer.render(simulation.state, view).rgb.std() > 10


def test_a_shader_outside_the_folders_of_the_scene_is_not_read(stage: Callable[..., Drawn]) -> None:
    scene = SCENE + "shaders: {path: /etc/, vertex: hostname, fragment: hostname}\n"
    renderer, *_ = stage(scene=scene)
    assert "lies outside the scene's folders" in renderer.problems[0].diagnostics[0].message


def test_words_that_later_versions_reserve_may_be_names_in_old_shaders() -> None:
    stages = translate(
        shader("labels.vert"), "void main() { float filter = 1.0, smooth = 0.5; gl_FragColor = vec4(filter * smooth); }"
    )
    with opengl():
        context = create_context()
    context.program(stages.vertex, stages.fragment).release()


def test_a_shader_of_a_later_version_is_left_as_it_is() -> None:
    vertex = "#version 330 core\nin vec3 aPosition;\nvoid main() { gl_Position = vec4(aPosition, 1.0); }"
    assert translate(vertex, vertex).vertex.endswith("#line 1\n" + vertex.replace("#version 330 core", ""))


def test_colours_reach_the_fragment_shader_as_in_old_opengl(stage: Callable[..., Drawn]) -> None:
    vertex = "void main() { gl_FrontColor = vec4(0.2, 0.4, 0.6, 1.0) * gl_Color; gl_Position = ftransform(); }\n"
    renderer, simulation, view = stage(vertex, "void main() { gl_FragData[0] = gl_Color; }\n")
    frame = renderer.render(simulation.state, view, ("rgb", "ids"))
    assert renderer.problems == []
    assert set(map(tuple, frame.rgb[well_inside(frame, 2)])) == {(51, 102, 153)}
