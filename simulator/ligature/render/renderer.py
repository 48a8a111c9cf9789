"""Draws one camera's view of a scene from a state record: colour, linear depth, ids and normals in one pass.

Inputs in world axes and metres. Ids are 1 + body index; ghosts follow the bodies; 0 is background.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ligature.adf import Resolver
from ligature.mesh import Material, MeshError, load_mesh
from ligature.model.frames import pose7_matrix
from ligature.model.scene import Colour, RodChain, Scene, Visual
from ligature.render.camera import CameraView
from ligature.render.context import create_context
from ligature.render.geometry import Triangles, flat_shaded, of_shape, tube

Array = NDArray[np.float64]

MAX_LIGHTS = 8
BACKGROUND = (0.02, 0.02, 0.03, 1.0)
SPLINE_POINTS = 4
"""Points of the drawn tube per rod element."""


@dataclass(frozen=True, eq=False)
class Frame:
    """One picture, row 0 at the top.

    ``rgb`` (h, w, 3) uint8; ``depth`` (h, w) float32 metres along the optical axis, inf where
    nothing is; ``ids`` (h, w) int32; ``normals`` (h, w, 3) float32 in the OpenGL eye frame.
    """

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    ids: NDArray[np.int32]
    normals: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class _Item:
    """One draw call: a vertex array, its material, whose it is and where on it (``T_owner_item``)."""

    vertices: moderngl.VertexArray
    colour: Colour
    texture: moderngl.Texture | None
    owner: int
    T_owner_item: Array


class Renderer:
    """Everything that is drawn of one scene; `render` takes pictures of it."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._context = create_context()
        self._program = self._context.program(_glsl("surface.vert"), _glsl("surface.frag"))
        self._textures: dict[Path, moderngl.Texture | None] = {}
        self._targets: dict[tuple[int, int], _Target] = {}
        self.problems: list[MeshError] = []
        rod_bodies = scene.rod_bodies
        owners = [(b.index, b.visual) for b in scene.bodies if b.index not in rod_bodies]
        owners += [(len(scene.bodies) + g.index, g.visual) for g in scene.ghosts]
        items = [item for owner, visual in owners if visual.visible for item in self._items(owner, visual)]
        self._opaque = [item for item in items if item.colour.alpha >= 1.0]
        self._transparent = [item for item in items if item.colour.alpha < 1.0]

    def render(self, state: NDArray[np.void], view: CameraView) -> Frame:
        """Draw ``state`` (one-element record) as seen by ``view``."""
        poses = np.concatenate([state["body_pose"][0], state["ghost_world"][0]])
        target = self._target(view.width, view.height)
        target.clear()
        context = self._context
        context.enable(moderngl.DEPTH_TEST)
        context.disable(moderngl.BLEND)
        self._uniform("uProjection").write(view.projection.T.astype("f4").tobytes())
        self._set_lights(state, view)
        for item in self._opaque:
            self._draw(item, poses[item.owner], view)
        for rod in self._scene.rods:
            self._draw_rod(rod, poses, view)
        for item in sorted(self._transparent, key=lambda i: -_distance(poses[i.owner], view)):
            self._draw(item, poses[item.owner], view)
        return target.read()

    def release(self) -> None:
        """Give the OpenGL objects back."""
        self._context.release()

    def _items(self, owner: int, visual: Visual) -> list[_Item]:
        if visual.mesh is None:
            colour = visual.colour or Colour()
            return [_Item(self._upload(of_shape(c.shape)), colour, None, owner, c.T_body_shape) for c in visual.shapes]
        try:
            mesh = load_mesh(visual.mesh, Resolver([visual.mesh.parent]))
        except MeshError as error:
            self.problems.append(error)
            return []
        scale = np.diag([visual.scale] * 3 + [1.0])
        items = []
        for part in mesh.parts:
            if not len(part.faces):
                continue
            if part.normals is None:
                triangles = flat_shaded(part.vertices, part.faces)
            else:
                uvs = part.uvs if part.uvs is not None else np.zeros((len(part.vertices), 2))
                triangles = Triangles(part.vertices, part.normals, uvs, part.faces)
            colour = visual.colour or _colour(part.material)
            texture = self._texture(part.material)
            items.append(_Item(self._upload(triangles), colour, texture, owner, scale))
        return items

    def _upload(self, triangles: Triangles) -> moderngl.VertexArray:
        context = self._context
        vertices = context.buffer(triangles.interleaved().tobytes())
        indices = context.buffer(np.ascontiguousarray(triangles.faces, dtype="i4").tobytes())
        content = [(vertices, "3f 3f 2f", "aPosition", "aNormal", "aTexCoord")]
        return context.vertex_array(self._program, content, index_buffer=indices)

    def _texture(self, material: Material | None) -> moderngl.Texture | None:
        path = None if material is None else material.texture
        if path is None:
            return None
        if path not in self._textures:
            self._textures[path] = self._load_texture(path)
        return self._textures[path]

    def _load_texture(self, path: Path) -> moderngl.Texture | None:
        if not path.is_file():
            return None
        with Image.open(path) as picture:
            image = picture.convert("RGBA").transpose(Image.Transpose.FLIP_TOP_BOTTOM)
        texture = self._context.texture(image.size, 4, image.tobytes())
        texture.build_mipmaps()
        texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        return texture

    def _target(self, width: int, height: int) -> _Target:
        if (width, height) not in self._targets:
            self._targets[width, height] = _Target(self._context, width, height)
        return self._targets[width, height]

    def _set_lights(self, state: NDArray[np.void], view: CameraView) -> None:
        lights = self._scene.lights[:MAX_LIGHTS]
        self._set("uLightCount", len(lights))
        for light in lights:
            T_eye_light = view.view @ pose7_matrix(state["light_world"][0][light.index])
            name = f"uLights[{light.index}]"
            self._set(f"{name}.position", tuple(T_eye_light[:3, 3]))
            self._set(f"{name}.direction", tuple(T_eye_light[:3, 0]))
            self._set(f"{name}.attenuation", light.attenuation)
            self._set(f"{name}.cosCutoff", float(np.cos(min(light.cutoff, np.pi / 2))))
            self._set(f"{name}.exponent", light.spot_exponent)

    def _draw(self, item: _Item, pose: Array, view: CameraView) -> None:
        model_view = view.view @ pose7_matrix(pose) @ item.T_owner_item
        self._uniform("uModelView").write(model_view.T.astype("f4").tobytes())
        self._set_material(item.colour, item.texture, item.owner)
        item.vertices.render()

    def _draw_rod(self, rod: RodChain, poses: Array, view: CameraView) -> None:
        """Draw a rod as one smooth tube through the middles and ends of its elements."""
        points = _spline(rod, poses)
        vertices = self._upload(tube(points, rod.radius))
        self._uniform("uModelView").write(view.view.T.astype("f4").tobytes())
        visual = self._scene.bodies[rod.bodies[0]].visual
        self._set_material(visual.colour or Colour(diffuse=(0.1, 0.1, 0.35)), None, rod.bodies[0])
        vertices.render()
        vertices.release()

    def _set_material(self, colour: Colour, texture: moderngl.Texture | None, owner: int) -> None:
        self._set("uAmbient", colour.ambient)
        self._set("uDiffuse", colour.diffuse)
        self._set("uSpecular", colour.specular)
        self._set("uEmission", colour.emission)
        self._set("uShininess", float(max(colour.shininess, 1)))
        self._set("uAlpha", colour.alpha)
        self._set("uTextured", texture is not None)
        self._set("uId", owner + 1)
        if texture is not None:
            texture.use(0)

    def _set(self, name: str, value: Any) -> None:
        """Set a uniform unless the compiler dropped it."""
        if name in self._program:
            self._uniform(name).value = value

    def _uniform(self, name: str) -> moderngl.Uniform:
        member = self._program[name]
        assert isinstance(member, moderngl.Uniform)
        return member


