"""Draws every truth that the rod is tested against: the simulation beside the closed form.

    python tests/bench/suture_truths.py [FOLDER]

Writes `suture_truths.png` into FOLDER, default `docs/pictures`, and prints each error; about a minute.
SI units; figures in millimetres where they report it.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "suture"))
from conftest import DT, Bench, body, damped, energy, line  # noqa: E402
from ligature.model.frames import axis_rotation, pose7_matrix  # noqa: E402
from ligature.model.shapes import Cylinder
from ligature.suture.description import FREE, Attachment, RodDescription, from_material  # noqa: E402
from ligature.suture.rod import Rod  # noqa: E402
from scipy.integrate import solve_ivp  # noqa: E402
from scipy.optimize import brentq  # noqa: E402

matplotlib.use("Agg")
from matplotlib import pyplot as plt  # noqa: E402

DRAWN = Callable[[Any], str]
MEASURED, THEORY = {"color": "tab:blue", "label": "simulation"}, {"color": "black", "ls": "--", "label": "theory"}
ROUND, BAR = np.pi / 64, np.pi / 4


def _clamped(description: RodDescription, lost: float = 1 - 1e-12) -> Rod:
    rod = Bench([]).add(damped(description, lost))
    rod.hold_element(0)
    return rod


def _run(rod: Rod, ticks: int, watch: Callable[[], float] | None = None) -> np.ndarray:
    seen = []
    for _ in range(ticks):
        rod.step()
        if watch is not None:
            seen.append(watch())
    return np.array(seen)


def _moving(rod: Rod, twists: np.ndarray) -> None:
    rod.set_motion(np.hstack([rod.positions, rod.orientations]), twists)


def _tip_loaded(n: int, length: float, diameter: float, youngs: float, force: float, axis: int) -> RodDescription:
    description = from_material(line(n, length, axis=axis), diameter, youngs, 1100.0)
    gravity = np.zeros((n, 3))
    gravity[-1, 2] = force / description.mass[-1]
    return replace(description, gravity=gravity)


def cantilever(axes: Any) -> str:
    n, length, diameter, youngs, density = 40, 0.1, 0.5e-3, 50e9, 6450.0
    rod = _clamped(from_material(line(n, length), diameter, youngs, density))
    _run(rod, 1500)
    x, span = rod.positions[:, 0] - rod.positions[0, 0], length * (1.0 - 0.5 / n)
    load = density * BAR * diameter**2 * 9.81
    sag = load * x**2 / (24 * youngs * ROUND * diameter**4) * (6 * span**2 - 4 * span * x + x**2)
    z = rod.positions[:, 2] - rod.positions[0, 2]
    axes.plot(1e3 * x, 1e3 * z, **MEASURED)
    axes.plot(1e3 * x, -1e3 * sag, **THEORY)
    axes.set(title="cantilever, own weight", xlabel="x, mm", ylabel="z, mm")
    return f"tip {abs(z[-1] / -sag[-1] - 1):.2%}"


def elastica(axes: Any) -> str:
    n, length, diameter, youngs = 60, 0.1, 1e-3, 2e9
    span, worst = length * (1.0 - 1.0 / n), 0.0
    for load in (1.0, 5.0, 10.0):
        force = load * youngs * ROUND * diameter**4 / span**2
        rod = _clamped(_tip_loaded(n, length, diameter, youngs, -force, axis=0), 1 - 1e-15)
        _run(rod, 1500)
        shape = (rod.positions - rod.positions[0]) / span
        x, z = _elastica(load)
        axes.plot(shape[:, 0], shape[:, 2], **MEASURED)
        axes.plot(x, z, **THEORY)
        worst = max(worst, abs(shape[-1, 2] / z[-1] - 1.0))
    axes.set(title="elastica, P L² / E I = 1, 5, 10", xlabel="x / L", ylabel="z / L")
    return f"tip {worst:.2%}"


def _elastica(load: float) -> tuple[np.ndarray, np.ndarray]:
    """Shape of a clamped elastic line of length 1 under a downward tip load: θ'' = load cos θ, θ'(1) = 0."""

    def shoot(bend: float) -> Any:
        rates = lambda s, y: [y[1], load * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])]  # noqa: E731
        return solve_ivp(rates, (0.0, 1.0), [0.0, bend, 0.0, 0.0], rtol=1e-9, max_step=0.01)

    bend = brentq(lambda b: shoot(b).y[1, -1], -load, 0.0)
    solution = shoot(bend)
    return solution.y[2], solution.y[3]


