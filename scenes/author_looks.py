"""Authors how `suturing_small` looks: a pad of tissue with a wound and ink marks where stitches go, and a needle.

Run ``python scenes/author_looks.py`` to write the meshes, their materials and pictures again; the same seed gives the
same tissue. Lengths in metres in the frames of the bodies; pictures cover the pad's upper face, 0.2 mm a pixel.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

HERE = Path(__file__).resolve().parent / "suturing_small" / "high_res"
SIZE = (0.1, 0.2, 0.03)
PIXEL = 0.0002
SEED = 7
WOUND_LENGTH, WOUND_WIDTH = 0.11, 0.0022
MARKS = [(side * 0.006, y) for y in (-0.04, -0.0133, 0.0133, 0.04) for side in (-1.0, 1.0)]
"""Where stitches enter and leave, beside the wound, which runs along Y through the middle."""

NEEDLE_RADIUS, NEEDLE_THICKNESS = 0.0097, 0.0004
NEEDLE_START, NEEDLE_END = np.radians(175.0), np.radians(45.0)
RINGS, SIDES, POINT = 49, 12, 0.18
"""Detail of the needle's mesh, and the share of its length that tapers to the point."""

Array = np.ndarray


def noise(rng: np.random.Generator, shape: tuple[int, int], wavelength: float, slope: float) -> Array:
    """Random relief of zero mean and unit spread whose spectrum falls off beyond ``wavelength`` (in pixels)."""
    fy, fx = np.meshgrid(np.fft.fftfreq(shape[0]), np.fft.rfftfreq(shape[1]), indexing="ij")
    f = np.hypot(fy, fx) * wavelength
    spectrum = np.fft.rfft2(rng.standard_normal(shape)) / (1.0 + f**2) ** (slope / 2)
    spectrum[0, 0] = 0.0
    relief = np.fft.irfft2(spectrum, s=shape)
    return relief / relief.std()


def step(distance: Array, softness: float) -> Array:
    """0 where ``distance`` is well below zero, 1 well above."""
    return 0.5 + 0.5 * np.tanh(distance / (2.0 * softness))


def places() -> tuple[Array, Array]:
    """Coordinates x and y (rows, columns) of every pixel; row 0 is the upper edge of the picture, +Y."""
    columns, rows = round(SIZE[0] / PIXEL), round(SIZE[1] / PIXEL)
    x = (np.arange(columns) + 0.5) * PIXEL - SIZE[0] / 2
    y = SIZE[1] / 2 - (np.arange(rows) + 0.5) * PIXEL
    return np.meshgrid(x, y)


def tissue() -> tuple[Array, Array]:
    """Colour (rows, columns, 3) 0..1 and height (rows, columns) in metres of the pad."""
    rng = np.random.default_rng(SEED)
    x, y = places()
    broad, fine, grain = (noise(rng, x.shape, w, s) for w, s in ((180, 3.5), (40, 3.0), (9, 3.0)))
    vessels = sum(
        np.exp(-((noise(rng, x.shape, w, 4.0) / d) ** 2)) * a for w, d, a in ((160, 0.03, 0.8), (80, 0.035, 0.5))
    )
    colour = np.array([0.80, 0.47, 0.43]) + 0.030 * broad[..., None] + np.array([0.025, 0.035, 0.03]) * fine[..., None]
    colour -= np.clip(vessels, 0, 1)[..., None] * np.array([0.16, 0.20, 0.16])
    height = 1.2e-4 * broad + 5e-5 * fine + 3.5e-5 * grain + 4e-5 * np.clip(vessels, 0, 1)

    width = WOUND_WIDTH * np.clip(1.0 - (2 * y / WOUND_LENGTH) ** 2, 0.0, 1.0) * (1.0 + 0.12 * broad)
    gap = np.abs(x + 4e-4 * np.sin(y * 160.0)) - width / 2
    inside = step(-gap, 1.5e-4) * (width > 1e-4)
    rim = np.exp(-((gap / 1.6e-3) ** 2)) * (width > 1e-4)
    colour = colour * (1 - 0.45 * rim[..., None] * np.array([0.15, 0.9, 0.8]))
    colour = colour * (1 - inside[..., None]) + inside[..., None] * np.array([0.26, 0.03, 0.03])
    height += 4e-4 * rim - 1.4e-3 * inside

    for mx, my in MARKS:
        r = np.hypot(x - mx, y - my)
        hole = step(5e-4 - r, 6e-5)
        ring = np.exp(-(((r - 1.3e-3) / 2.8e-4) ** 2))
        colour = colour * (1 - 0.8 * ring[..., None]) + 0.8 * ring[..., None] * np.array([0.16, 0.10, 0.32])
        colour = colour * (1 - hole[..., None]) + hole[..., None] * np.array([0.12, 0.01, 0.01])
        height -= 6e-4 * hole
    return np.clip(colour, 0, 1), height


