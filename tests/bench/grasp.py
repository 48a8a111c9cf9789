"""What jaws hold against the law of friction, and what grasping costs a tick; the picture of `docs/grasp.md`.

python tests/bench/grasp.py [--pictures docs/pictures]
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from tests.grasping.test_threads import FRICTION, Stretched  # noqa: E402
from tests.grasping.theatre import Theatre  # noqa: E402

Array = np.ndarray


def _onset(theatre: Theatre, angle: float) -> tuple[float, float]:
    """Force and moment, as shares of the pads' limits, at which a needle pulled and turned at once slips by 20 um."""
    sim, world, index = theatre.sim, theatre.sim._world, theatre.needle.body.index
    half_width = theatre._jaw("PSM1").half_width
    force = 2 * FRICTION * sim.grasps["PSM1"].normal_force
    T, slip, share = sim.grasps.patch("PSM1"), sim.grasps["PSM1"].slip.copy(), 0.0
    while np.abs(sim.grasps["PSM1"].slip - slip) @ [1.0, half_width] < 20e-6:
        share += 0.002
        push = share * np.cos(angle) * force * T[:3, 0]
        turn = share * np.sin(angle) * force * half_width / 2 * T[:3, 2]
        at = T[:3, 3] - world.motion(index)[0][:3]
        theatre.needle.command_wrench(np.r_[push, np.cross(at, push) + turn])
        sim.step(2)
    return share * float(np.cos(angle)), share * float(np.sin(angle))


def _needle() -> Array:
    """Onsets (n, 2) of slip around the limit surface."""
    theatre = Theatre()
    theatre.hand_needle_to("PSM1")
    snapshot, found = theatre.sim.snapshot(), []
    for angle in np.linspace(0.0, np.pi / 2, 10):
        theatre.sim.restore(snapshot)
        found.append(_onset(theatre, float(angle)))
    return np.array(found)


def _thread(angle: float) -> tuple[Array, Array, float]:
    """Way of the thread's end (m), tension (N), and the limit for jaws closed to ``angle``."""
    theatre = Stretched()
    theatre.sim.arms["PSM1"].servo_jaw([angle])  # type: ignore[attr-defined]  # a PSM
    theatre.sim.step(100)
    ways, tensions = [], []
    for k in range(60):
        theatre.pull(0.03e-3)
        ways.append(0.03e-3 * (k + 1))
        tensions.append(float(theatre.rod.tension[5]))
    return np.array(ways), np.array(tensions), 2 * FRICTION * theatre.sim.grasps["PSM1"].normal_force


def _cost(theatre: Theatre, ticks: int = 1000) -> float:
    """Microseconds of a tick that looking for, or keeping, grasps takes (median)."""
    sim, spent = theatre.sim, []
    for k in range(ticks):
        sim._world.pre_step()
        begin = time.perf_counter()
        sim.grasps.step(k)
        spent.append(time.perf_counter() - begin)
        sim._world.step()
    return 1e6 * float(np.mean(np.sort(spent)[: ticks * 9 // 10]))


def _draw(folder: Path, onsets: Array, threads: dict[float, tuple[Array, Array, float]]) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6))
    around = np.linspace(0.0, np.pi / 2, 60)
    left.plot(np.cos(around), np.sin(around), label="Howe, Cutkosky 1996")
    left.plot(onsets[:, 0], onsets[:, 1], "k+", markersize=9, label="needle begins to slip")
    left.set(xlabel="force / (2 mu N)", ylabel="moment / (mu N w)", aspect="equal")
    left.legend(frameon=False, loc="lower left")
    for angle, (way, tension, limit) in threads.items():
        (line,) = right.plot(1e3 * way, tension, label=f"jaw set to {np.degrees(angle):.0f} deg")
        right.axhline(limit, color=line.get_color(), linestyle=":")
    right.set(xlabel="way of the thread's end / mm", ylabel="tension / N")
    right.legend(frameon=False)
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / "grasp_slip.png", dpi=110, bbox_inches="tight")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pictures", type=Path)
    arguments = parser.parse_args()
    theatre = Theatre()
    sys.stdout.write(f"nothing between the jaws of two arms: {_cost(theatre):.1f} us a tick\n")
    theatre.hand_needle_to("PSM1")
    sys.stdout.write(f"one jaw holding the needle: {_cost(theatre):.1f} us a tick\n")
    onsets = _needle()
    off = np.abs(np.linalg.norm(onsets, axis=1) - 1.0).max()
    sys.stdout.write(f"onset of slip around the limit surface: within {100 * off:.1f} %\n")
    threads = {angle: _thread(angle) for angle in (-0.05, -0.1, -0.15)}
    for angle, (_, tension, limit) in threads.items():
        sys.stdout.write(
            f"thread, jaw at {angle:.2f} rad: slides at {tension[-1]:.3f} N, the law states {limit:.3f} N\n"
        )
    if arguments.pictures:
        _draw(arguments.pictures, onsets, threads)


if __name__ == "__main__":
    main()