def catenary(axes: Any) -> str:
    n, length, span = 100, 0.2, 0.12
    rod = _clamped(from_material(line(n, length), 0.1e-3, 3e5, 1100.0), 0.9999)
    rod.hold_element(n - 1)
    for tick in range(3400):
        twists = rod.twists
        twists[[0, -1]] = 0.0
        twists[-1, 0] = -(length * (1 - 1 / n) - span) / 0.4 if tick < 400 else 0.0
        _moving(rod, twists)
        rod.step()
    free, wide = length * (1 - 2 / n), span - length / n
    a = brentq(lambda a: 2 * a * np.sinh(wide / (2 * a)) - free, 0.01, 1.0)
    middle = 0.5 * (rod.positions[0, 0] + rod.positions[-1, 0])
    x = np.linspace(-wide / 2, wide / 2, 200)
    z = a * (np.cosh(x / a) - np.cosh(wide / (2 * a)))
    axes.plot(1e3 * (rod.positions[:, 0] - middle), 1e3 * rod.positions[:, 2], **MEASURED)
    axes.plot(1e3 * x, 1e3 * z, **THEORY)
    axes.set(title="catenary", xlabel="x, mm", ylabel="z, mm")
    return f"sag {abs(rod.positions[:, 2].min() / z.min() - 1):.2%}"


def stretch(axes: Any) -> str:
    n, length, diameter, youngs = 40, 0.1, 0.3e-3, 2e9
    forces, strains = np.linspace(0.25, 2.0, 8), []
    for force in forces:
        rod = _clamped(_tip_loaded(n, length, diameter, youngs, force, axis=2), 0.9999)
        _run(rod, 800)
        strains.append((rod.positions[-1, 2] - rod.positions[0, 2]) / (length * (1 - 1 / n)) - 1.0)
    theory = forces / (youngs * BAR * diameter**2)
    axes.plot(forces, 1e2 * np.array(strains), "o", **MEASURED)
    axes.plot(forces, 1e2 * theory, **THEORY)
    axes.set(title="stretch of nylon", xlabel="pull, N", ylabel="strain, %")
    return f"{np.abs(strains / theory - 1).max():.2%}"


def free_fall(axes: Any) -> str:
    rod = Bench([]).add(from_material(line(40, 0.1), 0.3e-3, 2e9, 1100.0))
    fall = -_run(rod, 500, lambda: float(rod.positions[:, 2].mean()))
    t = DT * np.arange(1, 501)
    theory = 9.81 * t * (t + DT) / 2
    axes.plot(t, 1e3 * fall, **MEASURED)
    axes.plot(t, 1e3 * theory, **THEORY)
    axes.set(title="free fall", xlabel="t, s", ylabel="fallen, mm")
    return f"{np.abs(fall / theory - 1).max():.1e}"


def bending_period(axes: Any) -> str:
    n, length, diameter, youngs, density = 40, 0.1, 1e-3, 2e7, 1100.0
    rod = Bench([]).add(from_material(line(n, length), diameter, youngs, density, gravity=(0, 0, 0)))
    rod.hold_element(0)
    span = length * (1 - 0.5 / n)
    x = (rod.positions[:, 0] - rod.positions[0, 0]) / span
    twists = np.zeros((n, 6))
    twists[:, 2] = 0.02 * x**2 * (6 - 4 * x + x**2) / 3
    twists[:, 4] = -0.02 * (12 * x - 12 * x**2 + 4 * x**3) / 3 / span
    _moving(rod, twists)
    tip = _run(rod, 2500, lambda: float(rod.positions[-1, 2]))
    speed = 3.51602 * np.sqrt(youngs * ROUND * diameter**4 / (density * BAR * diameter**2)) / span**2
    return _oscillation(axes, "bending vibration", tip, speed, "tip, mm", 1e3)


