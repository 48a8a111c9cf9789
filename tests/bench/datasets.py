"""What recording costs: ``python -m tests.bench.datasets [FOLDER]``.

One throw of the demonstration, seed 3, at 30 samples a second, without pictures and with those of two cameras of 640 by
480: seconds on the clock and of the processor for each simulated second, and how large the episode is and how long it
takes to write in each format.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from pathlib import Path

import h5py
import ligature
from ligature.datasets import DatasetWriter
from ligature.datasets.lerobot import export

from tests.bench import ledger
from tests.bench.reference import chain_step_us

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "examples"))
from record_dataset import GESTURES, PHASES, TASK, record
from suture import SCENE, scatter

RATE, SIZE, SEED = 30.0, (640, 480), 3


def recorded(path: Path, cameras: tuple[str, ...]) -> dict[str, float]:
    """Record the throw; seconds on the clock and of the processor, of simulated time, and megabytes."""
    simulation = ligature.Simulation(ligature.load(SCENE))
    scatter(simulation, SEED)
    with DatasetWriter(path, simulation, cameras, SIZE, RATE, PHASES, TASK[1], GESTURES) as writer:
        first, begin, spent = simulation.time, time.perf_counter(), time.process_time()
        record(writer, simulation, 1, SEED)
        seconds, processor = time.perf_counter() - begin, time.process_time() - spent
        simulated = simulation.time - first
    simulation.close()
    with h5py.File(path) as file:
        samples = int(file["episode_0000"].attrs["samples"])
    return {
        "seconds": seconds, "processor": processor, "simulated": simulated, "samples": samples, "MB": _size(path) / 1e6,
    }  # fmt: skip


def exported(source: Path, target: Path, format: str) -> dict[str, float]:
    """Export the dataset; seconds on the clock and of the processor, and megabytes of all files."""
    begin, spent = time.perf_counter(), time.process_time()
    export(source, target, format, log=lambda text: None)
    seconds, processor = time.perf_counter() - begin, time.process_time() - spent
    return {
        "seconds": seconds,
        "processor": processor,
        "MB": sum(_size(path) for path in target.rglob("*") if path.is_file()) / 1e6,
    }


def _size(path: Path) -> int:
    return path.stat().st_size


def main() -> int:
    """Entry point."""
    with tempfile.TemporaryDirectory() as made:
        folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(made)
        folder.mkdir(parents=True, exist_ok=True)
        found, load, reference = {}, os.getloadavg()[0], chain_step_us()
        for name, cameras in (("motion", ()), ("two cameras", ("cameraL", "cameraR"))):
            one = found[name] = recorded(folder / f"{name.replace(' ', '_')}.h5", cameras)
            one["ratio"] = 1e6 * one["processor"] / one["simulated"] / reference
            sys.stdout.write(
                f"{name}: {one['simulated']:.1f} s simulated, {one['samples']} samples, {one['seconds']:.1f} s on the "
                f"clock, {one['seconds'] / one['simulated']:.2f} times real time, {one['processor']:.1f} s of the "
                f"processor, {one['processor'] / one['simulated']:.2f} times, {one['MB']:.1f} MB as HDF5\n"
            )
            sys.stdout.flush()
        for format in ("lerobot-3.0", "lerobot-2.1"):
            one = found[format] = exported(folder / "two_cameras.h5", folder / format, format)
            sys.stdout.write(
                f"{format}: {one['MB']:.1f} MB in {one['seconds']:.1f} s, {one['processor']:.1f} of the processor\n"
            )
    ledger.note("datasets", found)
    sys.stdout.write(f"at the start: load {load:.1f}, reference {reference:.0f} us\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
