"""Authors how arms look: a large needle driver on its shaft, the housing above it, and a stereo endoscope.

Run ``python scenes/author_instruments.py`` to write the meshes again. Each is in the frame of its body: links of a PSM
as `author_suturing_small` defines them, the endoscope in that of CameraFrame, whose cameras look along -z. Metres.
Looks only: what touches is in the ADF files.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

from author_meshes import Solid, box, drawn, files, joined, loft, moved, rounded_bar, turned  # noqa: E402
from ligature.model.frames import pose_matrix  # noqa: E402

HERE = Path(__file__).resolve().parent / "suturing_small" / "high_res"
HALF_PI = np.pi / 2

SHAFT, SHAFT_LENGTH = 0.0042, 0.47
WRIST = 0.009
"""From the pitch axis to that of the jaws."""

JAW_LENGTH, JAW_WIDTH = 0.0096, 0.00125
ROWS, COLUMNS, TOOTH = 15, 4, 0.00013
"""Pyramids of the jaw's insert along and across it, and how high they stand."""

EYES, SCOPE, LENS_AT = 0.002, 0.0059, -0.05
"""Half the distance of the two lenses, radius of the endoscope, and where along z the cameras are."""

Array = np.ndarray


def along(axis: str, solid: Solid) -> Solid:
    """A solid made about Z, laid about another axis."""
    turn = {"X": (0.0, HALF_PI, 0.0), "Y": (-HALF_PI, 0.0, 0.0)}[axis]
    return moved(solid, pose_matrix((0, 0, 0), turn))


def shaft() -> dict[str, Solid]:
    """Tool roll link: a tube along z that ends in two ears about the wrist's pitch axis, y."""
    tube = turned([(SHAFT, -SHAFT_LENGTH), (SHAFT, -0.0125), (SHAFT * 0.97, -0.0122)], 28)
    collar = turned(
        [(SHAFT * 0.93, -0.0122), (SHAFT * 0.985, -0.0118), (SHAFT * 0.985, -0.0058), (0.0036, -0.0048)], 28
    )
    bar = rounded_bar(0.0027, 0.0062)
    ears = []
    for side in (-1.0, 1.0):
        low, high = sorted((side * 0.0023, side * 0.0035))
        ears.append(moved(drawn(bar, low, high), pose_matrix((0, 0, 0), (-HALF_PI, -HALF_PI, 0))))
    pin = along("Y", turned([(0.0009, -0.0037), (0.0011, -0.0035), (0.0011, 0.0035), (0.0009, 0.0037)], 12))
    return {"composite": tube, "steel": joined([collar, *ears, pin])}


def pulleys(radius: float, half: float, grooves: int = 2) -> Solid:
    """Grooved wheels about z, one beside the other."""
    profile = [(radius * 0.9, -half)]
    for z in np.linspace(-half, half, grooves + 1)[:-1]:
        width = 2 * half / grooves
        profile += [(radius, z + 0.12 * width), (radius * 0.8, z + 0.5 * width), (radius, z + 0.88 * width)]
    return turned([*profile, (radius * 0.9, half)], 20)


def wrist() -> dict[str, Solid]:
    """Tool pitch link: wheels about z at its origin, a body along x, and ears about the jaws' axis, y."""
    knuckle = pulleys(0.0026, 0.0021)

    def section(x: float, y: float, z: float) -> Array:
        c = 0.3
        corner = [
            (-y, -z * c),
            (-y * c, -z),
            (y * c, -z),
            (y, -z * c),
            (y, z * c),
            (y * c, z),
            (-y * c, z),
            (-y, z * c),
        ]
        return np.array([(x, a, b) for a, b in corner])

    body = loft([
        section(0.0, 0.0020, 0.0019), section(0.0030, 0.0024, 0.0021), section(0.0048, 0.0032, 0.0025),
        section(0.0063, 0.0032, 0.0025),
    ])  # fmt: skip
    bar = rounded_bar(0.0025, 0.0035)
    T = pose_matrix((WRIST, 0, 0), (HALF_PI, 0, 0))
    ears = [moved(drawn(bar, *sorted((side * 0.0020, side * 0.0032))), T) for side in (-1.0, 1.0)]
    pin = along("Y", turned([(0.0008, -0.0034), (0.001, -0.0032), (0.001, 0.0032), (0.0008, 0.0034)], 12))
    return {"steel": joined([knuckle, body, *ears, moved(pin, pose_matrix((WRIST, 0, 0), (0, 0, 0)))])}