def torsion_period(axes: Any) -> str:
    n, length, diameter, youngs, wheel = 20, 0.1, 1e-3, 2e7, 1e-8
    description = from_material(line(n, length), diameter, youngs, 1100.0, gravity=(0, 0, 0))
    inertia = description.inertia.copy()
    inertia[-1] = wheel
    rod = Bench([]).add(replace(description, inertia=inertia))
    rod.hold_element(0)
    twists = np.zeros((n, 6))
    twists[:, 3] = np.linspace(0.0, 2.0, n)
    _moving(rod, twists)
    angle = _run(rod, 2000, lambda: float(rod.joints.angle[:, 2].sum()))
    twist = youngs / 2.8 * np.pi * diameter**4 / 32 / (length * (1 - 1 / n))
    return _oscillation(axes, "torsional vibration", angle, np.sqrt(twist / wheel), "wheel, rad", 1.0)


def _oscillation(axes: Any, title: str, values: np.ndarray, speed: float, label: str, scale: float) -> str:
    """Draw a vibration beside one of the theory's frequency (rad/s) and the same decay."""
    t = DT * np.arange(1, len(values) + 1)
    i = np.flatnonzero((values[:-1] < 0) & (values[1:] >= 0))
    period = np.diff(DT * (i - values[i] / (values[i + 1] - values[i]))).mean()
    axes.plot(t, scale * values, **MEASURED)
    half = len(values) // 2
    early, late = np.abs(values[:half]).max(), np.abs(values[half:]).max()
    decay = np.log(early / late) / t[half]
    axes.plot(t, scale * early * np.exp(-decay * t) * np.sin(speed * t), **THEORY)
    axes.set(title=title, xlabel="t, s", ylabel=label)
    return f"period {abs(period * speed / (2 * np.pi) - 1):.2%}"


def michell(axes: Any) -> str:
    n, radius, poisson = 60, 0.02, 0.4
    around = np.linspace(-np.pi / 2, 3 * np.pi / 2, n + 1)
    points = np.stack([radius * np.cos(around), radius * np.sin(around), np.zeros(n + 1)], axis=1)
    description = from_material(points, 1e-3, 1e8, 1100.0, gravity=(0, 0, 0), poisson_ratio=poisson)
    rod = _clamped(description, 1 - 1e-6)
    rod.hold_element(n - 1)
    axis = pose7_matrix(np.r_[0, 0, 0, rod.orientations[-1]])[:3, 2]
    disturbance = 1e-3 * np.sin(2 * np.linspace(0, 2 * np.pi, n))[1:-1]
    turns, height = [0.0], [0.0]
    while height[-1] < 0.3 * radius and turns[-1] < 4.0:
        rate = 2.0 if turns[-1] < 2.0 else 0.2
        twists = rod.twists
        twists[0], twists[-1] = 0.0, np.r_[0.0, 0.0, 0.0, 2 * np.pi * rate * axis]
        twists[1:-1, 2] += disturbance * DT / 0.1
        _moving(rod, twists)
        rod.step()
        turns.append(turns[-1] + rate * DT)
        height.append(float(np.abs(rod.positions[:, 2]).max()))
    critical = np.sqrt(3.0) * (1.0 + poisson)
    axes.plot(turns, 1e3 * np.array(height), **MEASURED)
    axes.axvline(critical, **THEORY)
    axes.set(title="Michell: ring twisted out of its plane", xlabel="turns", ylabel="height, mm")
    buckled = turns[int(np.argmax(np.array(height) > 0.1 * radius))]
    return f"twist {abs(buckled / critical - 1):.1%}"


def capstan(axes: Any) -> str:
    friction, worst = np.array([0.1, 0.2, 0.3, 0.4]), 0.0
    theory = np.exp(friction * np.pi)
    ratios = np.array([_slipping_ratio(mu) for mu in friction])
    axes.plot(friction, ratios, "o", **MEASURED)
    axes.plot(friction, theory, **THEORY)
    axes.set(title="capstan: half a turn about a post", xlabel="friction", ylabel="ratio at which it slips")
    worst = np.abs(ratios / theory - 1).max()
    return f"ratio {worst:.1%}"


