"""Convex decomposition by CoACD in a process of its own: progress, cancel by Esc, results kept by content.

Where Blender's Python lacks CoACD, as Debian's does, *Fetch CoACD* installs its wheel into the extension's own folder.
"""

import hashlib
import importlib.util
import json
import re
import sys
from contextlib import suppress
from functools import cache
from pathlib import Path

import bpy
import numpy as np

from . import compat, making
from .ligature.mesh.cache import write_atomically
from .mesh_reading import points_of
from .object_operators import NeedsBody, active_body
from .poses import children_with
from .quality import measure
from .solids import own_solid
from .waiting import Process, Waits, failure

WORKER = Path(__file__).with_name("decompose_worker.py")
COACD = "coacd==1.0.14"
"""What is fetched: the version whose wheels the extension ships for Blender 4.2 and later."""


class Job:
    """One decomposition under way; poll `finished`, or `cancel` it."""

    def __init__(self, vertices, faces, settings):
        words = json.dumps(settings, sort_keys=True)
        key = hashlib.sha256(vertices.tobytes() + faces.astype(np.int32).tobytes() + words.encode()).hexdigest()[:32]
        self.kept = Path(compat.cache_folder()) / "decomposition" / f"{key}.npz"
        self.process = None
        if not self.kept.is_file():
            self.process = Process("coacd", {"OMP_NUM_THREADS": "2"})
            source, self.target = self.process.root / "mesh.npz", self.process.root / "pieces.npz"
            np.savez(source, vertices=vertices, faces=faces)
            self.process.start([*_worker(), str(source), str(self.target), words, *packages()])

    @property
    def finished(self):
        """Whether the pieces are there, or the process has ended without."""
        return self.process is None or self.process.finished

    @property
    def progress(self):
        """Parts that the mesh is cut into so far, and the share of them, 0 to 1, that this round has looked at."""
        if self.process is None:
            return 1, 1.0
        words = self.process.words
        pool = re.findall(r"waiting pool: (\d+)", words)
        done = re.findall(r"Processing \[([\d.]+)%\]", words.rpartition("waiting pool")[2])
        return int(pool[-1]) if pool else 1, max((float(share) / 100.0 for share in done), default=0.0)

    def pieces(self):
        """Vertices (n, 3) of each piece; raises ValueError with the process's last words."""
        if self.process is not None:
            if self.process.status or not self.target.is_file():
                raise ValueError(f"CoACD failed: {failure('CoACD', self.process.words, self.process.status)}")
            write_atomically(self.kept, self.target.read_bytes())
        with np.load(self.kept, allow_pickle=False) as arrays:
            return [np.asarray(arrays[name], dtype=float).reshape(-1, 3) for name in sorted(arrays.files)]

    def cancel(self):
        """End the process."""
        if self.process is not None:
            self.process.cancel()


def _worker():
    """What runs the worker: this Blender without a window, or the Python that holds Blender as a module."""
    if bpy.app.binary_path:
        options = ["-b", "--factory-startup", "--python-exit-code", "1", "--python", str(WORKER), "--"]
        return [bpy.app.binary_path, *options]
    return [sys.executable, str(WORKER)]


def fetched():
    """The folder that *Fetch CoACD* fills."""
    return Path(compat.cache_folder()) / "packages"


@cache
def packages():
    """Folders in which the worker finds CoACD; none when it is nowhere. Looked up once, since panels ask for it."""
    found = importlib.util.find_spec("coacd")
    if found is not None:
        return (str(Path(found.origin).resolve().parent.parent),)
    return (str(fetched()),) if (fetched() / "coacd").is_dir() else ()


def fetch_command(python="python3"):
    """The command that fetches CoACD; any Python 3.9 or later with pip will do."""
    return [python, "-m", "pip", "install", "--no-deps", "--target", str(fetched()), COACD]


class ADF_OT_fetch_coacd(Waits, bpy.types.Operator):
    """Download CoACD, which finds convex pieces, from the Python package index into the extension's own folder"""

    bl_idname = "adf.fetch_coacd"
    bl_label = "Fetch CoACD"

    @classmethod
    def poll(cls, context):
        if packages():
            cls.poll_message_set("CoACD is already installed")
            return False
        if not compat.is_online():
            cls.poll_message_set(f"Go online in Preferences > System > Network, or run {' '.join(fetch_command())}")
            return False
        return True

    def begin(self, context):
        yield f"Fetching {COACD}", 0.0
        self.job = Process("fetch")
        try:
            self.job.start(fetch_command(compat.python()))
        except OSError as error:
            self.report({"ERROR"}, f"{error}; run in a terminal: {' '.join(fetch_command())}")
            return False
        return True

    def shown(self):
        return f"Fetching {COACD} into {fetched()}", None

    def take(self, context):
        packages.cache_clear()
        if self.job.status or not packages():
            words = failure("Fetch CoACD", self.job.words, self.job.status)
            self.report({"ERROR"}, f"{words}. In a terminal the same is: {' '.join(fetch_command())}")
            return {"CANCELLED"}
        self.report({"INFO"}, f"{COACD} lies in {fetched()}")
        return {"FINISHED"}


class ADF_OT_decompose(NeedsBody, Waits, bpy.types.Operator):
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

    @classmethod
    def poll(cls, context):
        if not packages():
            cls.poll_message_set("This Blender's Python has no CoACD; use Fetch CoACD first")
            return False
        return super().poll(context)

    def begin(self, context):
        body = active_body(context)
        yield f"Reading '{body.name}'", 0.0
        if body.type != "MESH":
            self.report({"ERROR"}, f"'{body.name}' has no mesh to decompose")
            return False
        self._body = body.name
        vertices, faces = points_of(own_solid(body))
        if not len(faces):
            self.report({"ERROR"}, f"'{body.name}' has no face")
            return False
        settings = {"threshold": self.threshold, "max_convex_hull": self.max_hulls or -1, "seed": self.seed}
        self.job = Job(vertices, faces, settings)
        return True

    def shown(self):
        parts, share = self.job.progress
        return f"Decomposing '{self._body}': {share:.0%} of {parts} parts", share

    def take(self, context):
        body = bpy.data.objects.get(self._body)
        if body is None:
            self.report({"ERROR"}, f"'{self._body}' is gone")
            return {"CANCELLED"}
        try:
            pieces = self.job.pieces()
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


CLASSES = (ADF_OT_fetch_coacd, ADF_OT_decompose)


def attach() -> None:
    """Nothing but the classes."""


def detach() -> None:
    """Forget where CoACD was."""
    packages.cache_clear()
