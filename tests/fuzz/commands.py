"""Commands of every kind, with every content, to every object: ``python -m tests.fuzz.commands --commands 1000000``.

What there is to command is read from the code: every message with its fields, the words of operating states, the names of the scene. What the generator finds to be accepted it repeats more
often, so that it gets beyond the refusals. A sequence is the same for the same seed and number.

Whatever is commanded, `Simulation.apply` refuses it with ValueError or takes it, `Simulation.step` raises nothing, and
every number of the state is finite.
"""

from __future__ import annotations

import argparse
import random
import re
import sys
import time
from collections import Counter, deque
from dataclasses import fields
from pathlib import Path
from typing import Any

import ligature
import numpy as np
from ligature.bus import Mailbox, Outbox
from ligature.bus.codec import CodecError, Message
from ligature.bus.events import LOG_BYTES, EventLog
from ligature.bus.pacing import Pace, Pacer, Throttle
from ligature.bus.ring import RING_BYTES, Ring
from ligature.model.commands import Command, object_counts
from ligature.model.messages import Choice, Choices, Field, Numbers, OptionalIndex, Packed, Real, Text
from ligature.model.scene import Scene
from ligature.robots.arm import Arm
from ligature.robots.commands import VERBS, ArmCommand
from ligature.robots.ecm import ENDOSCOPES
from ligature.robots.instruments import INSTRUMENTS
from ligature.robots.operating_state import TRANSITIONS, State
from ligature.simulation import Simulation

ROOT = Path(__file__).resolve().parents[2]
SCENES = (
    "scenes/peg_transfer/launch.yaml", "scenes/suturing_small/launch.yaml", "scenes/peg_transfer/launch.yaml",
    "scenes/needle_pick/launch.yaml", "scenes/suturing/launch.yaml",
)  # fmt: skip

Key = tuple[Any, ...]
KINDS = tuple(Message.by_code.values())
WEIGHTS = [1 if issubclass(kind, ArmCommand) else 4 for kind in KINDS]
NUMBERS = (
    0.0, -0.0, 5e-324, -5e-324, 1e-310, 1e-200, 1e-15, 1e-5, -1e-5, 0.01, 0.5, 1.0, -1.0, 3.141592653589793, -3.2, 7.0,
    100.0, -1e3, 1e4, 1e6, -1e6, 1e9, -1e9, 1e12, 1e100, 1.7e308, -1.7e308, float("inf"), float("-inf"), float("nan"),
)  # fmt: skip
INTEGERS = (-1, -2, 255, 256, 2**31 - 1, 2**31, -(2**31) - 1, 2**40, 10**400)
BATCH = 120
"""Most commands between two steps."""

TICKS = 3
"""Most ticks of a step."""

POWER_UP = 250
"""Ticks in which an arm powers up and begins to move; threads make so many too slow."""

LAST = 40
"""Commands that are shown with a failure."""

MADE = "a fault that the test made"

HUGE = 10_000_000
"""Characters of the longest texts."""


_NUMBER = re.compile(r"[\d.e+-]+")


class Failure(AssertionError):
    """What should not have happened, with the seed and the commands that driven there."""


