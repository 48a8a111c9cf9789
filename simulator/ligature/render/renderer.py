"""Draws one camera's view of a scene from a state record: colour, linear depth, ids, normals, motion.

Inputs in world axes and metres. Ids are 1 + body index; ghosts follow the bodies; 0 is background.
"""

from __future__ import annotations

import gc
import weakref
from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace
from functools import partial

import moderngl
import numpy as np
from numpy.typing import NDArray

from ligature.adf import AdfError, Resolver
from ligature.model.poses import pose7_matrices
from ligature.model.scene import Scene
from ligature.model.shapes import ShaderFiles
from ligature.render.batches import Batch, Instances, Seen
from ligature.render.camera import CameraView
from ligature.render.context import create_context, depth_copier, draws_on_processor, finish_of
from ligature.render.kept import NOTED, Keeper, Kept, is_still
from ligature.render.lights import Lights, LightSettings, ShadowView
from ligature.render.look import Look, brighter, tinted
from ligature.render.movement import Movement
from ligature.render.outlines import smoothed
from ligature.render.painter import Brushes, Painter
from ligature.render.points import computed_points
from ligature.render.programs import Programs
from ligature.render.rays import volume_rays
from ligature.render.sky import Sky
from ligature.render.surface import Physical, Surface, surface_of
from ligature.render.target import PASSES, Exposure, Frame, Target, developed
from ligature.render.textures import Textures
from ligature.render.thread import Tube
from ligature.render.tissue import Marks, tissue_surfaces
from ligature.render.visuals import Piece, VisualLoader
from ligature.render.volume import volume_surfaces

Array = NDArray[np.float64]

BACKGROUND = (0.02, 0.02, 0.03, 1.0)
SAMPLES = 4
"""Samples a pixel of the colour picture on a GPU."""

COARSE_BELOW = 24.0
"""Radius in pixels below which the low-resolution mesh of an object is drawn."""

THREAD = Physical(roughness=0.45)
"""Reflectance of a thread whose material does not ask for another: the sheen of silk or a coated filament."""

MAX_TARGETS = 16
"""Frame buffers, one for each size and choice of passes, that are kept for the next picture."""

PLACES = ("body_pose", "ghost_world", "light_world", "tissue_node", "volume_value")
"""Fields of the state that move or deform objects, and with them their shadows, for all cameras alike."""

LARGE = 2.0
"""Radius in metres above which a piece is ground or wall and does not set the extent of shadow maps."""


_alive: weakref.WeakSet[Renderer] = weakref.WeakSet()


