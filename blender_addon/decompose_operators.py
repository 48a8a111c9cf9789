"""Convex decomposition by CoACD in a process of its own: progress, cancel by Esc, results kept by content."""

import hashlib
import importlib.util
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

import bpy
import numpy as np

from . import compat, making
from .ligature.mesh.cache import write_atomically
from .mesh_data import points_of
from .object_operators import NeedsBody, active_body
from .placing import children_with
from .quality import measure
from .solids import own_solid

WORKER = Path(__file__).with_name("decompose_worker.py")


class Job:
    """One decomposition under way; poll `finished`, or `cancel` it."""

    def __init__(self, vertices, faces, settings):
        words = json.dumps(settings, sort_keys=True)
        key = hashlib.sha256(vertices.tobytes() + faces.astype(np.int32).tobytes() + words.encode()).hexdigest()[:32]
        self.kept = Path(compat.cache_folder()) / "decomposition" / f"{key}.npz"
        self.process = None
        self.started = time.monotonic()
        if not self.kept.is_file():
            self.folder = tempfile.TemporaryDirectory(prefix="adf-coacd-")
            source, self.target = Path(self.folder.name, "mesh.npz"), Path(self.folder.name, "pieces.npz")
            np.savez(source, vertices=vertices, faces=faces)
            self.log = open(Path(self.folder.name, "log"), "wb")  # noqa: SIM115  (closed with the process)
            self.process = subprocess.Popen(
                [*_python(), str(source), str(self.target), words, *_packages()],
                stdout=self.log, stderr=subprocess.STDOUT, env={**os.environ, "OMP_NUM_THREADS": "2"},
            )  # fmt: skip

    @property
    def finished(self):
        """Whether the pieces are there, or the process has ended without."""
        return self.process is None or self.process.poll() is not None

    @property
    def progress(self):
        """Parts that the mesh is cut into so far, and the share of them, 0 to 1, that this round has looked at."""
        if self.process is None:
            return 1, 1.0
        words = Path(self.log.name).read_text("utf-8", "replace")
        pool = re.findall(r"waiting pool: (\d+)", words)
        done = re.findall(r"Processing \[([\d.]+)%\]", words.rpartition("waiting pool")[2])
        return int(pool[-1]) if pool else 1, max((float(share) / 100.0 for share in done), default=0.0)

    def pieces(self):
        """Vertices (n, 3) of each piece; raises ValueError with the process's last words."""
        if self.process is not None:
            self.log.close()
            if self.process.returncode or not self.target.is_file():
                words = Path(self.log.name).read_text("utf-8", "replace").strip().splitlines()[-1:]
                raise ValueError(f"CoACD failed: {' '.join(words) or self.process.returncode}")
            write_atomically(self.kept, self.target.read_bytes())
        with np.load(self.kept, allow_pickle=False) as arrays:
            return [np.asarray(arrays[name], dtype=float).reshape(-1, 3) for name in sorted(arrays.files)]

    def cancel(self):
        """End the process."""
        if self.process is not None and self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        if self.process is not None:
            self.log.close()


def _python():
    """What runs the worker: this Blender without a window, or the Python that holds Blender as a module."""
    if bpy.app.binary_path:
        return [
            bpy.app.binary_path,
            "-b",
            "--factory-startup",
            "--python-exit-code",
            "1",
            "--python",
            str(WORKER),
            "--",
        ]
    return [sys.executable, str(WORKER)]


def _packages():
    """Folders in which the worker finds CoACD."""
    found = importlib.util.find_spec("coacd")
    return [str(Path(found.origin).parent.parent)] if found else []


class ADF_OT_decompose(NeedsBody, bpy.types.Operator):
    """Decompose the body's mesh into convex pieces in the background; Esc ends it"""

    bl_idname = "adf.decompose"
    bl_label = "Decompose into Convex Pieces"
    bl_options = {"REGISTER", "UNDO", "PRESET"}

    threshold: bpy.props.FloatProperty(
        name="Threshold",
        description="Concavity that is allowed; smaller follows closer",
        default=0.05,
        min=0.01,
        max=1.0,
    )
    max_hulls: bpy.props.IntProperty(name="Most Pieces", description="0 sets no limit", default=32, min=0, max=256)
    seed: bpy.props.IntProperty(name="Seed", default=0, min=0)

    def execute(self, context):
        """Without waiting in the background: the process is waited for here."""
        if not self._start(context):
            return {"CANCELLED"}
        while not self._job.finished:
            time.sleep(0.05)
        return self._take(context)

    def invoke(self, context, event):
        if bpy.app.background:
            return self.execute(context)
        if not self._start(context):
            return {"CANCELLED"}
        manager = context.window_manager
        self._timer = manager.event_timer_add(0.1, window=context.window)
        manager.progress_begin(0, 100)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC":
            self._job.cancel()
            self._end(context)
            self.report({"WARNING"}, "The decomposition was ended")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        seconds = time.monotonic() - self._job.started
        parts, share = self._job.progress
        context.window_manager.progress_update(100.0 * share)
        context.workspace.status_text_set(
            f"Decomposing '{self._body}': {share:.0%} of {parts} parts, {seconds:.0f} s. Esc ends it"
        )
        if not self._job.finished:
            return {"PASS_THROUGH"}
        self._end(context)
        return self._take(context)

    def _start(self, context):
        body = active_body(context)
        if body.type != "MESH":
            self.report({"ERROR"}, f"'{body.name}' has no mesh to decompose")
            return False
        self._body = body.name
        self._vertices, self._faces = points_of(own_solid(body))
        if not len(self._faces):
            self.report({"ERROR"}, f"'{body.name}' has no face")
            return False
        settings = {"threshold": self.threshold, "max_convex_hull": self.max_hulls or -1, "seed": self.seed}
        self._job = Job(self._vertices, self._faces, settings)
        return True

    def _end(self, context):
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)

    def _take(self, context):
        body = bpy.data.objects.get(self._body)
        if body is None:
            self.report({"ERROR"}, f"'{self._body}' is gone")
            return {"CANCELLED"}
        try:
            pieces = self._job.pieces()
        except (ValueError, OSError) as error:
            self.report({"ERROR"}, f"'{body.name}': {error}")
            return {"CANCELLED"}
        for old in children_with(body, "HULL"):
            bpy.data.objects.remove(old)
        for piece in pieces:
            with suppress(ValueError):  # CoACD's flat slivers collide with nothing
                making.add_hull(body, piece)
        body.adf.body.collision_mesh_type = "CONVEX_HULL"
        try:
            self.report({"INFO"}, f"'{body.name}': {measure(body)}")
        except ValueError as error:
            self.report({"WARNING"}, f"'{body.name}': {error}")
        return {"FINISHED"}


CLASSES = (ADF_OT_decompose,)


def attach() -> None:
    """Nothing but the classes."""


def detach() -> None:
    """Nothing but the classes."""