class Generator:
    """Random commands for ``scene``; `accepted` has it prefer the form of a command that was taken."""

    def __init__(self, scene: Scene, rng: random.Random) -> None:
        self._scene, self._rng = scene, rng
        self._counts = object_counts(scene)
        self._lengths: dict[Key, list[int]] = {}
        self._words = [
            *TRANSITIONS, *ENDOSCOPES, *(tool.type for tool in INSTRUMENTS.values()),
            *(body.identity.identifier for body in scene.bodies[:40]), *(s.identity.identifier for s in scene.sensors),
        ]  # fmt: skip
        self._texts = [
            "",
            "\0",
            "\n" * 50,
            "😀" * 50,
            "é" * 100,
            "\ud800",
            "a" * 200,
            "a" * 201,
            "*" * 1000,
            "{}",
            "%s%n",
        ]
        self._huge = ("x" * HUGE, "😀" * HUGE)

    def command(self) -> tuple[Message, Key]:
        """A command, and the key under which `accepted` remembers its form."""
        kind = self._rng.choices(KINDS, weights=WEIGHTS)[0]
        values: dict[str, Any] = {}
        for name, _, field in kind.fields():
            values[name] = self._value(name, field, values, (kind, self._form(values), name))
        return kind(**values), (kind, self._form(values))

    def accepted(self, command: Message, key: Key) -> None:
        """Remember how long the vectors of a command were that was taken."""
        for field in fields(command):
            value = getattr(command, field.name)
            if isinstance(value, tuple):
                lengths = self._lengths.setdefault((*key, field.name), [])
                if len(value) not in lengths:
                    lengths.append(len(value))

    def _form(self, values: dict[str, Any]) -> Any:
        """What decides how many numbers a command takes, beside its class."""
        index = values.get("arm")
        known = isinstance(index, int) and 0 <= index < len(self._scene.arms)
        return self._scene.arms[index].kind if known and index is not None else values.get("type", values.get("kind"))

    def _value(self, name: str, field: Field, values: dict[str, Any], key: Key) -> Any:
        rng = self._rng
        if getattr(field, "optional", False) and rng.random() < 0.4:
            return None
        if isinstance(field, Packed):
            return rng.random() < 0.5 if field.type is bool else self._index(name, values)
        if isinstance(field, OptionalIndex):
            return None if rng.random() < 0.4 else self._index(name, values)
        if isinstance(field, Real):
            return self._number()
        if isinstance(field, Choice):
            return rng.choice(field.options) if rng.random() < 0.98 else rng.choice(("ghost", "", "x" * HUGE, None))
        if isinstance(field, Choices):
            return tuple(rng.choice(field.options) for _ in range(self._length(key)))
        if isinstance(field, Numbers):
            ours = field.length is not None and rng.random() < 0.8
            return self._vector(field.length if ours and field.length else self._length(key))
        assert isinstance(field, Text), field
        return self._text()

    def _index(self, name: str, values: dict[str, Any]) -> int:
        if self._rng.random() < 0.02:
            return self._rng.choice(INTEGERS)
        what = values.get("kind", name) if name == "index" else "body" if name == "parent" else name
        return self._rng.randrange(self._counts.get(what, 3) + (self._rng.random() < 0.02) or 1)

    def _length(self, key: Key) -> int:
        known = self._lengths.get(key)
        if known and self._rng.random() < 0.9:
            return self._rng.choice(known)
        return self._rng.choice((0, 1, 2, 3, 4, 6, 7, 8, 12, 14, 19, 59, self._rng.randrange(66), 1000))

    def _number(self) -> float:
        return self._rng.choice(NUMBERS) if self._rng.random() < 0.4 else self._rng.uniform(-2.0, 2.0)

    def _vector(self, length: int) -> tuple[float, ...]:
        """Ordinary numbers, with a quaternion where a pose may have one; now and then one or all of them are not."""
        rng, mode = self._rng, self._rng.random()
        if mode < 0.15:
            return tuple(self._number() for _ in range(length))
        scale = rng.choice((1e-3, 0.05, 0.05, 1.0, 30.0, 1e4))
        numbers = [rng.gauss(0.0, scale) for _ in range(length)]
        for start in {4: (0,), 7: (3,), 19: (3,), 59: (3, 7)}.get(length, ()):
            quaternion = np.array([rng.gauss(0.0, 1.0) for _ in range(4)])
            numbers[start : start + 4] = (quaternion / np.linalg.norm(quaternion)).tolist()
        if mode < 0.35 and numbers:
            numbers[rng.randrange(length)] = rng.choice(NUMBERS)
        return tuple(numbers)

    def _text(self) -> str:
        rng, mode = self._rng, self._rng.random()
        if mode < 0.7:
            return rng.choice(self._words)
        if mode < 0.71:
            return rng.choice(self._huge)
        if mode < 0.85:
            return rng.choice(self._texts)
        return "".join(chr(rng.randrange(1, 0xD7FF)) for _ in range(rng.randrange(70)))