class Renderer:
    """Everything that is drawn of one scene; `render` takes pictures of it.

    Parameters
    ----------
    scene
        What to draw.
    samples
        Samples a pixel of the colour picture; 0 draws colour without anti-aliasing, in one pass with the rest.
        When not given, 4 on a GPU; on a software rasteriser colour is drawn as with 0 and its edges smoothed after.
    context
        The OpenGL context of a window; one without a display when not given, which goes with the renderer.
    """

    def __init__(self, scene: Scene, samples: int | None = None, context: moderngl.Context | None = None) -> None:
        self._scene = scene
        if _alive:
            gc.collect()  # Python counts its own objects, not the tens of megabytes behind a dropped renderer
        self._context = context or create_context()
        self._end = None if context else weakref.finalize(self, self._context.release)
        _alive.add(self)
        self._finish, self._copy = finish_of(self._context), depth_copier(self._context)
        self._smoothed = samples is None and draws_on_processor(self._context)
        wanted = SAMPLES if samples is None else samples
        self._samples = 0 if self._smoothed else min(wanted, self._context.max_samples)
        self._programs = Programs(self._context)
        loader = VisualLoader(scene.roots)
        self.problems: list[AdfError] = loader.problems
        self._textures = Textures(self._context, self.problems)
        self._targets: list[Target] = []
        self._exposures: weakref.WeakSet[Exposure] = weakref.WeakSet()
        self._lights = Lights(self._context, scene)
        pieces = loader.of_scene(scene)
        self._tissues = tissue_surfaces(scene, pieces)
        self._rays = volume_rays(self._context, scene, pieces, self.problems)
        marched = {rays.piece.owner for rays in self._rays}
        self._volumes = volume_surfaces(scene, [piece for piece in pieces if piece.owner not in marched])
        self._marks = [Marks(scene, tissue) for tissue in scene.tissues]
        self._tubes = [Tube(scene, rod) for rod in scene.rods]
        self._in_world = [t.body for t in scene.tissues] + [rod.bodies[0] for rod in scene.rods]
        replaced = [s.piece for s in self._volumes] + [r.piece for r in self._rays]
        apart = {tissue.body for tissue in scene.tissues} | {piece.owner for piece in replaced}
        rigid = [piece for piece in pieces if piece.owner not in apart] + replaced
        deforming = [*(surface.piece for surface in self._tissues), *self._rod_pieces(loader)]
        self._batches, ordered = self._batched([*rigid, *deforming])
        self._surfaces = [batch.surface for batch in self._batches]
        first = len(self._batches) - len(deforming)
        self._deforming = self._batches[first:]
        replacing = self._batches[first - len(replaced) : first]
        self._cut = replacing[: len(self._volumes)]
        for batch, rays in zip(replacing[len(self._volumes) :], self._rays, strict=True):
            batch.rays = rays
        for batch in self._deforming[: len(self._tissues)]:
            batch.marks = np.zeros((0, 8))
        self._instances = Instances(ordered)
        self.drawn_triangles = 0
        """Triangles of the last picture, what lies outside it and what is drawn coarsely taken off."""
        resolver = Resolver(scene.roots) if scene.roots else None
        self._brushes = Brushes(self._context, self._programs, self._textures, self._lights, resolver, self.problems)
        self._keeper = Keeper(self._context, self._lights)
        self._brushes.prepare(batch.shaders for batch in self._batches)
        self._brushes.prepare(camera.preprocessing_shaders for camera in scene.cameras)
        self._sky = Sky.of(self._context, scene, resolver, self.problems)
        if self._sky is not None:
            self._textures.around = self._sky.cube
        self._movement = Movement()
        self._placed = b""
        """Moment at which everything stands."""

    @property
    def lights(self) -> Lights:
        """The lights, whose settings may be changed between pictures."""
        return self._lights

    def change_look(self, look: Look) -> None:
        """Have the scene look otherwise from the next picture on; `Look` () is as its files state.

        Settings of lights that were changed meanwhile are lost.
        """
        stated = [LightSettings.of(light) for light in self._scene.lights[: len(self._lights.settings)]]
        factors = [*look.brightness, *[1.0] * len(stated)]
        self._lights.settings[:] = [brighter(light, factors[k]) for k, light in enumerate(stated)]
        self._keeper.forget()
        for batch, surface in zip(self._batches, self._surfaces, strict=True):
            tint = look.tints.get(batch.pieces[0].owner)
            batch.surface = surface if tint is None else tinted(surface, tint)

    @property
    def device(self) -> str:
        """What draws, in the driver's words."""
        with self._context:
            return str(self._context.info["GL_RENDERER"])

    @property
    def triangles(self) -> int:
        """Triangles of the whole scene, none of them culled."""
        return sum(len(batch.triangles.faces) * len(batch.pieces) for batch in self._batches)

    @property
    def kept_pictures(self) -> int:
        """Pictures of what stands still that are kept; other pictures begin with them on a software rasteriser."""
        return len(self._keeper)

    def render(
        self,
        state: NDArray[np.void],
        view: CameraView,
        passes: Sequence[str] = ("rgb", "depth", "ids", "normals"),
        shaders: ShaderFiles | None = None,
    ) -> Frame:
        """Draw ``state`` (one-element record) as seen by ``view``; only the ``passes`` that are named.

        ``shaders`` draw the colour of every object in place of its own, a camera's ``preprocessing shaders``;
        such a picture is not smoothed, since its colours may be labels. ``flow`` counts from the last picture
        of the same size that had this pass.
        """
        return self.expose(state, view, passes, shaders).frame()

    def expose(
        self,
        state: NDArray[np.void],
        view: CameraView,
        passes: Sequence[str] = ("rgb", "depth", "ids", "normals"),
        shaders: ShaderFiles | None = None,
    ) -> Exposure:
        """Begin the picture that `render` gives of ``state``, as seen by ``view``, with ``passes`` and ``shaders``.

        What happens to state and scene from now on does not change it.
        """
        with self._context:  # several renderers may live in one process; leaving it hands the work to the driver
            self._context.gc()
            target, colours = self._drawn(state, view, passes, shaders)
        exposure = Exposure(partial(self._read, target, colours))
        self._exposures.add(exposure)
        return exposure

    def _read(self, target: Target, colours: Callable[[NDArray[np.uint8]], NDArray[np.uint8]]) -> Callable[[], Frame]:
        """Copy the picture in ``target``, which is free for another one then; returns what develops the copy."""
        with self._context:
            self._finish()  # reading would wait as well, and hold up all other threads meanwhile
            readings = target.read()
            if not self._smoothed:  # Mesa would wait for all that is being drawn before it writes to them again
                self._targets.append(target)  # the newest come last
                del self._targets[:-MAX_TARGETS]
        return partial(developed, readings, colours)

    def _drawn(
        self, state: NDArray[np.void], view: CameraView, passes: Sequence[str], shaders: ShaderFiles | None
    ) -> tuple[Target, Callable[[NDArray[np.uint8]], NDArray[np.uint8]]]:
        """Draw the picture; returns its target, and the function to apply to its colours and alpha."""
        moment = b"".join(state[name].tobytes() for name in PLACES)
        self._place(state, moment)
        self._lights.place(pose7_matrices(state["light_world"][0]), view.view)
        target = self._target(view, passes, 0 if shaders else self._samples)
        seen = self._instances.seen(view.view, view.projection, view.height, COARSE_BELOW)
        casts = "rgb" in target.passes and self._aim_lights(seen)
        before = self._movement.before(self._instances, view, self._deforming) if "flow" in target.passes else None
        painter = Painter(self._context, self._brushes, self._batches, seen, view, before)
        apart = bool(self._samples) or painter.needs_colour_apart(shaders)
        kept = self._kept(painter, target, view, casts) if self._smoothed and not shaders and not apart else None
        if kept is not None:  # before shadows are cast: what is drawn would have to be finished first
            casters = [batch for batch in self._batches if batch.surface.opaque]
            stirred = self._keeper.stirred(moment, casters, self._instances)
            painter.begin_with(kept.begin(target, stirred, self._copy))
        if casts:
            self._cast_shadows(view, moment)
        self.drawn_triangles = painter.triangles
        if "rgb" in target.passes and painter.needs_depth_behind:
            opaque = self._target(view, ["depth"], 0)
            opaque.clear(BACKGROUND, apart=False)
            painter.paint_opaque(opaque.whole, ["depth"])
            painter.behind = opaque.texture("depth")
            self._targets.append(opaque)
        sky = self._sky if shaders is None else None
        if kept is None:
            target.clear(BACKGROUND, apart)
        if target.colour is not None and apart:
            painter.paint(target.colour, ["rgb"], shaders, sky)
            if target.geometry is not None:
                painter.paint(target.geometry, [name for name in target.passes if name != "rgb"])
        else:
            painter.paint(target.whole, target.passes)
            if sky is not None and target.behind is not None:
                sky.draw(target.behind, view)
        if not self._smoothed or shaders:
            return target, _colours
        return target, partial(smoothed, keyed=not painter.has_own_shaders)

    def points(self, depth: NDArray[np.float32], view: CameraView, shaders: ShaderFiles) -> NDArray[np.float32] | None:
        """What ``depth compute shaders`` make of linear ``depth`` (h, w): the x, y, z (h, w, 3) that they write.

        ``view`` is the camera that saw it, ``shaders`` names the shaders' files.
        None when the shaders cannot be used, which `problems` then states.
        """
        with self._context:
            program = self._brushes.own(shaders)
            return None if program is None else computed_points(self._context, program, depth, view)

    def release(self) -> None:
        """Give the OpenGL context back, unless it is a window's; nothing can be drawn any more.

        Pictures that are being drawn are finished.
        """
        for exposure in list(self._exposures):
            exposure.fetch()
        if self._end is not None:
            self._end()
        _alive.discard(self)

    def _rod_pieces(self, loader: VisualLoader) -> list[Piece]:
        """The rods as pieces in world axes, looking like their first element's material or ADF colours."""
        T_world_body = np.array([body.T_world_body for body in self._scene.bodies])
        pieces = []
        for rod, tube in zip(self._scene.rods, self._tubes, strict=True):
            visual = self._scene.bodies[rod.bodies[0]].visual
            surface = surface_of(visual.colour, loader.material(visual))
            surface = Surface(surface.colour, physical=surface.physical or THREAD)
            triangles = tube.triangles(T_world_body)
            pieces.append(
                Piece(id(rod), triangles, surface, rod.bodies[0], np.eye(4), True, None, visual.shaders, deforms=True)
            )
        return pieces

    def _batched(self, pieces: list[Piece]) -> tuple[list[Batch], list[Piece]]:
        """Pieces grouped into batches, and in the order of the groups; a deforming piece is alone in its group."""
        groups: dict[Hashable, list[Piece]] = {}
        for piece in pieces:
            key = (piece.geometry, piece.surface, piece.closed, piece.coarse, piece.shaders)
            groups.setdefault(key, []).append(piece)
        batches: list[Batch] = []
        ordered: list[Piece] = []
        for group in groups.values():
            batches.append(Batch(self._context, group, self._loadable(group[0].surface), len(ordered)))
            ordered += group
        return batches, ordered

    def _loadable(self, surface: Surface) -> Surface:
        """``surface`` without the pictures that cannot be loaded."""
        get = self._textures.get
        surface = replace(
            surface,
            texture=surface.texture if get(surface.texture) else None,
            normal_map=surface.normal_map if get(surface.normal_map) else None,
            occlusion_map=surface.occlusion_map if get(surface.occlusion_map) else None,
            sphere_map=surface.sphere_map if get(surface.sphere_map) else None,
        )
        look = surface.physical
        if look is not None:
            metallic = look.metallic_map if get(look.metallic_map) else None
            roughness = look.roughness_map if get(look.roughness_map) else None
            look = replace(look, metallic_map=metallic, roughness_map=roughness)
        return replace(surface, physical=look)

    def _place(self, state: NDArray[np.void], moment: bytes) -> None:
        """Set the transforms of ``state`` at ``moment``, once for all cameras that draw it."""
        for batch, drawn in zip(self._deforming, self._tissues, strict=False):
            batch.marks = self._marks[drawn.index].of(state)
        if moment == self._placed:
            return
        self._placed = moment
        T = pose7_matrices(np.concatenate([state[name][0] for name in PLACES[:2]]))
        nodes = state["tissue_node"][0]
        surfaces = [*(s.triangles(nodes) for s in self._tissues), *(tube.triangles(T) for tube in self._tubes)]
        T[self._in_world] = np.eye(4)  # what deforms stands in world axes
        self._instances.place(T)
        for batch, surface in zip(self._deforming, surfaces, strict=True):
            if surface is not batch.triangles:
                batch.load(surface)
                self._instances.reach(batch.rows.start, surface)
        for batch, volume in zip(self._cut, self._volumes, strict=True):
            cut = volume.update(state["volume_value"][0])
            if cut is not batch.triangles:
                batch.load(cut)
                self._instances.reach(batch.rows.start, cut)
        for rays in self._rays:
            rays.update(state["volume_value"][0])

    def _kept(self, painter: Painter, target: Target, view: CameraView, casts: bool) -> Kept | None:
        """What is kept of the picture of ``view`` that is to be drawn to ``target``."""
        if "rgb" not in target.passes or "flow" in target.passes or painter.needs_depth_behind:
            return None
        keepable = painter.keepable(self._instances)
        if not keepable:
            return None

        def draw(blank: Target, buffer: moderngl.Framebuffer) -> None:
            if casts:
                self._cast_shadows(view, None)
            buffer.clear()
            blank.clear(BACKGROUND, apart=False)
            painter.paint_opaque(buffer, [*target.passes, *NOTED], only=keepable)

        picture = view.view.tobytes(), view.projection.tobytes()
        return self._keeper.kept(target, picture, keepable, self._instances, draw)

    def _aim_lights(self, seen: Seen) -> bool:
        """Have the lights look at what may throw shadows into the picture; whether there is anything."""
        if "SHADOWS" not in self._lights.defines or not seen.mask.any():
            return False
        small = self._instances.radii < LARGE
        near = seen.mask & small if (seen.mask & small).any() else seen.mask
        scene = self._instances.around(small if small.any() else near)
        self._lights.aim(scene, self._instances.around(near))
        return True

    def _cast_shadows(self, view: CameraView, moment: bytes | None) -> None:
        """Draw the shadow maps of the state at ``moment``, or without one, of what stands still."""
        context = self._context
        context.enable_only(moderngl.DEPTH_TEST)
        context.polygon_offset = (1.5, 2.0)
        self._lights.cast(self._draw_shadows, view.view, self._instances.standing, moment)
        context.polygon_offset = (0.0, 0.0)

    def _draw_shadows(self, shadow: ShadowView, still: bool) -> None:
        """Draw what casts shadows and stands still, or moves."""
        view, projection = shadow.view, shadow.projection
        meshes = self._programs.get("shadow", {})
        meshes.write("uProjection", projection)
        seen = self._instances.seen(view, projection, shadow.size, COARSE_BELOW)
        for batch in self._batches:
            rows = seen.rows(batch)
            if not len(rows) or not batch.surface.opaque or is_still(batch, self._instances) is not still:
                continue
            if batch.rays is None:
                batch.draw(meshes, seen.instances[rows])
                continue
            program = self._programs.get("shadow", batch.rays.defines)
            program.write("uProjection", projection)
            batch.rays.bind(program)
            self._context.enable(moderngl.CULL_FACE)
            batch.draw(program, seen.instances[rows])
            self._context.disable(moderngl.CULL_FACE)

    def _target(self, view: CameraView, passes: Sequence[str], samples: int) -> Target:
        unknown = set(passes) - set(PASSES)
        if unknown or not passes:
            raise ValueError(f"{sorted(unknown) or 'no pass'} cannot be drawn; choose one of {', '.join(PASSES)}")
        size, wanted = (view.width, view.height), [name for name in PASSES if name in passes]
        for target in reversed(self._targets):
            if (target.size, target.passes, target.samples) == (size, wanted, samples):
                self._targets.remove(target)
                return target
        most = self._context.info["GL_MAX_TEXTURE_SIZE"]
        if not (0 < view.width <= most and 0 < view.height <= most):
            raise ValueError(f"a picture cannot be {view.width} x {view.height}: each is 1 to {most} pixels here")
        try:
            return Target(self._context, size, passes, samples)
        except (moderngl.Error, MemoryError) as error:
            words = f"not enough memory for a picture of {view.width} x {view.height} pixels: {error}"
            raise ValueError(words) from None


def _colours(rgba: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return rgba[..., :3]