class _Target:
    """Frame buffer with one attachment per output of the geometry pass."""

    def __init__(self, context: moderngl.Context, width: int, height: int) -> None:
        size = (width, height)
        self._size = size
        self._colour = context.texture(size, 4)
        self._depth = context.texture(size, 1, dtype="f4")
        self._ids = context.texture(size, 1, dtype="i4")
        self._normals = context.texture(size, 4, dtype="f4")
        self._buffer = context.framebuffer(
            [self._colour, self._depth, self._ids, self._normals], context.depth_renderbuffer(size)
        )

    def clear(self) -> None:
        """Make the target current and empty."""
        self._buffer.use()
        self._buffer.clear(*BACKGROUND)
        self._depth.write(np.full(self._size, np.inf, dtype="f4").tobytes())
        self._ids.write(np.zeros(self._size, dtype="i4").tobytes())
        self._normals.write(np.zeros((*self._size, 4), dtype="f4").tobytes())

    def read(self) -> Frame:
        """Copy the picture out, top row first."""
        width, height = self._size

        def array(texture: moderngl.Texture, dtype: str, channels: int) -> NDArray[Any]:
            data = np.frombuffer(texture.read(), dtype=dtype)
            return data.reshape(height, width, channels)[::-1]

        return Frame(
            np.ascontiguousarray(array(self._colour, "u1", 4)[..., :3]),
            np.ascontiguousarray(array(self._depth, "f4", 1)[..., 0]),
            np.ascontiguousarray(array(self._ids, "i4", 1)[..., 0]),
            np.ascontiguousarray(array(self._normals, "f4", 4)[..., :3]),
        )


def _glsl(name: str) -> str:
    return resources.files("ligature.render").joinpath("glsl", name).read_text(encoding="utf-8")


def _colour(material: Material | None) -> Colour:
    """The colours of a mesh file's material."""
    if material is None:
        return Colour()
    return Colour(
        diffuse=material.diffuse,
        ambient=material.ambient,
        specular=material.specular,
        shininess=int(material.shininess),
        alpha=material.alpha,
    )


def _distance(pose: Array, view: CameraView) -> float:
    """Depth of a pose's origin in front of the eye."""
    return -float(view.view[2, :3] @ pose[:3] + view.view[2, 3])


def _spline(rod: RodChain, poses: Array) -> Array:
    """Points (n, 3) of a C1 spline through the element centres and the two free ends."""
    from scipy.interpolate import CubicSpline

    elements = poses[list(rod.bodies)]
    centres = elements[:, :3]
    axes = np.array([pose7_matrix(p)[:3, 2] for p in elements[[0, -1]]])
    if len(centres) > 1:
        axes[0] *= np.sign(axes[0] @ (centres[0] - centres[1])) or 1.0
        axes[1] *= np.sign(axes[1] @ (centres[-1] - centres[-2])) or 1.0
    ends = centres[[0, -1]] + 0.5 * np.asarray(rod.lengths)[[0, -1], None] * axes
    knots = np.vstack([ends[:1], centres, ends[1:]])
    chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(knots, axis=0), axis=1) + 1e-12)])
    fine = np.linspace(0.0, chord[-1], SPLINE_POINTS * len(knots))
    points: Array = CubicSpline(chord, knots)(fine)
    return points
