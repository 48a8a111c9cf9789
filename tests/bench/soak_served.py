"""A day of simulated time of a whole run, as fast as the machine allows: ROS, the page, and a browser that comes and goes.

``python -m tests.bench.soak_served [HOURS [FOLDER]]`` (24 simulated hours of PSM1 alone; part of `make soak`). The run is
that of a user, with its processes. A ROS node sends the arm from goal to goal and checks what it hears. A browser's
connections come, take control, hold keys, move a slider, pause, record, watch the endoscope, ask for the curves, and go,
every third time without a farewell. Once a minute each process is measured; a line fitted to its memory over the second
half says by how much it grows in a simulated hour. Samples are written to ``samples.csv`` in FOLDER. Exit status 1 when
something grew, died, stood still, was not finite, or had a wrong time.
"""

from __future__ import annotations

import csv
import itertools
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec.msgpack
import numpy as np
from ligature.bus import Block, Outbox, Pace
from ligature.bus.leftovers import FOLDER as SHARED
from ligature.bus.pacing import MAX_SPEED
from ligature.bus.record import Record
from ligature.cli.options import RunOptions
from ligature.model.state import new_state
from ligature.process import end_with_parent
from numpy.typing import NDArray

from tests.bench.on_ros import ROOT, own_master
from tests.cockpit.wired import Wired
from tests.waiting import until

Array = NDArray[np.float64]

SCENE = ROOT / "scenes" / "suturing_small" / "launch.yaml"
MODELS, RATE, TICK = (1,), 50.0, 1e-3
LOW = np.array([-0.4, -0.4, 0.08, -1.0, -0.6, -0.6])
HIGH = np.array([0.4, 0.4, 0.18, 1.0, 0.6, 0.6])
"""Goals of the arm: radians, and metres of the third joint."""

MINUTE = 60.0
LOOK = 0.05
"""Seconds between two looks at the state."""

MOST_GROWTH = 0.02
"""Share of its memory by which a process may grow over the second half, by the line that is fitted."""

MOST_MORE = {"threads": 2, "files": 3}
"""What a process may have more of in the end than after the first quarter, by medians."""

BENCH = "bench"

STANDSTILL = 30.0
"""Seconds without a new state that count as standing still."""

LATE = 2.0
"""Seconds by which a stamp may differ from the clock."""


@dataclass
class Findings:
    """What was seen: problems, each with how often it was, and how often what was done."""

    problems: Counter[str] = field(default_factory=Counter)
    done: Counter[str] = field(default_factory=Counter)
    largest: float = 0.0

    def check(self, holds: bool, what: str) -> None:
        """Note a problem unless a condition holds."""
        if not holds:
            self.problems[what] += 1


@dataclass(frozen=True)
class Sample:
    """One process at one moment: simulated hours, megabytes, threads, open files, seconds of processor time.

    ``own`` is what it shares with nobody; of shared memory pages count when they are first touched, up to the size of the block.
    """

    hours: float
    process: str
    own: float
    resident: float
    threads: int
    files: int
    cpu: float


def processes(parent: int) -> dict[str, int]:
    """Process ids of a run by what they run."""
    found = {"supervisor": parent}
    for child in Path(f"/proc/{parent}/task/{parent}/children").read_text().split():
        words = Path(f"/proc/{child}/cmdline").read_text().split("\0")
        found[next((w.rpartition(".")[2] for w in words if w.startswith("ligature.cli.")), words[0])] = int(child)
    return found


def sample(name: str, pid: int, hours: float) -> Sample:
    """Measure a process."""
    status = dict(
        line.split(":\t", 1) for line in Path(f"/proc/{pid}/status").read_text().splitlines() if ":\t" in line
    )
    times = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    cpu = (int(times[11]) + int(times[12])) / os.sysconf("SC_CLK_TCK")
    files = len(os.listdir(f"/proc/{pid}/fd"))
    own, resident = (int(status[key].split()[0]) / 1024.0 for key in ("RssAnon", "VmRSS"))
    return Sample(hours, name, own, resident, int(status["Threads"]), files, cpu)


