"""An operator without a browser: speaks what the page's own script speaks, for tests of networks and frozen processes.

``python -m tests.cockpit.wired URL`` presses what the page offers for a throw, one after the other.
"""

from __future__ import annotations

import json
import re
import sys
import threading
import time
from contextlib import suppress
from http.client import HTTPConnection
from typing import Any
from urllib.parse import urlencode, urlsplit

import msgspec.msgpack
import viser
import zstandard
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from tests.cockpit.conftest import until

MOTION = 7
ZSTD = b"\x28\xb5\x2f\xfd"
"""What packed messages begin with."""

CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": (1.0, 0.0, 0.0, 0.0), "position": (0.0, 0.0, 1.0), "fov": 0.8,
    "image_height": 800, "image_width": 1200, "near": 0.01, "far": 10.0, "look_at": (0.0, 0.0, 0.0),
    "up_direction": (0.0, 0.0, 1.0),
}  # fmt: skip
"""What a browser says first; viser takes it for one from then on."""


def plain(message: str | bytes) -> bytes:
    """What viser has packed."""
    data = message if isinstance(message, bytes) else b""
    at = data.find(ZSTD)
    return data if at < 0 else zstandard.ZstdDecompressor().decompressobj().decompress(data[at:])


def _cookie(url: str, token: str) -> str:
    """What the page gives to who shows the token."""
    where = urlsplit(url)
    connection = HTTPConnection(str(where.hostname), where.port, timeout=60)
    connection.request("GET", f"/?{urlencode({'token': token})}")
    given = connection.getresponse().getheader("Set-Cookie")
    connection.close()
    assert given is not None, "the token is taken"
    return given.partition(";")[0]


class Wired:
    """Connections of one page; `facts` and ``picture`` are the newest that came, ``pictures`` how many.

    ``controls`` has kind and properties of what the page shows, by the names that messages give; ``nodes`` are the names
    of what can be clicked or dragged in its 3D view.
    """

    def __init__(self, url: str, token: str = "") -> None:
        address = url.replace("http", "ws").rstrip("/")
        headers = {"Cookie": _cookie(url, token)} if token else {}
        protocol = Subprotocol(f"viser-v{viser.__version__}")
        self._page = connect(
            f"{address}/", subprotocols=[protocol], max_size=None, additional_headers=headers, open_timeout=60
        )
        self._pass, self.facts, self.pictures, self.picture = "", dict[str, Any](), 0, b""
        self.controls, self.nodes = dict[str, tuple[str, dict[str, Any]]](), set[str]()
        self._held: list[float] = [0.0] * MOTION
        self._over = False
        self._page.send(msgspec.msgpack.encode(CAMERA))
        threading.Thread(target=self._read_page, daemon=True).start()
        until(lambda: self._pass, "the page has a pass", 30.0)
        self._wire = connect(f"{address}/wire", max_size=None, additional_headers=headers, open_timeout=60)
        self.orders("hello", self._pass)
        threading.Thread(target=self._read_wire, daemon=True).start()
        threading.Thread(target=self._hold, daemon=True).start()

    def _read_page(self) -> None:
        with suppress(ConnectionClosed):
            for message in self._page:
                data = plain(message)
                if not self._pass and (found := re.search(rb'data-pass="([\w-]+)"', data)):
                    self._pass = found[1].decode()
                if b"Gui" in data or b"TransformControls" in data:
                    self._note(msgspec.msgpack.decode(data)["messages"])

    def _note(self, messages: list[dict[str, Any]]) -> None:
        """What a page would show."""
        for message in messages:
            kind = str(message.get("type", ""))
            if kind.startswith("Gui") and message.get("props"):
                self.controls[message["uuid"]] = kind.removeprefix("Gui").removesuffix("Message"), message["props"]
            elif kind.startswith("TransformControls"):
                self.nodes.add(str(message["name"]))

    def _read_wire(self) -> None:
        with suppress(ConnectionClosed):
            for message in self._wire:
                if isinstance(message, str):
                    self.facts = json.loads(message)
                else:
                    self.pictures, self.picture = self.pictures + 1, message[1:]  # a byte before it counts the eyes
                    self.orders("seen")

    def _hold(self) -> None:
        """What a page does while keys are held."""
        with suppress(ConnectionClosed):
            while not self._over:
                if any(self._held):
                    self.orders("move", self._held)
                time.sleep(0.04)

    def orders(self, word: str, value: Any = None) -> None:
        self._wire.send(json.dumps({"do": word, "value": value}))

    def starts(self, seconds: float = 60.0) -> None:
        """Press *Start* and wait until the arm is ready."""
        self.orders("start")
        until(lambda: self.facts.get("operates") and self.facts.get("ready"), "the arm is ready", seconds)

    def holds(self, axis: int, way: float) -> None:
        """Hold a key; 0 lets it go."""
        self._held = [way if i == axis else 0.0 for i in range(MOTION)]
        self.orders("move", self._held)

    def goes(self) -> None:
        self._over = True
        self._page.close()
        with suppress(Exception):
            self._wire.close()

    # --- a throw ---------------------------------------------------------------------------------

    @property
    def help(self) -> dict[str, Any]:
        """What the page shows of a throw."""
        return dict(self.facts.get("assist") or {"stage": ""})

    def presses(self, word: str, then: str) -> None:
        """Press a button of the help, and wait until the next step is offered."""
        self.orders("assist", word)
        until(lambda: self.help["stage"] == then and not self.help["busy"], lambda: f"{then}: {self.help}", 300.0)


def main() -> None:
    """Do a throw."""
    operator = Wired(sys.argv[1])
    operator.starts(120.0)
    until(lambda: operator.help["stage"] == "pick" and not operator.facts["starting"], "it starts", 120.0)
    for word, then in (("pick", "bring"), ("bring", "drive")):
        operator.presses(word, then)
        sys.stdout.write(f"{then}\n")
        sys.stdout.flush()
    operator.orders("drive", 1.0)
    until(lambda: operator.help.get("through"), lambda: f"through: {operator.help}", 300.0)
    sys.stdout.write("through\n")


if __name__ == "__main__":
    main()
