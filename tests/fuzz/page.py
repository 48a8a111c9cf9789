"""Hostile messages to the page of a run, by the connections that a browser has: ``python -m tests.fuzz.page [COUNT]``.

Every control that the page shows gets values that no person could have chosen, and, one in four, such as a person
chooses; between them come updates of the gizmo, clicks, junk, and at the rate that the page allows orders of its own
script. Then a browser comes and starts the arms. The run ends with status 1 when a process of the run was replaced or
ended, or the arms do not start. Printed are the messages by kind of control.
"""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
import tempfile
import threading
from collections import Counter
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec.msgpack
from ligature.cockpit.orders import ORDERS
from ligature.cockpit.wire import MOST_RATE
from ligature.process import end_with_parent
from websockets.exceptions import ConnectionClosed

from tests.bench.on_ros import ROOT, own_master
from tests.bench.soak_served import Visitor, processes
from tests.cockpit import test_hands, test_intake
from tests.cockpit.wired import Wired
from tests.waiting import until

SCENE = ROOT / "scenes" / "suturing_small" / "launch.yaml"
JUNK = (b"", b"\xc1", b"\xff" * 100, b"\x93\x01\x02\x03", b'{"type": 3}', b"x" * 100_000)
OTHERS = (
    "TransformControlsUpdateMessage", "TransformControlsDragEndMessage", "SceneNodeClickMessage", "ScenePointerMessage",
    "ViewerCameraMessage", "GuiModalMessage", "FileTransferStart", "FileTransferPart", "ResetSceneMessage", "NoMessage",
)  # fmt: skip
ROUND = 4000
"""Messages after which all that were sent are waited for."""


class Stranger(Wired):
    """Connections that send what no browser does."""

    def sends(self, data: bytes) -> bool:
        """Whether the connection still took it."""
        try:
            self._page.send(data)
        except ConnectionClosed:
            return False
        return True

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


def message(stranger: Stranger, rng: random.Random) -> tuple[str, bytes]:
    """One message and its kind."""
    chance = rng.random()
    if chance < 0.85 and stranger.controls:
        uuid = rng.choice(sorted(stranger.controls))
        kind, props = stranger.controls[uuid]
        names = rng.sample(test_intake.PROPERTIES, 1 if rng.random() < 0.6 else 2)
        return kind, test_intake.update(uuid, {name: value(props, rng) for name in names})
    if chance < 0.9995:
        kind, odd = rng.choice(OTHERS), test_intake.ODD
        name = rng.choice([*sorted(stranger.nodes), rng.choice(odd)])
        words = {"type": kind, "name": name, "position": rng.choice([(0.1, 0.2, 0.3), rng.choice(odd)])}
        return kind, msgspec.msgpack.encode({**words, "wxyz": rng.choice([(1.0, 0.0, 0.0, 0.0), rng.choice(odd)])})
    return "junk", rng.choice(JUNK)


def attack(url: str, count: int) -> Counter[str]:
    """Send ``count`` messages; a connection that the page ends is followed by another."""
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
            kind, data = message(stranger, rng)
            sent[kind] += 1
            if not stranger.sends(data):
                break
        over.set()
        with suppress(Exception):  # it may be closed by the page
            stranger._page.ping().wait(60.0)
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
    for kind, number in sent.most_common():
        sys.stdout.write(f"| {kind} | {number} |\n")
    sys.stdout.write("the arms start afterwards; " + ("no process ended\n" if same else "A PROCESS ENDED\n"))
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())