def hub() -> dict[str, Solid]:
    """Tool yaw link: the wheels about z of both jaws."""
    return {"steel": pulleys(0.0019, 0.0019, 4)}


def teeth() -> Solid:
    """The face of the insert in the plane x = 0: pyramids, as a file's."""
    y = np.linspace(0.0026, JAW_LENGTH - 0.0003, ROWS + 1)
    points, faces = [], []
    for i in range(ROWS):
        half = 0.92 * width_at((y[i] + y[i + 1]) / 2)
        z = np.linspace(-half, half, COLUMNS + 1)
        for j in range(COLUMNS):
            corners = [(y[i], z[j]), (y[i + 1], z[j]), (y[i + 1], z[j + 1]), (y[i], z[j + 1])]
            n = len(points)
            points += [(-TOOTH, a, b) for a, b in corners]
            points.append((0.0, (y[i] + y[i + 1]) / 2, (z[j] + z[j + 1]) / 2))
            faces += [(n + k, n + (k + 1) % 4, n + 4) for k in range(4)]
    return np.array(points), np.array(faces)


def width_at(y: float) -> float:
    """Half width of a jaw across, narrower towards its end."""
    return JAW_WIDTH * (1.0 - 0.22 * np.clip(y / JAW_LENGTH, 0.0, 1.0) ** 2)


def jaw() -> dict[str, Solid]:
    """One jaw: a wheel about z, a blade along y behind the plane x = 0, and the insert on that plane."""

    def section(y: float, outer: float, inner: float, low: float, high: float, c: float = 0.55) -> Array:
        """An outline across the blade: flat towards the other jaw, rounded at its back."""
        middle, half = (low + high) / 2, (high - low) / 2
        back = outer + 0.32 * (inner - outer)
        points = [
            (inner, low),
            (inner, high),
            (back, high),
            (outer, middle + c * half),
            (outer, middle - c * half),
            (back, low),
        ]
        return np.array([(a, y, b) for a, b in points])

    def blade(y: float, outer: float, inner: float = -TOOTH) -> Array:
        return section(y, outer, inner, -width_at(y), width_at(y))

    wheel = turned([(0.0018, 0.0001), (0.0022, 0.0003), (0.0022, 0.0014), (0.0018, 0.0016)], 18)
    body = loft([
        section(0.0, -0.0019, -0.0006, 0.0001, 0.0016), section(0.0014, -0.0020, -0.0004, -0.0006, 0.0014),
        blade(0.0026, -0.0019), blade(0.0060, -0.00155), blade(0.0088, -0.00115),
        section(JAW_LENGTH, -0.0007, -TOOTH, -0.7 * JAW_WIDTH, 0.7 * JAW_WIDTH),
    ])  # fmt: skip
    return {"steel": joined([wheel, body]), "carbide": teeth()}


def carriage() -> dict[str, Solid]:
    """Main insertion link: the instrument's housing, in which the shaft begins; z along the shaft."""
    shell = box((-0.027, -0.022, -0.115), (0.027, 0.022, -0.012), 0.006)
    nose = turned([(0.017, -0.013), (0.014, -0.004), (0.008, 0.012), (0.0055, 0.02)], 20)
    plate = box((-0.033, -0.028, -0.020), (0.033, 0.028, -0.010), 0.003)
    wings = [
        box((side * 0.031 - 0.004, -0.008, -0.09), (side * 0.031 + 0.004, 0.008, -0.05), 0.003) for side in (-1, 1)
    ]
    return {"housing": joined([shell, nose]), "trim": joined([plate, *wings])}


