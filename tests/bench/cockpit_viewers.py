"""Browsers that only look on, for `tests.bench.cockpit`: ``URL VERSION COUNT``; ends when its input does.

Light on purpose: it imports nothing of the simulator, reports when all are connected, and takes whatever is sent.
"""

from __future__ import annotations

import asyncio
import os
import sys

import msgspec.msgpack
from websockets.asyncio.client import connect
from websockets.typing import Subprotocol

CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": (1.0, 0.0, 0.0, 0.0), "position": (0.0, 0.0, 1.0), "fov": 0.8,
    "image_height": 800, "image_width": 1200, "near": 0.01, "far": 10.0, "look_at": (0.0, 0.0, 0.0),
    "up_direction": (0.0, 0.0, 1.0),
}  # fmt: skip


async def view(url: str, version: str) -> None:
    """One browser."""
    protocol = Subprotocol(f"viser-v{version}")
    async with connect(url.replace("http", "ws"), subprotocols=[protocol], max_size=None, compression=None) as page:
        await page.send(msgspec.msgpack.encode(CAMERA))
        await page.recv()
        sys.stdout.write("connected\n")
        sys.stdout.flush()
        while True:
            await page.recv()


async def main() -> None:
    """All of them."""
    os.nice(10)
    url, version, count = sys.argv[1], sys.argv[2], int(sys.argv[3])
    crowd = [asyncio.create_task(view(url, version)) for _ in range(count)]
    await asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)
    for task in crowd:
        task.cancel()


asyncio.run(main())
