"""Processes that operators wait for, while the scene may be edited; Esc ends them.

What a process prints is kept whole: when it fails, all of it goes into a text in Blender.
"""

import os
import subprocess
import tempfile
import time
from pathlib import Path

import bpy

from .steps import InSteps


class Process:
    """A command under way in a folder of its own, which goes with it.

    A Python would import from the folder that Blender was started in: files of others may lie there.
    """

    def __init__(self, name, environment=None):
        self.folder = tempfile.TemporaryDirectory(prefix=f"adf-{name}-")
        self.root = Path(self.folder.name)
        self._environment = {**os.environ, **(environment or {})}
        self._popen = None

    def start(self, command):
        """Start the command; raises OSError when it cannot be."""
        with open(self.root / "log", "wb") as log:
            self._popen = subprocess.Popen(
                command, stdout=log, stderr=subprocess.STDOUT, env=self._environment, stdin=subprocess.DEVNULL,
                cwd=self.root,
            )  # fmt: skip

    @property
    def finished(self):
        """Whether it has ended."""
        return self._popen is None or self._popen.poll() is not None

    @property
    def status(self):
        """Its exit status, once it has ended."""
        return self._popen.returncode

    @property
    def words(self):
        """All that it has printed so far."""
        return (self.root / "log").read_text("utf-8", "replace")

    def cancel(self):
        """End it."""
        if not self.finished:
            self._popen.kill()
            self._popen.wait()


def failure(name, words, status=""):
    """A line about a failed process; all that it printed goes into the text ``name``."""
    lines = words.strip().splitlines()
    text = bpy.data.texts.get(name) or bpy.data.texts.new(name)
    text.from_string(words)
    last = next((line.strip() for line in reversed(lines) if line.strip()), f"it ended with status {status}")
    return f"{last}; the text '{name}' has all that it printed"


class Waits(InSteps):
    """An operator that waits for ``self.job``: with ``finished`` and ``cancel``.

    ``begin`` takes the steps that start the job and returns whether it was started, ``shown`` returns words and the
    share that is done (None when unknown), ``take`` makes of the result what the operator returns. The scene may be
    edited while the job goes on.
    """

    def steps(self, context):
        """Start the job, wait for it, and take its result."""
        begun = yield from self.begin(context)
        if not begun:
            return {"CANCELLED"}
        self.blocks = False
        share = 0.0
        try:
            while not self.job.finished:
                words, known = self.shown()
                share = share if known is None else known
                yield words, share
                if not self.started():
                    time.sleep(0.05)
        finally:
            self.job.cancel()
        return self.take(context)
