"""Paints what a frustum holds into a frame buffer, with built-in programs or those of scene files."""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterable, Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from ligature.adf import AdfError, Resolver
from ligature.model.shapes import ShaderFiles
from ligature.model.state import MAX_PUNCTURES
from ligature.render import legacy
from ligature.render.batches import Batch, Instances, Seen
from ligature.render.camera import CameraView
from ligature.render.kept import NOTED, Begun, is_still
from ligature.render.lights import Lights
from ligature.render.programs import Program, Programs
from ligature.render.sky import Sky
from ligature.render.surface import Surface
from ligature.render.textures import Textures

Array = NDArray[np.float64]


class Brushes:
    """Programs, textures and lights that pictures are painted with; ``problems`` takes shaders that cannot be used."""

    def __init__(
        self,
        context: moderngl.Context,
        programs: Programs,
        textures: Textures,
        lights: Lights,
        resolver: Resolver | None,
        problems: list[AdfError],
    ) -> None:
        self._context, self._programs, self.textures, self.lights = context, programs, textures, lights
        self._resolver, self._problems = resolver, problems
        self._own: dict[ShaderFiles, Program | None] = {}
        self._built_in: dict[Hashable, Program] = {}

    def prepare(self, shaders: Iterable[ShaderFiles | None]) -> None:
        """Compile programs of scene files, so that what is wrong with them is known before the first picture."""
        for files in shaders:
            self.own(files)

    def own(self, files: ShaderFiles | None) -> Program | None:
        """The program of a scene file; None when there is none or it cannot be used."""
        if files is not None and files not in self._own:
            resolver = self._resolver or Resolver([files.vertex.parent, files.fragment.parent])
            try:
                self._own[files] = legacy.compiled(self._context, files, resolver)
            except AdfError as error:
                self._problems.append(error)
                self._own[files] = None
        return None if files is None else self._own[files]

    def built_in(self, batch: Batch, passes: Sequence[str]) -> Program:
        """The program that writes ``passes`` of ``batch``; colour alone is drawn by facets, with smooth edges."""
        rays = None if batch.rays is None else batch.rays.opaque
        kind = batch.surface.defines, batch.marks is None, batch.deforms, rays, batch.primitive and batch.primitive[0]
        key = tuple(passes), tuple(self.lights.defines.values()), kind
        if key not in self._built_in:
            self._built_in[key] = self._programs.get("surface", self._defines(batch, passes))
        return self._built_in[key]

    def _defines(self, batch: Batch, passes: Sequence[str]) -> dict[str, int]:
        """Features of the shaders that write ``passes`` of ``batch``."""
        defines = {f"PASS_{name.upper()}": place for place, name in enumerate(passes)} | {"LIGHTS": 1}
        if "rgb" in passes:
            defines |= self.lights.defines | dict.fromkeys(batch.surface.defines, 1)
            if batch.marks is not None:
                defines["MARKS"] = MAX_PUNCTURES
        if batch.deforms and "flow" in passes:
            defines["DEFORMS"] = 1
        if batch.rays is not None:
            defines |= batch.rays.defines
        if batch.primitive is not None and set(passes) - set(NOTED) != {"rgb"}:
            defines["ANALYTIC"] = batch.primitive[0]
        return defines