def megabytes(folder: Path) -> float:
    """What the files of a folder take on the disk."""
    total = 0
    for path in folder.rglob("*"):
        with suppress(FileNotFoundError):
            total += path.lstat().st_blocks * 512
    return total / 1e6


class Watch:
    """Reads states of a run and checks their times and numbers."""

    def __init__(self, block: Block, scene: Any, findings: Findings) -> None:
        self._block, self._state, self._findings = block, new_state(scene), findings
        self._numbers = [name for name in self._state.dtype.names if self._state.dtype[name].base.kind == "f"]
        self._arm_numbers = [n for n in self._state["arm"].dtype.names if self._state["arm"].dtype[n].base.kind == "f"]
        self._last, self._since = (0, 0, 0.0), time.monotonic()

    @property
    def seconds(self) -> float:
        """Simulated seconds of the newest state."""
        return float(self._state["sim_time"][0])

    @property
    def arm(self) -> Any:
        """The arm, as the newest state has it."""
        return self._state["arm"][0, 0]

    def look(self) -> None:
        """Take the newest state, and check it."""
        if not self._block.read(self._state):
            self._findings.check(time.monotonic() - self._since < STANDSTILL, "physics stood still")
            return
        self._since, check = time.monotonic(), self._findings.check
        self._findings.done["states looked at"] += 1
        state, arms = self._state, self._state["arm"]
        finite = all(np.isfinite(state[name]).all() for name in self._numbers)
        check(finite and all(np.isfinite(arms[name]).all() for name in self._arm_numbers), "a number is not finite")
        tick, update, seconds = int(state["tick"][0]), int(state["update"][0]), self.seconds
        check(tick >= self._last[0] and update >= self._last[1] and seconds >= self._last[2], "time ran backwards")
        check(seconds == tick * TICK, "simulated time is not ticks times their length")
        check(update == tick // round(1.0 / (RATE * TICK)), "updates are not ticks over those of one")
        check(abs(float(state["stamp"][0]) - time.time()) < LATE, "the stamp is not that of the clock")
        self._last = (tick, update, seconds)
        self._findings.largest = max(self._findings.largest, float(np.abs(arms["measured_js"][:, 0]).max()))


class Commander:
    """A ROS node: sends the arm from goal to goal, and checks what it hears of it."""

    def __init__(self, findings: Findings) -> None:
        import rospy
        from ambf_msgs.msg import WorldState
        from crtk_msgs.msg import StringStamped
        from sensor_msgs.msg import JointState

        self._findings, self._rng, self._kind = findings, np.random.default_rng(7), JointState
        self._goals = rospy.Publisher("/PSM1/move_jp", JointState, queue_size=10)
        self._jaws = rospy.Publisher("/PSM1/jaw/move_jp", JointState, queue_size=10)
        self._states, self._words = rospy.Publisher("/PSM1/state_command", StringStamped, queue_size=10), StringStamped
        self._stamp, self._step = 0.0, 0
        rospy.Subscriber("/PSM1/measured_js", JointState, self._hear_arm)
        rospy.Subscriber("/ambf/env/World/State", WorldState, self._hear_world)
        topics = (self._goals, self._jaws, self._states)
        until(lambda: all(topic.get_num_connections() for topic in topics), "the simulator hears the node", 60.0)

    def orders(self, word: str) -> None:
        """Enable, home."""
        message = self._words()
        message.string = word
        self._states.publish(message)

    def send(self) -> None:
        """A goal somewhere, and an angle of the jaw."""
        self._goals.publish(self._kind(position=self._rng.uniform(LOW, HIGH)))
        self._jaws.publish(self._kind(position=[self._rng.uniform(0.0, 0.8)]))
        self._findings.done["goals over ROS"] += 1

    def _hear_arm(self, message: Any) -> None:
        stamp = message.header.stamp.to_sec()
        self._findings.done["messages of the arm"] += 1
        self._findings.check(bool(np.isfinite(message.position).all()), "a message has numbers that are not finite")
        self._findings.check(stamp >= self._stamp, "stamps of messages ran backwards")
        self._findings.check(abs(stamp - time.time()) < LATE, "the stamp of a message is not that of the clock")
        self._stamp = stamp

    def _hear_world(self, message: Any) -> None:
        self._findings.done["messages of the world"] += 1
        self._findings.check(message.sim_step >= self._step, "sim_step ran backwards")
        exact = message.sim_step / RATE
        self._findings.check(
            abs(message.sim_time - exact) <= 1.0 / RATE + np.spacing(np.float32(exact)), "sim_time is off"
        )
        self._step = message.sim_step


class Visitor(Wired):
    """A browser's connections that press what is on the page."""

    def sets(self, label: str, value: Any) -> None:
        """What a browser sends when a person gives a control a value."""
        uuid = until(
            lambda: next((uuid for uuid, (_, props) in [*self.controls.items()] if props.get("label") == label), ""),
            f"'{label}' is on the page", 60.0,
        )  # fmt: skip
        update = {"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": value}}
        self._page.send(msgspec.msgpack.encode(update))

    def vanishes(self) -> None:
        """Go without a word, as a browser does whose machine is switched off."""
        self._over = True
        for connection in (self._page, self._wire):
            with suppress(OSError):
                connection.socket.shutdown(socket.SHUT_RDWR)


