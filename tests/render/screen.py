"""A screen without a monitor: Xvfb, what it shows, and a mouse and a keyboard for it."""

from __future__ import annotations

import ctypes
import os
import shutil
import struct
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

SIZE = (1024, 700)
_KEYSYMS = {" ": 0x20, ".": 0x2E, "Control": 0xFFE3, "Shift": 0xFFE1, "F11": 0xFFC8}


class Screen:
    """A running Xvfb; ``display`` is its name."""

    def __init__(self, display: str, folder: Path) -> None:
        self.display, self._file = display, folder / "Xvfb_screen0"

    def picture(self) -> np.ndarray:
        """What is shown, (h, w, 3); the file is in the format of xwd."""
        data = self._file.read_bytes()
        head = struct.unpack(">25I", data[:100])
        size, width, height, row, colours = head[0], head[4], head[5], head[12], head[19]
        pixels = np.frombuffer(data, np.uint8, row * height, size + 12 * colours)
        return pixels.reshape(height, row)[:, : 4 * width].reshape(height, width, 4)[..., 2::-1].copy()


class Hands:
    """A mouse and a keyboard, by the XTEST extension."""

    def __init__(self, display: str) -> None:
        self._x, self._test = ctypes.CDLL("libX11.so.6"), ctypes.CDLL("libXtst.so.6")
        self._x.XOpenDisplay.restype = ctypes.c_void_p
        self._display = ctypes.c_void_p(self._x.XOpenDisplay(display.encode()))

    def move(self, x: int, y: int) -> None:
        self._test.XTestFakeMotionEvent(self._display, -1, x, y, 0)
        self._flush()

    def button(self, number: int, down: bool) -> None:
        self._test.XTestFakeButtonEvent(self._display, number, int(down), 0)
        self._flush()

    def key(self, name: str, down: bool | None = None) -> None:
        """Press a key, or only one half of that."""
        symbol = _KEYSYMS.get(name, ord(name[0].lower()))
        code = self._x.XKeysymToKeycode(self._display, ctypes.c_ulong(symbol))
        for state in (True, False) if down is None else (down,):
            self._test.XTestFakeKeyEvent(self._display, code, int(state), 0)
            self._flush()

    def _flush(self) -> None:
        self._x.XFlush(self._display)
        time.sleep(0.05)


@contextmanager
def xvfb(folder: Path) -> Iterator[Screen]:
    """A screen of `SIZE`; skips where there is no Xvfb."""
    if shutil.which("Xvfb") is None:
        pytest.skip("Xvfb is not installed (Debian package xvfb)")
    read, write = os.pipe()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(write), "-screen", "0", f"{SIZE[0]}x{SIZE[1]}x24", "-fbdir", str(folder)],
        pass_fds=[write], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    os.close(write)
    try:
        number = os.read(read, 16).decode().strip()
        yield Screen(f":{number}", folder)
    finally:
        os.close(read)
        server.terminate()
        server.wait()
