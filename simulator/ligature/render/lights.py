"""Lights of a scene in the shaders' format, in eye space, and their shadows.

A light shines along +X of its frame (as in AMBF). Metres and radians. Nothing here inverts by
`numpy.linalg`: it wakes OpenBLAS's threads even for four rows, and they spin for longer than a picture takes.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Hashable
from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import inverse
from ligature.model.scene import Light, Scene
from ligature.render.camera import perspective
from ligature.render.context import depth_copier
from ligature.render.programs import Program

Array = NDArray[np.float64]
Sphere = tuple[Array, float]

Cast = Callable[["ShadowView", bool], None]
"""Draws the casters of a shadow map: those that stand still, or those that move."""

MAX_LIGHTS, MAX_SHADOWS = 8, 2
SHADOW_SIZES = (0, 256, 512, 1024, 2048, 4096)
"""Edge of a shadow map in texels by the ADF's ``shadow quality``; other values mean the middle one."""

SHADOW_UNIT = 8
"""First texture unit of the shadow maps; surfaces use those below."""

WIDEST_SHADOW = np.radians(150.0)
"""Opening of the shadow map of a light that shines wider, 180 degrees having no projection."""


LIGHT_MODEL_AMBIENT, LIGHT_AMBIENT = 0.2, 0.15
"""Shares of a material's ambient colour that the scene gives, and that each light adds, to shaders of scene files: the
first is OpenGL's initial value, which AMBF leaves; with one light both make up what the built-in shader gives."""


class LightKind(enum.Enum):
    """Kinds that the run-time parameter ``type`` of a light may name; files know spot lights only."""

    SPOT = "SPOT"
    POINT = "POINT"
    DIRECTIONAL = "DIRECTIONAL"


@dataclass(frozen=True)
class LightSettings:
    """What of a light may change at run time: cutoff half angle in radians, the rest as in the ADF."""

    kind: LightKind = LightKind.SPOT
    cutoff: float = np.pi / 4
    exponent: float = 0.7
    attenuation: tuple[float, float, float] = (1.0, 0.0, 0.0)
    shadow_quality: int = 0

    @classmethod
    def of(cls, light: Light) -> LightSettings:
        """The settings that the scene gives a light."""
        cutoff = min(light.cutoff, np.pi / 2)
        return cls(LightKind.SPOT, cutoff, light.spot_exponent, light.attenuation, light.shadow_quality)

    @property
    def shadow_size(self) -> int:
        """Edge of its shadow map in texels, 0 for none; a point light, which shines all around, has none."""
        if self.kind is LightKind.POINT:
            return 0
        return SHADOW_SIZES[self.shadow_quality] if 0 <= self.shadow_quality < len(SHADOW_SIZES) else 1024


HEADLIGHT = LightSettings(cutoff=np.pi / 2)
"""Light at the eye for scenes without lights."""


@dataclass(frozen=True, eq=False)
class ShadowView:
    """What the shadow map of light ``index`` shows, ``size`` texels wide: its ``view`` and ``projection`` (4, 4)."""

    index: int
    size: int
    view: Array
    projection: Array


class Lights:
    """The lights of a scene: settings, and for each picture their places and shadow maps."""

    def __init__(self, context: moderngl.Context, scene: Scene) -> None:
        self._context = context
        self.settings = [LightSettings.of(light) for light in scene.lights[:MAX_LIGHTS]]
        self._headlight = not self.settings
        self._maps: dict[tuple[int, int], _ShadowMap] = {}
        self._shadows: list[tuple[int, _ShadowMap, Array]] = []
        self.shadow_views: list[ShadowView] = []

    @property
    def defines(self) -> dict[str, int]:
        """Shader features: how many lights, how many shadows."""
        shadows = sum(1 for s in self.settings if s.shadow_size)
        count = {"LIGHTS": max(len(self.settings), 1)}
        return {**count, "SHADOWS": min(shadows, MAX_SHADOWS)} if shadows else count

    def place(self, poses: Array, view: Array) -> None:
        """Put the lights at ``poses`` (n, 4, 4) in the world, seen through ``view`` (4, 4)."""
        self._T_world_light = poses[: len(self.settings)]
        self._used = self.settings
        if self._headlight:
            T_eye_light = np.eye(4)
            T_eye_light[:3, 0] = 0, 0, -1
            self._T_world_light, self._used = (inverse(view) @ T_eye_light)[None], [HEADLIGHT]
        self._T_eye_light = view @ self._T_world_light
        self.shadow_views = []

    def content(self) -> Hashable:
        """All that what the lights do depends on, apart from what throws shadows."""
        views = ((shadow.view.tobytes(), shadow.projection.tobytes()) for shadow in self.shadow_views)
        return tuple(self._used), self._T_world_light.tobytes(), *views

    def aim(self, scene: Sphere, seen: Sphere) -> None:
        """Set what the shadow maps show.

        Spheres are given by centre (3,) and radius, in world axes: casters and what is ``seen`` of their shadows lie
        within the second. A spot's map reaches for the whole ``scene`` and so is the same for both eyes.
        """
        self.shadow_views = []
        for index, settings in enumerate(self._used):
            if settings.shadow_size and len(self.shadow_views) < MAX_SHADOWS:
                sphere = scene if settings.kind is LightKind.SPOT else seen
                view, projection = light_camera(settings, self._T_world_light[index], *sphere)
                self.shadow_views.append(ShadowView(index, settings.shadow_size, view, projection))

    def cast(self, draw: Cast, view: Array, standing: Hashable, moment: bytes | None) -> None:
        """Draw the shadow maps, once for each ``moment`` at which casters move, and what stands still once.

        ``standing`` names all that stands still. Without a ``moment``, that alone casts shadows.
        """
        self._shadows = []
        for aimed in self.shadow_views:
            key = aimed.index, aimed.size
            if key not in self._maps:
                self._maps[key] = _ShadowMap(self._context, aimed.size)
            shadow = self._maps[key]
            shadow.show(aimed, draw, standing, moment)
            self._shadows.append((aimed.index, shadow, TO_TEXTURE @ aimed.projection @ aimed.view @ inverse(view)))
            shadow.spread = 2.0 / (abs(aimed.projection[0, 0]) * aimed.size)

    def bind(self, program: Program) -> None:
        """Fill the lights' uniforms of a built-in program; those that cast shadows come first."""
        casting = [index for index, _, _ in self._shadows]
        order = casting + [index for index in range(len(self._used)) if index not in casting]
        for place, index in enumerate(order):
            settings, T = self._used[index], self._T_eye_light[index]
            name, spot = f"uLights[{place}]", settings.kind is LightKind.SPOT
            directional = settings.kind is LightKind.DIRECTIONAL
            program.set(f"{name}.position", (*-T[:3, 0], 0.0) if directional else (*T[:3, 3], 1.0))
            program.set(f"{name}.direction", tuple(T[:3, 0]))
            program.set(f"{name}.attenuation", (1.0, 0.0, 0.0) if directional else settings.attenuation)
            program.set(f"{name}.cosCutoff", float(np.cos(settings.cutoff)) if spot else -2.0)
            program.set(f"{name}.exponent", settings.exponent if spot else 0.0)
        for unit, (_, shadow, _) in enumerate(self._shadows, SHADOW_UNIT):
            shadow.texture.use(unit)
            program.set(f"uShadowMap{unit - SHADOW_UNIT}", unit)
        if self._shadows:
            program.write("uShadowFromEye", np.array([matrix for _, _, matrix in self._shadows]))
            program.set("uShadowTexel", [(1.0 / shadow.size, shadow.spread) for _, shadow, _ in self._shadows])

    def eye_space(self) -> list[tuple[LightSettings, Array]]:
        """Settings and eye-space frame (4, 4) of every light."""
        return list(zip(self._used, self._T_eye_light, strict=True))

    def shadow(self) -> tuple[moderngl.Texture, Array] | None:
        """Map and matrix from eye space to its coordinates of the first light with a shadow."""
        return (self._shadows[0][1].texture, self._shadows[0][2]) if self._shadows else None