class Visits(threading.Thread):
    """One visitor after the other, as long as the run takes."""

    def __init__(self, url: str, folder: Path, figures: Any, outbox: Outbox, findings: Findings) -> None:
        super().__init__(daemon=True)
        self._url, self._folder, self._figures, self._outbox = url, folder, figures, outbox
        self._findings, self._rng = findings, np.random.default_rng(3)
        self.over = threading.Event()
        self.busy = False

    def run(self) -> None:
        """One visit after the other."""
        for number in itertools.count():
            if self.over.wait(2.0):
                return
            try:
                self._visit(number)
            except Exception as error:  # noqa: BLE001 (whatever it was is the finding)
                self._findings.problems[f"visit {number} failed: {type(error).__name__}: {str(error)[:200]}"] += 1
            finally:
                self.busy = False

    def _visit(self, number: int) -> None:
        visitor, done = Visitor(self._url), self._findings.done
        try:
            done["visits"] += 1
            if number % 4 == 1:
                self._watch(visitor)
            self.busy = True
            until(lambda: visitor.facts.get("free"), "the desk is free", 60.0)
            visitor.starts(120.0)
            self._press(visitor, number)
        finally:
            (visitor.vanishes if number % 3 == 2 else visitor.goes)()
            self.busy = False

    def _watch(self, visitor: Visitor) -> None:
        """Look at the endoscope for a moment."""
        visitor.orders("view", [True, 240, False])
        until(lambda: visitor.pictures > 3, "pictures come", 60.0)
        visitor.orders("view", [False, 0, False])
        self._findings.done["looks through the endoscope"] += 1

    def _press(self, visitor: Visitor, number: int) -> None:
        """What an operator does."""
        done = self._findings.done
        for axis in self._rng.permutation(7)[:3]:
            visitor.holds(int(axis), float(self._rng.choice([-1.0, 1.0])))
            self.over.wait(0.3)
        visitor.holds(0, 0.0)
        visitor.orders("hold")
        visitor.orders("csv")
        visitor.sets("yaw °", float(self._rng.uniform(-20.0, 20.0)))
        done["controls"] += 7
        if number % 5 == 2:
            visitor.sets("Paused", True)
            visitor.sets("Step", "Step 10")
            self.over.wait(0.2)
            visitor.sets("Paused", False)
            done["pauses"] += 1
        if number % 7 == 3:
            visitor.sets("Speed", "2")
            self.over.wait(0.5)
            self._outbox.push(Pace(MAX_SPEED))
            done["changes of speed"] += 1
        if number % 6 == 0:
            self._record(visitor)

    def _record(self, visitor: Visitor) -> None:
        """Begin and end a recording; it is read, and taken away, since it holds all that was before."""
        visitor.sets("Record", True)
        until(lambda: self._figures["recording"][0] == 1, "the run records", 30.0)
        visitor.holds(1, 1.0)
        self.over.wait(0.5)
        visitor.holds(1, 0.0)
        visitor.sets("Record", False)
        until(lambda: self._figures["recording"][0] == 0, "the recording ends", 30.0)
        found: list[Path] = until(
            lambda: list((self._folder / "recordings").glob("*.record")), "the record lies there", 60.0
        )
        Record.read(found[0])
        for path in found:
            path.unlink()
        self._findings.done["records"] += 1


