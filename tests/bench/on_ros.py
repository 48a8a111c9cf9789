"""How fast the lab scene runs unthrottled with every State topic published at 100 Hz and somebody listening.

``python -m tests.bench.on_ros``: the real-time factor and the time of a tick, medians of once a second by
/diagnostics; messages a second as they arrive; and what part of a core each process takes.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ligature.cli.master import master_answers

from tests.waiting import until

ROOT = Path(__file__).resolve().parents[2]
CORPUS = Path(os.environ.get("LIGATURE_CORPUS", ROOT.parent / "shared" / "corpus")) / "suturing_scene" / "launch.yaml"
SMALL = ROOT / "scenes" / "suturing_small" / "launch.yaml"
UPDATES = 200.0
UNTHROTTLED = "100"
SECONDS = 8
SETTLING = 4


class Listener:
    """Takes every State message and every line of diagnostics of a run."""

    def __init__(self) -> None:
        import rospy
        from diagnostic_msgs.msg import DiagnosticArray

        self.received = 0
        self.seconds: list[dict[str, str]] = []
        topics = [(name, kind) for name, kind in rospy.get_published_topics() if name.endswith("/State")]
        self.topics = len(topics)
        self._subscribers = [rospy.Subscriber(name, rospy.AnyMsg, self._count, queue_size=1) for name, _ in topics]
        self._subscribers.append(rospy.Subscriber("/diagnostics", DiagnosticArray, self._note))

    def close(self) -> None:
        """Listen no more."""
        for subscriber in self._subscribers:
            subscriber.unregister()

    def _count(self, message: object) -> None:
        self.received += 1

    def _note(self, message: object) -> None:
        for status in message.status:  # type: ignore[attr-defined]
            if status.name == "ligature: physics loop":
                self.seconds.append({row.key: row.value for row in status.values})

    def median(self, key: str) -> float:
        """Median of a figure over the seconds after settling."""
        return statistics.median(float(row[key]) for row in self.seconds[SETTLING:])


def processor_seconds(parent: int) -> dict[str, float]:
    """Processor time of each child of ``parent``, by the module it runs."""
    spent = {}
    for child in Path(f"/proc/{parent}/task/{parent}/children").read_text().split():
        words = Path(f"/proc/{child}/cmdline").read_text().split("\0")
        name = next((w for w in words if w.startswith("ligature.") or "rosmaster" in w), words[0])
        stat = Path(f"/proc/{child}/stat").read_text().rsplit(")", 1)[1].split()
        spent[Path(name).name] = (int(stat[11]) + int(stat[12])) / os.sysconf("SC_CLK_TCK")
    return spent


@contextmanager
def own_master(node: str) -> Iterator[None]:
    """A ROS master of its own, with a ``node`` of this process."""
    port = 11900 + os.getpid() % 200
    os.environ.update(ROS_MASTER_URI=f"http://127.0.0.1:{port}", ROS_IP="127.0.0.1")
    master = subprocess.Popen(["rosmaster", "--core", "-p", str(port)], stdout=subprocess.DEVNULL)
    try:
        until(lambda: master_answers(os.environ["ROS_MASTER_URI"]), "the ROS master answers", 60.0)
        import rospy

        rospy.init_node(node, anonymous=True, disable_signals=True)
        yield
    finally:
        master.terminate()
        master.wait()


def main() -> int:
    """Entry point."""
    port = 11900 + os.getpid() % 200
    os.environ.update(ROS_MASTER_URI=f"http://127.0.0.1:{port}", ROS_IP="127.0.0.1")
    scene, models = (CORPUS, ["-l", "10,11,6,7,8,9"]) if CORPUS.exists() else (SMALL, [])
    command = [Path(sys.executable).parent / "ligature", "run", scene, *models, "-p", str(UPDATES), "-s", UNTHROTTLED]
    run = subprocess.Popen([*command, "--min-hz", "100", "--max-hz", "100", "--no-cameras"], stdout=subprocess.DEVNULL)
    try:
        until(lambda: master_answers(os.environ["ROS_MASTER_URI"]), "the ROS master answers", 60.0)
        time.sleep(5.0)
        import rospy

        rospy.init_node("on_ros", anonymous=True, disable_signals=True)
        listener = Listener()
        time.sleep(SETTLING)
        before, received, begin = processor_seconds(run.pid), listener.received, time.monotonic()
        time.sleep(SECONDS)
        span = time.monotonic() - begin
        after, received = processor_seconds(run.pid), listener.received - received
    finally:
        run.terminate()
        run.wait()
    ticks = 1000.0 / UPDATES
    p50, p99 = (1e3 * listener.median(f"update {name} (ms)") / ticks for name in ("p50", "p99"))
    shares = ", ".join(f"{name} {(after[name] - before[name]) / span:.0%}" for name in after)
    sys.stdout.write(
        f"{scene.parent.name} on ROS, {listener.topics} State topics: real-time factor "
        f"{listener.median('real-time factor'):.2f}, tick p50 {p50:.0f} us, p99 {p99:.0f} us; "
        f"{received / span / listener.topics:.0f} messages a second and topic; of a core: {shares}\n"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
