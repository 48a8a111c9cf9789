"""Hostile messages to the page of a run, by the connections that a browser has: ``python -m tests.fuzz.page [COUNT]``.

Every control that the page shows gets values that no person could have chosen, and, one in four, such as a person
chooses; between them come cameras, gizmos, keys, messages of every other kind that viser can read, junk, and at the rate
that the page allows orders of its own script. What the page cannot read ends its connection and no other; all else must be
read to the end. Then a browser comes and starts the arms. The run ends with status 1 when a process of the run was replaced
or ended, the arms do not start, or viser wrote to the terminal. Printed are the messages by kind of control.
"""

from __future__ import annotations

import dataclasses
import json
import os
import random
import subprocess
import sys
import tempfile
import threading
import warnings
from collections import Counter
from contextlib import suppress
from pathlib import Path
from typing import Any, cast, get_args, get_origin, get_type_hints

from ligature.cockpit.intake import OFFERED
from ligature.cockpit.orders import ORDERS
from ligature.cockpit.wire import MOST_RATE
from ligature.process import end_with_parent
from viser._messages import Message
from websockets.exceptions import ConnectionClosed

from tests.bench.on_ros import ROOT, own_master
from tests.bench.soak_served import Visitor, processes
from tests.cockpit import test_hands, test_intake
from tests.cockpit.wired import Wired
from tests.waiting import until

SCENE = ROOT / "scenes" / "suturing_small" / "launch.yaml"
JUNK = (b"\xff" * 100, b"\x93\x01\x02\x03", b'{"type": 3}', b"x" * 100_000)
KINDS = sorted(Message.get_subclasses(), key=lambda kind: kind.__name__)
"""All that viser can read; few of them come from browsers, and fewer does the page ask for."""

LAST = b"\xc1"
"""What ends a connection, for a reason that nothing before it has: pongs would come before the page reads."""

UNREADABLE = 1e-3
"""How many of the messages that the page cannot read are sent: each ends its connection, whatever follows is not read."""

ROUND = 4000
"""Messages after which all that were sent are waited for."""

SHOWN = 16
"""Kinds that are printed, the most frequent."""


class Stranger(Wired):
    """Connections that send what no browser does."""

    def sends(self, data: bytes) -> bool:
        """Whether the connection still took it."""
        try:
            self._page.send(data)
        except ConnectionClosed:
            return False
        return True

    def end(self) -> str:
        """Send what ends the connection, and return why the page, which has then read all before, ended it."""
        self.sends(LAST)
        until(lambda: self._page.close_code, "the page has read all and ends the connection", 120.0)
        return f"{self._page.close_code} {self._page.close_reason}"

    def orders_of_a_page(self, over: threading.Event, rng: random.Random, done: Counter[str]) -> None:
        """Orders and odd ones, at half the rate that the page allows."""
        with suppress(ConnectionClosed, OSError):
            while not over.wait(2.0 / MOST_RATE):
                self._wire.send(json.dumps({"do": rng.choice(list(ORDERS)), "value": rng.choice(test_hands.ODD)}))
                done["orders"] += 1


def value(props: dict[str, Any], rng: random.Random) -> Any:
    """What a person could choose of a control, or something odd."""
    if rng.random() < 0.75:
        return rng.choice(test_intake.ODD)
    if options := props.get("options"):
        return rng.choice(list(options))
    if "min" in props and "max" in props:
        with suppress(TypeError):
            return rng.uniform(float(props["min"]), float(props["max"]))
    return rng.choice([True, False, "a text"])


def field(hint: Any, texts: list[str], rng: random.Random) -> Any:
    """What a field of a message may hold by its type, or something odd."""
    if rng.random() < 0.2:
        return rng.choice(test_intake.ODD)
    if get_origin(hint) is tuple:
        return tuple(field(inner, texts, rng) for inner in get_args(hint) if inner is not Ellipsis)
    if get_args(hint):
        return field(rng.choice(get_args(hint)), texts, rng)
    plain = {float: rng.uniform(-1.0, 1.0), int: rng.randint(0, 3), str: rng.choice(texts), bytes: b"bytes", bool: True}
    return plain[hint] if hint in plain else rng.choice(test_intake.ODD)


def fields(kind: type[Message], texts: list[str], rng: random.Random) -> dict[str, Any]:
    """All fields of a message."""
    hints = get_type_hints(kind)
    return {f.name: field(hints[f.name], texts, rng) for f in dataclasses.fields(cast(Any, kind)) if f.init}