def slope(rows: list[Sample]) -> tuple[float, float]:
    """Megabytes an hour by a line fitted to the second half, and the share of growth over that time."""
    rows = rows[len(rows) // 2 :]
    if len(rows) < 3:
        return 0.0, 0.0
    hours, sizes = np.array([r.hours for r in rows]), np.array([r.own for r in rows])
    rate = float(np.polyfit(hours, sizes, 1)[0])
    return rate, rate * float(hours[-1] - hours[0]) / float(sizes[0])


def verdict(samples: list[Sample], findings: Findings) -> list[str]:
    """Print how each process did; returns what is wrong.

    The bench itself, which is the browser, is measured and not judged.
    """
    problems = [f"{what} ({count} times)" for what, count in findings.problems.items()]
    for name in dict.fromkeys(row.process for row in samples):
        rows = [row for row in samples if row.process == name]
        rate, share = slope(rows)
        quarter = max(1, len(rows) // 4)
        line = f"{name}: own memory {rows[0].own:.1f} MB at first, {rows[-1].own:.1f} in the end, {rate:+.3f} an hour"
        line += f"; resident {rows[0].resident:.1f} to {rows[-1].resident:.1f}"
        for what, most in MOST_MORE.items():
            before, after = (
                np.median([getattr(r, what) for r in part]) for part in (rows[quarter:][:quarter], rows[-quarter:])
            )
            line += f"; {what} {before:.0f} to {after:.0f}"
            if name != BENCH and after > before + most:
                problems.append(f"{name} has {after:.0f} {what}, and had {before:.0f}")
        sys.stdout.write(f"{line}; {rows[-1].cpu:.0f} s of processor time\n")
        if name != BENCH and share > MOST_GROWTH:
            problems.append(f"{name} grows by {rate:.3f} MB a simulated hour")
    done = ", ".join(f"{count} {what}" for what, count in findings.done.items())
    sys.stdout.write(f"{done}; largest joint value {findings.largest:.3f}\n")
    return problems


class Soak:
    """One run, its visitors, and who measures them."""

    def __init__(self, folder: Path) -> None:
        self.findings, self._folder, self.samples = Findings(), folder, list[Sample]()
        self._scratch = folder / "scratch"
        self._scratch.mkdir()
        self._lines: list[str] = []
        command = [str(Path(sys.executable).parent / "ligature"), "run", str(SCENE), "-l", ",".join(map(str, MODELS))]
        command += ["-p", f"{RATE:g}", "-s", f"{MAX_SPEED:g}", "--no-masters", "--no-cameras", "--at", "127.0.0.1:0"]
        self._run = subprocess.Popen(
            [*command, "--min-hz", "20", "--max-hz", "50"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            cwd=folder, env=dict(os.environ, COLUMNS="200", TMPDIR=str(self._scratch)), preexec_fn=end_with_parent,
        )  # fmt: skip
        threading.Thread(target=self._read, daemon=True).start()
        ready = until(
            lambda: next((x for x in self._lines if x.startswith("cockpit ready")), ""), "the page is served", 120.0
        )
        self._url = ready.partition(": ")[2].strip()
        scene = RunOptions(str(SCENE), MODELS, masters=False).load()
        (name,) = [path.name for path in SHARED.glob(f"ligature-{self._run.pid}-*")]
        self._block = Block.attach(name, new_state(scene).dtype)
        self._watch = Watch(self._block, scene, self.findings)
        self._first = processes(self._run.pid)

    def _read(self) -> None:
        assert self._run.stdout is not None
        with (self._folder / "run.log").open("w", encoding="utf-8") as log:
            for line in self._run.stdout:
                self._lines = [*self._lines[-100:], line.rstrip("\n")]
                log.write(line)
                log.flush()

    def run(self, hours: float) -> None:
        """Soak for so many simulated hours."""
        commander, ring = Commander(self.findings), self._block.rings["spare"]
        for word, flag in (("enable", "operating"), ("home", "homed")):
            commander.orders(word)
            until(lambda flag=flag: self._ready(flag), f"the arm is ready after '{word}'", 60.0)
        visits = Visits(self._url, self._folder, self._block.figures, Outbox(ring), self.findings)
        visits.start()
        begun, due, before, last = self._watch.seconds, 0.0, time.monotonic(), self._watch.seconds
        with (self._folder / "samples.csv").open("w", newline="", encoding="utf-8") as file:
            table = csv.writer(file)
            table.writerow(
                [
                    "hours",
                    "process",
                    "own MB",
                    "resident MB",
                    "threads",
                    "files",
                    "cpu s",
                    "factor",
                    "scratch MB",
                    "largest q",
                ]
            )
            while self._watch.seconds - begun < 3600.0 * hours and self._alive():
                ring.beat()
                self._watch.look()
                if not visits.busy and not self._watch.arm["busy"]:
                    commander.send()
                if (now := time.monotonic()) >= due:
                    factor = (self._watch.seconds - last) / (now - before)
                    due, before, last = now + MINUTE, now, self._watch.seconds
                    self._measure(table, factor)
                    file.flush()
                time.sleep(LOOK)
            self._measure(table, 0.0)
        visits.over.set()
        visits.join(60.0)

    def _ready(self, flag: str) -> bool:
        self._watch.look()
        return int(self._watch.arm[flag]) == 1

    def _alive(self) -> bool:
        """Whether the run and all its processes live, and are those of the beginning."""
        alive = self._run.poll() is None
        self.findings.check(alive, "the run ended")
        return alive

    def _measure(self, table: Any, factor: float) -> None:
        hours = self._watch.seconds / 3600.0
        now = processes(self._run.pid) if self._run.poll() is None else {}
        for name, pid in self._first.items():
            self.findings.check(now.get(name) == pid, f"{name} died")
        disk = megabytes(self._folder)
        for name, pid in [*now.items(), (BENCH, os.getpid())]:
            row = sample(name, pid, hours)
            self.samples.append(row)
            table.writerow(
                [f"{hours:.4f}", name, f"{row.own:.2f}", f"{row.resident:.2f}", row.threads, row.files, f"{row.cpu:.1f}", f"{factor:.2f}",
                 f"{disk:.2f}", f"{self.findings.largest:.4f}"]
            )  # fmt: skip
        words = ", ".join(f"{row.process} {row.own:.1f}" for row in self.samples[-len(now) - 1 :])
        sys.stdout.write(f"{hours:.3f} h, {factor:.1f} times real time; MB: {words}; on disk {disk:.1f} MB\n")
        if self.findings.problems:
            sys.stdout.write(f"  {dict(self.findings.problems)}\n")
        sys.stdout.flush()

    def end(self) -> None:
        """End the run."""
        self._block.close()
        if self._run.poll() is None:
            self._run.send_signal(signal.SIGINT)
            status = self._run.wait(60.0)
            self.findings.check(status == 0, f"the run ended with status {status}")
        left = [path.name for path in SHARED.glob(f"ligature-{self._run.pid}-*")]
        self.findings.check(not left, f"shared memory is left: {left}")
        left = [path.name for path in self._scratch.rglob("*")]
        self.findings.check(not left, f"temporary files are left: {left[:5]}")


def main() -> int:
    """Entry point."""
    hours = float(sys.argv[1]) if len(sys.argv) > 1 else 24.0
    folder = Path(sys.argv[2]) if len(sys.argv) > 2 else Path(tempfile.mkdtemp(prefix="ligature-soak-"))
    folder.mkdir(parents=True, exist_ok=True)
    with own_master("soak"):
        soak = Soak(folder.resolve())
        try:
            soak.run(hours)
        finally:
            soak.end()
    problems = verdict(soak.samples, soak.findings)
    sys.stdout.write("".join(f"{problem}\n" for problem in problems) or f"nothing grew or failed in {hours:g} h\n")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