class Run:
    """One simulation under fire; commands go straight to it, or through a ring, the mailbox and back as events."""

    def __init__(self, scene: Scene, seed: int) -> None:
        self.seed, self.rng = seed, random.Random(seed)
        self.scene, self.simulation = scene, Simulation(scene)
        self._generator = Generator(scene, self.rng)
        self._ring = Ring(memoryview(bytearray(RING_BYTES)))
        self._outbox, self._mailbox = Outbox(self._ring), Mailbox(scene, {"test": self._ring})
        self._pacer = Pacer(1e-3)
        self._log, self._last = EventLog(memoryview(bytearray(LOG_BYTES))), deque[tuple[bool, Message]](maxlen=LAST)
        self.sent = self.taken = 0
        self.seen: Counter[tuple[str, str, str]] = Counter()
        self.faults, self.refusals = Counter[str](), Counter[str]()
        self._finite = _floats(self.simulation.state)

    def go(self, commands: int) -> None:
        """Send ``commands`` commands; raises `Failure`."""
        end = self.sent + commands
        while self.sent < end:
            try:
                self._burst(min(self.rng.randrange(1, BATCH), end - self.sent))
            except Exception as error:
                shown = "\n".join(_shown(*sent) for sent in self._last)
                raise Failure(f"seed {self.seed}, after {self.sent} commands: {error!r}; the last:\n{shown}") from error

    def _prepare(self, arm: Arm, state: State) -> None:
        """Bring an arm into an operating state: what it refuses is refused there."""
        if state is State.FAULT:
            arm.fault(MADE)
            return
        arm.disable()
        if state is not State.DISABLED:
            arm.adopt()
        if state is State.PAUSED:
            arm.pause()
        if state is State.ENABLED and self.rng.random() < 0.3:
            arm.unhome()

    def _burst(self, count: int) -> None:
        for arm in self.simulation.arms.values():
            if self.rng.random() < 0.3:
                self._prepare(arm, self.rng.choice((State.ENABLED, State.ENABLED, *State)))
        through_bus = self.rng.random() < 0.5
        for _ in range(count):
            self._send(*self._generator.command(), through_bus)
        if through_bus:
            for message in self._mailbox.take():
                self._obey(message)
        if self.rng.random() < 0.002:
            self.simulation.restore(self.simulation.snapshot())
        long = not self.scene.rods and self.rng.random() < 0.03
        self.simulation.step(POWER_UP if long else self.rng.randrange(1, TICKS + 1))
        self._check()

    def _send(self, message: Message, key: Key, through_bus: bool) -> None:
        self.sent += 1
        self._last.append((through_bus, message))
        if isinstance(message, ArmCommand) and 0 <= message.arm < len(self.scene.arms):
            arm = self.simulation.arms[self.scene.arms[message.arm].name]
            self.seen[self.scene.arms[message.arm].kind.name, message.verb, arm.operating_state.state.name] += 1
        if through_bus:
            try:
                self._outbox.push(message)
            except CodecError:
                return
        elif self._obey(message):
            self._generator.accepted(message, key)

    def _obey(self, message: Message) -> bool:
        """As the physics process does; whether the command was taken."""
        try:
            if isinstance(message, Throttle):
                self._pacer.throttle(message)
            elif not isinstance(message, Command):
                message.check()
                if isinstance(message, Pace):
                    self._pacer.pace(message)
            else:
                before = {name: len(arm.events) for name, arm in self.simulation.arms.items()}
                self.simulation.apply(message)
                self.taken += 1
                return not any(
                    event.name == "warning"
                    for name, arm in self.simulation.arms.items()
                    for event in list(arm.events)[before[name] :]
                )
        except ValueError as error:
            assert len(str(error)) < 2000, "a refusal repeats what it refuses"
        return False

    def _check(self) -> None:
        for name, values in self._finite:
            assert np.isfinite(values).all(), f"{name} is not finite"
        for arm, name, value in self.simulation.arms.events():
            self._log.write(arm, name, value)
            if name == "error":
                self.faults[str(value).partition(": ")[2][:60]] += MADE not in value
            elif name == "warning":
                self.refusals[_NUMBER.sub("0", str(value))[:60]] += 1
        for event in self._log.read():
            assert 0 <= event.arm < len(self.scene.arms)
        assert self._log.lost == 0
        for problem in self.simulation.problems:
            assert len(str(problem)) < 2000, "a problem repeats what it is about"
            assert " failed; " not in problem.message, problem.message
        assert len(self.simulation.problems) < 1000
        self.simulation.problems.clear()


