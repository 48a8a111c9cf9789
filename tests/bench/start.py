"""How long a run takes to its first state, an import of `ligature`, and how much memory physics needs.

``python -m tests.bench.start``: least and median of `ROUNDS`, from the command to the first State of the world on ROS of a
master that already answers; with everything compiled and cached. Processor time, of all processes of the run
together, says the same of a machine that has other work.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import threading
import time
from pathlib import Path

from ligature.cli.master import command, master_answers

from tests.bench import ledger
from tests.bench.on_ros import CORPUS, processor_seconds
from tests.bench.reference import STEPS, Reference
from tests.waiting import until

ROUNDS = 5
OURS = ledger.ROOT / "scenes" / "suturing" / "launch.yaml"
PHYSICS = "ligature.cli.physics"
SETTLED = 1.0
"""Seconds after the first state at which memory is read."""


def import_seconds() -> tuple[float, float]:
    """Wall and processor time that ``import ligature`` adds to a bare start of Python, least of `ROUNDS`."""
    found = []
    for program in ("import ligature", "pass"):
        rounds = []
        for _ in range(ROUNDS):
            before, begin = os.times(), time.monotonic()
            subprocess.run([sys.executable, "-c", program], check=True)
            wall, after = time.monotonic() - begin, os.times()
            spent = after.children_user + after.children_system - before.children_user - before.children_system
            rounds.append((wall, spent))
        found.append([min(column) for column in zip(*rounds, strict=True)])
    return found[0][0] - found[1][0], found[0][1] - found[1][1]


def memory_mb(parent: int) -> tuple[float, float]:
    """Memory of the physics process among the children of ``parent``, in MB: now, and at most so far."""
    for child in Path(f"/proc/{parent}/task/{parent}/children").read_text().split():
        if PHYSICS in Path(f"/proc/{child}/cmdline").read_text().split("\0"):
            lines = Path(f"/proc/{child}/status").read_text().splitlines()
            rows = dict(line.split(":", 1) for line in lines if line.startswith("Vm"))
            return tuple(int(rows[name].split()[0]) / 1024 for name in ("VmRSS", "VmHWM"))  # type: ignore[return-value]
    raise RuntimeError("no physics process runs")


def first_state(arguments: list[str]) -> tuple[float, float, tuple[float, float]]:
    """Seconds from the command to the first State, processor time of it, and memory of physics; a node is running."""
    import rospy

    arrived = threading.Event()
    listener = rospy.Subscriber("/ambf/env/World/State", rospy.AnyMsg, lambda message: arrived.set(), queue_size=1)
    program = str(Path(sys.executable).parent / "ligature")
    begin = time.monotonic()
    run = subprocess.Popen([program, "run", *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        if not arrived.wait(120.0):
            raise RuntimeError("no State arrived within 120 s")
        wall, spent = time.monotonic() - begin, sum(processor_seconds(run.pid).values())
        time.sleep(SETTLED)
        return wall, spent, memory_mb(run.pid)
    finally:
        run.terminate()
        run.wait()
        listener.unregister()


def measured(name: str, arguments: list[str], reference: Reference) -> dict[str, float]:
    """Figures of one command, which are printed, too."""
    runs, ratios = [], []
    for _ in range(ROUNDS):
        runs.append(first_state(arguments))
        ratios.append(1e6 * runs[-1][1] / reference.time(STEPS).processor)
    walls, processor, sizes = zip(*runs, strict=True)
    now, most = sizes[-1]
    sys.stdout.write(
        f"{name}: first state {min(walls):.2f} s after the command, median {statistics.median(walls):.2f} s, processor "
        f"time {min(processor):.2f} s; physics has {now:.0f} MB, at most {most:.0f} MB\n"
    )
    sys.stdout.flush()
    return {
        "wall_s": statistics.median(walls), "least_wall_s": min(walls), "processor_s": min(processor),
        "ratio": statistics.median(ratios), "memory_mb": now, "most_memory_mb": most,
    }  # fmt: skip


def main() -> int:
    """Entry point."""
    uri = f"http://127.0.0.1:{11900 + os.getpid() % 200}"
    os.environ.update(ROS_MASTER_URI=uri, ROS_IP="127.0.0.1")
    master = subprocess.Popen(command(uri), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        until(lambda: master_answers(uri), "the ROS master answers", 60.0)
        import rospy

        rospy.init_node("start", anonymous=True, disable_signals=True)
        wall, spent = import_seconds()
        found = {"import": {"wall_s": wall, "processor_s": spent}}
        sys.stdout.write(f"import ligature: {wall:.2f} s, {spent:.2f} s of a processor\n")
        scenes = {"suturing": [str(OURS)]}
        if CORPUS.exists():
            scenes["lab"] = [str(CORPUS), "-l", "10,11,6,7,8,9"]
        with Reference() as reference:
            for name, arguments in scenes.items():
                first_state(arguments)  # compiles and fills caches
                found[name] = measured(name, arguments, reference)
    finally:
        master.terminate()
        master.wait()
    ledger.note("start", found)
    return 0


if __name__ == "__main__":
    sys.exit(main())