def boom() -> dict[str, Solid]:
    """Pitch end link, in the arm's base frame: the rail of the carriage, and the cannula at the remote centre."""
    rail = box((-0.022, 0.036, 0.055), (0.022, 0.068, 0.56), 0.007)
    slot = box((-0.007, 0.0335, 0.09), (0.007, 0.0375, 0.54), 0.001)
    foot = box((-0.012, 0.004, 0.052), (0.012, 0.062, 0.072), 0.004)
    tube = turned(
        [(0.0052, -0.022), (0.0058, -0.020), (0.0058, 0.045), (0.011, 0.056), (0.012, 0.074), (0.0095, 0.077)], 20
    )
    return {"housing": rail, "trim": joined([slot, foot]), "steel": tube}


def shoulder() -> dict[str, Solid]:
    """Yaw link, in the arm's base frame: what carries the boom."""
    case = box((-0.036, 0.070, 0.24), (0.036, 0.150, 0.47), 0.014)
    neck = moved(
        turned([(0.028, -0.05), (0.030, -0.045), (0.030, 0.045), (0.028, 0.05)]),
        pose_matrix((0, 0.11, 0.50), (0, 0, 0)),
    )
    return {"housing": case, "trim": neck}


def port() -> dict[str, Solid]:
    """Base link: the seal in the abdominal wall about the remote centre."""
    around = np.linspace(0, 2 * np.pi, 28, endpoint=False)
    ring = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    rows = []
    for a in around:
        r = 0.0105 + 0.0028 * np.cos(ring)
        rows.append(np.column_stack([r * np.cos(a), r * np.sin(a), 0.0028 * np.sin(ring)]))
    points, faces = loft([*rows, rows[0]], closed=False)
    return {"rubber": (points, faces[:, ::-1])}


def endoscope() -> dict[str, Solid]:
    """CameraFrame: a straight stereo endoscope whose end is just behind the cameras, and its camera head."""
    face = LENS_AT + 0.0006
    tube = turned([(SCOPE - 0.0006, face), (SCOPE, face + 0.0008), (SCOPE, 0.29)], 32)
    head = turned([(SCOPE, 0.285), (0.014, 0.30), (0.026, 0.315), (0.026, 0.43), (0.020, 0.445)], 24)
    windows = []
    for x, radius in ((-EYES, 0.0015), (EYES, 0.0015)):
        disc = turned([(radius, face - 0.0002), (radius, face + 0.0002)], 16)
        windows.append(moved(disc, pose_matrix((x, 0, 0), (0, 0, 0))))
    lights = [moved(turned([(0.0007, face - 0.0001), (0.0007, face + 0.0002)], 10), pose_matrix((0, y, 0), (0, 0, 0)))
              for y in (-0.0036, 0.0036)]  # fmt: skip
    return {"steel": tube, "glass": joined(windows), "housing": joined([head, *lights])}


def in_link(parts: dict[str, Solid], T_link_base: Array) -> dict[str, Solid]:
    """Solids of the arm's base frame in the frame of a link, the arm at zero."""
    return {material: moved(solid, T_link_base) for material, solid in parts.items()}


def meshes() -> dict[str, dict[str, Solid]]:
    """Every mesh by name, as solids by material."""
    T_base_yaw = pose_matrix((0, 0, 0), (HALF_PI, 0, 0)) @ pose_matrix((0, 0, 0), (0, 0, HALF_PI))
    T_base_pitch = T_base_yaw @ pose_matrix((0, 0, 0), (-HALF_PI, 0, 0)) @ pose_matrix((0, 0, 0), (0, 0, -HALF_PI))
    return {
        "psm_base": port(),
        "psm_yaw": in_link(shoulder(), np.linalg.inv(T_base_yaw)),
        "psm_pitch": in_link(boom(), np.linalg.inv(T_base_pitch)),
        "psm_insertion": carriage(),
        "psm_shaft": shaft(),
        "psm_wrist": wrist(),
        "psm_hub": hub(),
        "psm_jaw": jaw(),
        "endoscope": endoscope(),
    }


def texts() -> dict[str, str]:
    """Text of every mesh and material file by name."""
    return files(meshes(), Path(__file__).name)


def main() -> None:
    """Write everything."""
    HERE.mkdir(parents=True, exist_ok=True)
    for name, text in texts().items():
        (HERE / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