def _slipping_ratio(friction: float) -> float:
    """Ratio of the loads on both ends of a thread over a post at which it begins to run."""
    n, radius, thick, weight = 100, 5e-3, 0.4e-3, 1e-3
    turned = axis_rotation((1.0, 0.0, 0.0), np.pi / 2)
    bench = Bench([body(0, Cylinder(radius, 0.02), R=turned, friction=friction)])
    r, length = radius + 0.5 * thick + 2e-6, 0.05
    s = np.linspace(-length / 2, length / 2, n + 1)
    around = np.clip(s / (radius + 0.5 * thick), -np.pi / 2, np.pi / 2)
    down = np.maximum(np.abs(s) - 0.5 * np.pi * (radius + 0.5 * thick), 0.0)
    points = np.stack([r * np.sin(around), np.zeros(n + 1), r * np.cos(around) - down], axis=1)
    description = from_material(points, thick, 1e8, 1100.0, friction=1.0, gravity=(0, 0, 0))
    mass = description.mass.copy()
    mass[[0, -1]] = weight
    supple = replace(description, joint_stiffness=0.1 * description.joint_stiffness, mass=mass)
    rod = bench.add(damped(supple, 0.9))
    ratio = 1.0
    for tick in range(6000):
        # Both ends take up their load before one of them takes more.
        ratio = 1.0 + max(0, tick - 400) * 5e-4
        rod.set_gravity(0, (0.0, 0.0, -50.0))
        rod.set_gravity(n - 1, (0.0, 0.0, -50.0 * ratio))
        bench.step()
        if tick > 400 and rod.twists[-1, 2] < -0.05:
            break
    return ratio


def whip(axes: Any) -> str:
    description = from_material(line(60, 0.15), 0.5e-3, 1e8, 1100.0)
    rod = Bench([]).add(description)
    rod.hold_element(0)
    scale = float((description.mass * 9.81).sum()) * 0.15
    start = energy(rod)
    left = np.array(
        [(energy(rod) - start) / scale, *((e - start) / scale for e in _run(rod, 3000, lambda: energy(rod)))]
    )
    axes.plot(DT * np.arange(len(left)), left, **MEASURED)
    axes.axhline(0.0, **THEORY)
    axes.set(title="energy of a whipping thread", xlabel="t, s", ylabel="energy / m g L")
    return f"largest growth in a tick {max(np.diff(left).max(), 0.0):.1e}"


def momentum(axes: Any) -> str:
    """A thread that moves pulls along a body attached to it."""
    worst = 0.0
    for mass in (1e-7, 1e-3, 0.5):
        description = from_material(line(20, 0.1), 1e-3, 1e8, 1100.0, gravity=(0, 0, 0))
        T, none = np.eye(4), np.zeros(3)
        T[:3, 3] = description.ends[-1, 1]
        bench = Bench([body(0, None, (0.1, 0.0, 0.0), mass=mass, inertia=mass * 1e-5)])
        rod = bench.add(replace(description, attachments=(Attachment(19, 0, T, np.eye(4), none, none, none, *FREE),)))
        twists = np.zeros((20, 6))
        twists[:, 1], twists[:, 2] = np.linspace(0.5, 0.0, 20), 0.2
        _moving(rod, twists)
        scale, sums = 0.3 * description.mass.sum(), []
        for _ in range(300):
            bench.step()
            sums.append(float(np.linalg.norm(description.mass @ rod.twists[:, :3] + mass * bench.twist[0][:3])))
        error = np.abs(np.array(sums) - sums[0]) / scale
        axes.semilogy(DT * np.arange(300), np.maximum(error, 1e-17), label=f"body of {mass:g} kg")
        worst = max(worst, float(error.max()))
    axes.set(title="momentum of thread and attached body", xlabel="t, s", ylabel="error")
    return f"{worst:.0e}"


TRUTHS: tuple[DRAWN, ...] = (
    cantilever, elastica, catenary, stretch, free_fall, bending_period, torsion_period, michell, capstan, whip, momentum,
)  # fmt: skip


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("docs/pictures")
    folder.mkdir(parents=True, exist_ok=True)
    figure, grid = plt.subplots(4, 3, figsize=(13, 14), constrained_layout=True)
    for axes, truth in zip(grid.flat, TRUTHS, strict=False):
        error = truth(axes)
        title = axes.get_title()
        axes.set_title(f"{title}\n{error}", fontsize=10)
        handles, labels = axes.get_legend_handles_labels()
        shown = dict(zip(labels, handles, strict=True))
        axes.legend(shown.values(), shown.keys(), frameon=False, fontsize=8)
        sys.stdout.write(f"{title}: {error}\n")
    for axes in grid.flat[len(TRUTHS) :]:
        axes.axis("off")
    figure.savefig(folder / "suture_truths.png", dpi=80)


if __name__ == "__main__":
    main()