class Painter:
    """One picture while it is painted."""

    def __init__(
        self,
        context: moderngl.Context,
        brushes: Brushes,
        batches: Sequence[Batch],
        seen: Seen,
        view: CameraView,
        before: NDArray[np.float32] | None = None,
    ) -> None:
        self._context, self._brushes, self._seen, self._view = context, brushes, seen, view
        self._before = before
        self.behind: moderngl.Texture | None = None
        """Depth of all that is opaque, for the colours of volumes with a transfer function."""
        self._begun = Begun()
        self._ready: set[Program] = set()
        self._calls = [(batch, rows) for batch in batches if len(rows := seen.rows(batch))]

    @property
    def triangles(self) -> int:
        """Triangles of all that is seen."""
        return sum(len(batch.triangles.faces) * len(rows) for batch, rows in self._calls)

    def needs_colour_apart(self, shaders: ShaderFiles | None) -> bool:
        """Whether colour cannot be written together with the rest: by blending, or by scene files' programs."""
        own = self._brushes.own
        return any(not b.opaque or own(shaders) or own(b.shaders) for b, _ in self._calls)

    def begin_with(self, begun: Begun) -> None:
        """Draw what is kept, with which the picture begins, only where it is to be drawn again."""
        self._begun = begun

    def keepable(self, instances: Instances) -> frozenset[Batch]:
        """Batches in the picture that look as before until something throws a shadow on them."""
        return frozenset(
            batch
            for batch, _ in self._calls
            if batch.opaque
            and batch.marks is None
            and is_still(batch, instances)
            and not self._brushes.own(batch.shaders)
        )

    @property
    def needs_depth_behind(self) -> bool:
        """Whether the colour of something depends on how far away lies what is behind it."""
        return any(batch.rays is not None and not batch.rays.opaque for batch, _ in self._calls)

    @property
    def has_own_shaders(self) -> bool:
        """Whether programs of scene files draw something."""
        return any(self._brushes.own(batch.shaders) for batch, _ in self._calls)

    def paint(
        self,
        buffer: moderngl.Framebuffer,
        passes: Sequence[str],
        shaders: ShaderFiles | None = None,
        sky: Sky | None = None,
    ) -> None:
        """Draw ``passes``: the opaque from near to far, ``sky``, then the transparent from far to near.

        Middles decide what is near: a table's nearest point is often nearer than all that lies on it.
        """
        context, seen = self._context, self._seen
        self.paint_opaque(buffer, passes, shaders)
        if sky is not None:
            sky.draw(buffer, self._view)
        clear = [(batch, row) for batch, rows in self._calls if not batch.opaque for row in rows]
        if clear and "rgb" in passes:
            context.enable(moderngl.BLEND)
            buffer.depth_mask = False
        for batch, row in sorted(clear, key=lambda call: -float(seen.depth[call[1]])):
            self._draw(batch, passes, np.array([row]), shaders)
        buffer.depth_mask = True

    def paint_opaque(
        self,
        buffer: moderngl.Framebuffer,
        passes: Sequence[str],
        shaders: ShaderFiles | None = None,
        only: Collection[Batch] | None = None,
    ) -> None:
        """Draw ``passes`` of the opaque, or of those that are named ``only``, from near to far."""
        self._context.enable_only(moderngl.DEPTH_TEST)
        buffer.use()
        opaque = [(batch, rows) for batch, rows in self._calls if batch.opaque and (only is None or batch in only)]
        for batch, rows in sorted(opaque, key=lambda call: float(self._seen.depth[call[1]].min())):
            if batch not in self._begun.kept:
                self._draw(batch, passes, rows, shaders)
            elif (faces := self._begun.again.get(batch)) is not None:
                buffer.scissor = self._begun.box
                self._draw(batch, passes, rows, shaders, faces)
                buffer.scissor = None  # type: ignore[assignment]

    def _draw(
        self,
        batch: Batch,
        passes: Sequence[str],
        rows: NDArray[np.int64],
        shaders: ShaderFiles | None,
        faces: NDArray[np.int32] | None = None,
    ) -> None:
        (self._context.enable if batch.closed else self._context.disable)(moderngl.CULL_FACE)
        if "rgb" in passes:
            own = self._brushes.own(shaders) or self._brushes.own(batch.shaders)
            if own is not None:
                self._draw_own(own, batch, rows)
                return
        program = self._brushes.built_in(batch, passes)
        if program not in self._ready:
            self._bind_picture(program, passes)
            self._ready.add(program)
        if batch.rays is not None:
            batch.rays.bind(program, self.behind)
        if batch.primitive is not None:
            program.set("uShape", batch.primitive[1:])
        if "rgb" in passes:
            program.set("uClosed", int(batch.closed))
            bind_surface(program, batch.surface, self._brushes.textures)
            if batch.marks is not None:
                bind_marks(program, batch.marks, self._view.view)
        before = None if self._before is None else self._before[rows]
        batch.draw(program, self._seen.instances[rows], before, faces)

    def _bind_picture(self, program: Program, passes: Sequence[str]) -> None:
        """Fill the uniforms of a built-in program that are the same for the whole picture."""
        view = self._view
        program.write("uProjection", view.projection)
        program.set("uHalfSize", (view.width / 2, view.height / 2))
        if "rgb" in passes:
            self._brushes.lights.bind(program)
            program.write("uWorldFromEye", view.view[:3, :3].T)

    def _draw_own(self, program: Program, batch: Batch, rows: NDArray[np.int64]) -> None:
        """Draw with a scene file's program, which knows no instances."""
        view, brushes = self._view, self._brushes
        if program not in self._ready:
            legacy.bind_picture(program, legacy.Fixed(view.view, view.projection, brushes.lights))
            self._ready.add(program)
        legacy.bind_surface(program, batch.surface, brushes.textures, brushes.lights)
        for row in rows:
            model_view = self._seen.instances["model_view"][row].T.astype(float)
            legacy.bind_object(program, model_view, view.projection)
            batch.legacy(program).render()


def bind_marks(program: Program, marks: Array, view: Array) -> None:
    """Fill the uniforms of dark places (n, 8) in world axes, as seen through ``view`` (4, 4)."""
    places, axes = np.zeros((2, MAX_PUNCTURES, 4))
    count = len(marks)
    places[:count] = marks[:, :4]
    places[:count, :3] = marks[:, :3] @ view[:3, :3].T + view[:3, 3]
    axes[:count, :3], axes[:count, 3] = marks[:, 4:7] @ view[:3, :3].T, marks[:, 7]
    program.set("uMarkCount", count)
    program.set("uMarks", [tuple(row) for row in places.tolist()])
    program.set("uMarkAxes", [tuple(row) for row in axes.tolist()])


def bind_surface(program: Program, surface: Surface, textures: Textures) -> None:
    """Fill the material's uniforms of a built-in program."""
    colour, look = surface.colour, surface.physical
    program.set("uAmbient", colour.ambient)
    program.set("uDiffuse", colour.diffuse)
    program.set("uSpecular", colour.specular)
    program.set("uEmission", colour.emission)
    program.set("uShininess", float(max(colour.shininess, 1)))
    program.set("uAlpha", colour.alpha)
    maps = {"uTexture": surface.texture, "uNormalMap": surface.normal_map, "uOcclusionMap": surface.occlusion_map}
    if look is not None:
        program.set("uMetallic", look.metallic)
        program.set("uRoughness", look.roughness)
        program.set("uCoat", look.coat)
        program.set("uCoatRoughness", look.coat_roughness)
        maps |= {"uMetallicMap": look.metallic_map, "uRoughnessMap": look.roughness_map}
    for unit, (name, path) in enumerate(maps.items()):
        texture = textures.get(path)
        if texture is not None:
            texture.use(unit)
            program.set(name, unit)