def _shown(through_bus: bool, message: Message) -> str:
    """A command as a line: long texts and vectors are cut."""
    parts = []
    for field in fields(message):
        value = getattr(message, field.name)
        cut = value[:100] if isinstance(value, str) else value
        parts.append(f"{field.name}={repr(cut)[:300]}")
    return f"{'bus ' if through_bus else ''}{type(message).__name__}({', '.join(parts)})"


def _floats(state: np.ndarray) -> list[tuple[str, np.ndarray]]:
    """Views of all floating-point fields of a state record."""
    found = []

    def walk(name: str, values: np.ndarray) -> None:
        if values.dtype.names:
            for field in values.dtype.names:
                walk(f"{name}/{field}" if name else field, values[field])
        elif values.dtype.kind == "f":
            found.append((name, values))

    walk("", state)
    return found


def missing(seen: Counter[tuple[str, str, str]], kinds: set[str]) -> list[tuple[str, str, str]]:
    """What was not commanded yet: every verb of every kind of arm in every operating state."""
    wanted = ((kind, verb, state.name) for kind in kinds for verb in VERBS for state in State)
    return sorted(set(wanted) - set(seen))


def main() -> int:
    """Entry point."""
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("--commands", type=int, default=1_000_000)
    flags.add_argument("--seed", type=int, default=0)
    flags.add_argument("--run", type=int, default=20_000, help="commands to one simulation")
    flags.add_argument("--scene", action="append", help="instead of ours; may be repeated")
    given = flags.parse_args()
    scenes = [ligature.load(ROOT / scene) for scene in given.scene or SCENES]
    seen, faults, refusals, failures = Counter[tuple[str, str, str]](), Counter[str](), Counter[str](), 0
    begin, sent, taken, seed = time.monotonic(), 0, 0, given.seed
    while sent < given.commands:
        run = Run(scenes[seed % len(scenes)], seed)
        try:
            run.go(min(given.run, given.commands - sent))
        except Failure as failure:
            failures += 1
            sys.stdout.write(f"{failure}\n")
        run.simulation.close()
        sent, taken, seed = sent + run.sent, taken + run.taken, seed + 1
        seen.update(run.seen)
        faults.update(run.faults)
        refusals.update(run.refusals)
        sys.stdout.write(f"{sent} commands after {time.monotonic() - begin:.0f} s\n")
        sys.stdout.flush()
        if failures > 20:
            break
    for what, counts in (("FAULT", faults), ("refused", refusals)):
        for text, count in counts.most_common(30):
            sys.stdout.write(f"  {count} × {what}: {text!r}\n")
    absent = missing(seen, {arm.kind.name for scene in scenes for arm in scene.arms})
    sys.stdout.write(
        f"{sent} commands, {taken} of them taken, in {time.monotonic() - begin:.0f} s; {failures} failures;"
        f" {len(absent)} of arm, verb and operating state never met {absent[:5]}\n"
    )
    return int(failures > 0 or bool(absent))


if __name__ == "__main__":
    sys.exit(main())