def normal_map(height: Array) -> Array:
    """Unit normals (rows, columns, 3) of a relief, x right and y up in the picture."""
    down, right = np.gradient(height, PIXEL)
    n = np.stack([-right, down, np.ones_like(height)], axis=-1)
    return n / np.linalg.norm(n, axis=-1, keepdims=True)


def pictures() -> dict[str, Array]:
    """The pictures of the material, uint8."""
    colour, height = tissue()
    return {
        "tissue.jpg": (255 * colour + 0.5).astype(np.uint8),
        "tissue_relief.jpg": (127.5 + 127.5 * normal_map(height)).astype(np.uint8),
    }


def pad() -> tuple[str, str]:
    """Mesh and material of the pad: an upper face with the pictures, sides of plain flesh."""
    x, y, z = (s / 2 for s in SIZE)
    corners = [(sx * x, sy * y, sz * z) for sz in (-1, 1) for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    sides = {(0, -1, 0): (1, 2, 6, 5), (1, 0, 0): (2, 3, 7, 6), (0, 1, 0): (3, 4, 8, 7), (-1, 0, 0): (4, 1, 5, 8),
             (0, 0, -1): (4, 3, 2, 1)}  # fmt: skip
    lines = [f"v {a:g} {b:g} {c:g}" for a, b, c in corners]
    lines += ["vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1", "vn 0 0 1"]
    lines += [f"vn {a} {b} {c}" for a, b, c in sides]
    lines += ["usemtl tissue", "f 5/1/1 6/2/1 7/3/1 8/4/1", "usemtl flesh"]
    lines += [f"f {' '.join(f'{v}//{n}' for v in face)}" for n, face in enumerate(sides.values(), 2)]
    wet = "Ks 0.3 0.3 0.3\nNs 60\nPr 0.65\nPc 1\nPcr 0.2\n"
    tissue_material = f"newmtl tissue\nKd 1 1 1\n{wet}map_Kd tissue.jpg\nmap_Bump tissue_relief.jpg\n"
    return "\n".join(lines) + "\n", f"{tissue_material}newmtl flesh\nKd 0.72 0.36 0.33\n{wet}"


def needle() -> tuple[str, str]:
    """Mesh and material of the needle: a round wire along its arc, ground to a point."""
    along = np.linspace(0.0, 1.0, RINGS)
    angles = NEEDLE_START + (NEEDLE_END - NEEDLE_START) * along
    radius = NEEDLE_THICKNESS * np.sqrt(np.clip((1.0 - along) / POINT, 0.0025, 1.0))
    around = np.linspace(0, 2 * np.pi, SIDES, endpoint=False)
    out = np.stack([np.cos(angles), np.sin(angles), np.zeros(RINGS)], axis=1)
    normals = np.cos(around)[None, :, None] * out[:, None] + np.sin(around)[None, :, None] * np.array([0, 0, 1.0])
    points = NEEDLE_RADIUS * out[:, None] + radius[:, None, None] * normals
    lines = ["v {:.7f} {:.7f} {:.7f}".format(*p) for p in points.reshape(-1, 3)]
    lines += ["vn {:.5f} {:.5f} {:.5f}".format(*n) for n in normals.reshape(-1, 3)]
    lines.append("usemtl steel")
    index = 1 + np.arange(RINGS * SIDES).reshape(RINGS, SIDES)
    for i in range(RINGS - 1):
        for j in range(SIDES):
            face = (index[i, j], index[i + 1, j], index[i + 1, (j + 1) % SIDES], index[i, (j + 1) % SIDES])
            lines.append("f " + " ".join(f"{v}//{v}" for v in face[::1]))
    lines += ["f " + " ".join(f"{v}//{v}" for v in ring) for ring in (index[0], index[-1][::-1])]
    return "\n".join(lines) + "\n", "newmtl steel\nKd 0.80 0.80 0.81\nKs 0.5 0.5 0.5\nNs 300\nPm 1\nPr 0.22\n"


def files() -> dict[str, str]:
    """Text of every mesh and material file by name."""
    note = "# Written by scenes/author_looks.py\n"
    written = {}
    for name, (mesh, material) in {"block": pad(), "needle": needle()}.items():
        written[f"{name}.obj"] = f"{note}mtllib {name}.mtl\n{mesh}"
        written[f"{name}.mtl"] = note + material
    return written


def main() -> None:
    """Write everything."""
    HERE.mkdir(exist_ok=True)
    for name, text in files().items():
        (HERE / name).write_text(text, encoding="utf-8")
    for name, pixels in pictures().items():
        Image.fromarray(pixels).save(HERE / name, quality=88, subsampling=0, optimize=True)


if __name__ == "__main__":
    main()