def readable(data: bytes) -> bool:
    """Whether the page's decoder makes a message of this."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of odd numbers, as in the page
        try:
            Message.deserialize(data)
        except Exception:  # as the page takes it
            return False
    return True


def drawn(stranger: Stranger, rng: random.Random) -> tuple[str, bytes]:
    """One message and its kind."""
    chance = rng.random()
    if chance < 0.6 and stranger.controls:
        uuid = rng.choice(sorted(stranger.controls))
        kind, props = stranger.controls[uuid]
        names = rng.sample(test_intake.PROPERTIES, 1 if rng.random() < 0.6 else 2)
        return kind, test_intake.update(uuid, {name: value(props, rng) for name in names})
    if chance < 0.99:
        message = rng.choice([*OFFERED] if chance < 0.8 else KINDS)
        texts = [*sorted(stranger.controls), *sorted(stranger.nodes), "a text"]
        return message.__name__, test_intake.packed(message.__name__, **fields(message, texts, rng))
    return "junk", rng.choice(JUNK)


def message(stranger: Stranger, rng: random.Random) -> tuple[str, bytes, bool]:
    """One message, its kind, and whether the page can read it."""
    while True:
        kind, data = drawn(stranger, rng)
        if (sound := readable(data)) or rng.random() < UNREADABLE:
            return kind, data, sound


def attack(url: str, count: int) -> Counter[str]:
    """Send ``count`` messages; a connection that the page ends is followed by another.

    The page ends those that sent what it cannot read, and reads the others to their last message.
    """
    rng, sent, over, rest = random.Random(17), Counter[str](), threading.Event(), count
    while rest > 0:
        stranger = Stranger(url)
        sent["connections"] += 1
        until(lambda s=stranger: s.facts.get("free"), lambda s=stranger: f"the desk is free: {s.facts}", 60.0)  # type: ignore[misc]
        stranger.orders("start")  # whoever operates is shown all controls
        until(
            lambda s=stranger: any(kind == "Slider" for kind, _ in [*s.controls.values()]),
            lambda s=stranger: f"sliders: {s.facts}",
            60.0,
        )  # type: ignore[misc]
        over.clear()
        threading.Thread(target=stranger.orders_of_a_page, args=(over, rng, sent), daemon=True).start()
        for _ in range(min(ROUND, rest)):
            rest -= 1
            kind, data, sound = message(stranger, rng)
            sent[kind] += 1
            if not stranger.sends(data) or not sound:
                break
        over.set()
        why = stranger.end()
        sent["connections read to the end"] += sound
        assert not sound or why.endswith("DecodeError"), f"{why}, after {kind} {data[:200]!r}"
        stranger.goes()
        sys.stdout.write(f"{count - rest} of {count} messages, {sent['connections']} connections\n")
        sys.stdout.flush()
    return sent


def main() -> int:
    """Entry point."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 3_000
    lines: list[str] = []
    with tempfile.TemporaryDirectory() as folder, own_master("page_fuzz"):
        command = [str(Path(sys.executable).parent / "ligature"), "run", str(SCENE), "-p", "100", "--no-cameras"]
        run = subprocess.Popen(
            [*command, "--at", "127.0.0.1:0"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, cwd=folder,
            env=dict(os.environ, COLUMNS="200"), preexec_fn=end_with_parent,
        )  # fmt: skip
        assert run.stdout is not None
        output = run.stdout
        threading.Thread(target=lambda: lines.extend(output), daemon=True).start()
        try:
            ready = until(lambda: next((x for x in lines if x.startswith("cockpit ready")), ""), "a page", 120.0)
            url = ready.partition(": ")[2].strip()
            first = processes(run.pid)
            sent = attack(url, count)
            visitor = Visitor(url)
            until(lambda: visitor.facts.get("free"), lambda: f"the desk is free: {visitor.facts}", 60.0)
            visitor.orders("start")
            visitor.sets("Paused", False)
            visitor.starts(120.0)
            visitor.goes()
            same = run.poll() is None and processes(run.pid) == first
        finally:
            run.terminate()
            run.wait(30.0)
    for kind, number in sent.most_common(SHOWN):
        sys.stdout.write(f"| {kind} | {number} |\n")
    sys.stdout.write(f"| {len(sent) - SHOWN} other kinds | {sum(n for _, n in sent.most_common()[SHOWN:])} |\n")
    quiet = not any("Traceback" in line or "does not match annotation" in line for line in lines)
    sys.stdout.write("the arms start afterwards; " + ("no process ended; " if same else "A PROCESS ENDED; "))
    sys.stdout.write("nothing on the terminal\n" if quiet else f"ON THE TERMINAL:\n{''.join(lines)}")
    return 0 if same and quiet else 1


if __name__ == "__main__":
    sys.exit(main())