TO_TEXTURE = np.array([[0.5, 0, 0, 0.5], [0, 0.5, 0, 0.5], [0, 0, 0.5, 0.5], [0, 0, 0, 1]])
"""From clip coordinates -1..1 to texture coordinates and depth 0..1."""


def light_camera(settings: LightSettings, T_world_light: Array, centre: Array, radius: float) -> tuple[Array, Array]:
    """View and projection (4, 4) of a light that sees the sphere of ``radius`` about ``centre``."""
    x, y, z = T_world_light[:3, :3].T
    R = np.array([y, z, -x])  # eye axes: the light looks along its +X
    view = np.eye(4)
    view[:3, :3], origin = R, T_world_light[:3, 3]
    if settings.kind is LightKind.DIRECTIONAL:
        origin = centre - 2.0 * radius * x
        view[:3, 3] = -R @ origin
        projection = np.diag([1.0 / radius, 1.0 / radius, -1.0 / radius, 1.0])
        projection[2, 3] = -2.0
        return view, projection
    view[:3, 3] = -R @ origin
    depth = float((centre - origin) @ x)
    far = _step(max(depth + radius, 1e-3), np.ceil)
    near = max(_step(max(depth - radius, 1e-6), np.floor), far / 1000.0)
    return view, perspective(min(2.0 * settings.cutoff, WIDEST_SHADOW), 1.0, near, far)


def _step(distance: float, towards: Callable[[float], float]) -> float:
    """``distance`` in steps of 2 %, so that what stands still has the same depth for a light while others move."""
    return float(2.0 ** (towards(32.0 * np.log2(distance)) / 32.0))


class _ShadowMap:
    """Depth texture that is compared with while it is sampled, and another one of what stands still."""

    def __init__(self, context: moderngl.Context, size: int) -> None:
        self.size = size
        self.spread = 0.0
        self.texture, still = (context.depth_texture((size, size)) for _ in range(2))
        self.texture.compare_func = "<="
        self.texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        self.texture.repeat_x = self.texture.repeat_y = False
        self._whole, self._standing = (context.framebuffer(depth_attachment=t) for t in (self.texture, still))
        self._copy = depth_copier(context)
        self._shows: tuple[Hashable, ...] = ()
        self._stands: tuple[Hashable, ...] = ()

    def show(self, aimed: ShadowView, draw: Cast, standing: Hashable, moment: bytes | None) -> None:
        """Have it show what stands still, and what moves at a ``moment``."""
        stands = standing, aimed.view.tobytes(), aimed.projection.tobytes()
        if self._shows == (moment, *stands):
            return
        if self._copy is None:
            self._whole.use()
            self._whole.clear()
            draw(aimed, True)
        else:
            self._begin(aimed, draw, stands)
        if moment is not None:
            draw(aimed, False)
        self._shows = moment, *stands

    def _begin(self, aimed: ShadowView, draw: Cast, stands: tuple[Hashable, ...]) -> None:
        """Begin with what stands still, which is drawn when it is another than before."""
        assert self._copy is not None
        if self._stands != stands:
            self._standing.use()
            self._standing.clear()
            draw(aimed, True)
            self._stands = stands
        self._whole.use()
        self._copy(self._standing, self._whole)
