"""Convex decomposition by CoACD in a process of its own: progress, cancel by Esc, results kept by content."""

import hashlib
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from . import compat, making
from .ligature.mesh.cache import write_atomically
from .ligature.mesh.inertia import mass_properties
from .mesh_data import points_of
from .object_operators import NeedsBody, active_body
from .placing import children_with

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


def quality(vertices, faces, hulls, samples=2000):
    """How well hulls stand for a mesh: volume error (None for an open mesh) and the greatest distance in metres.

    The distance is from points of the hulls' outside to the mesh, and from points of the mesh to the
    hulls, over ``samples`` evenly spread points on each.
    """
    surfaces = [making.hull_of(hull) for hull in hulls]
    try:
        volume = mass_properties(vertices, faces).volume
        error = abs(sum(mass_properties(v, np.array(f)).volume for v, f in surfaces) - volume) / volume
    except ValueError:
        error = None
    mesh = BVHTree.FromPolygons(vertices.tolist(), faces.tolist())
    trees = [BVHTree.FromPolygons(v.tolist(), f) for v, f in surfaces]
    rng = np.random.default_rng(0)
    worst = 0.0
    for v, f in surfaces:
        for point in _samples(v, np.array(f), samples // len(surfaces) + 1, rng):
            if not any(_inside(tree, point) for tree in trees):
                worst = max(worst, mesh.find_nearest(point)[3])
    for point in _samples(vertices, faces, samples, rng):
        if not any(_inside(tree, point) for tree in trees):
            worst = max(worst, min(tree.find_nearest(point)[3] for tree in trees))
    return error, worst


def _inside(tree, point):
    """Whether a point lies inside a convex surface by more than a thousandth of a millimetre."""
    place, normal, _, _ = tree.find_nearest(point)
    return (place - Vector(point)).dot(normal) > 1e-6


def _samples(vertices, faces, count, rng):
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    chosen = rng.choice(len(faces), count, p=area / area.sum())
    u, v = rng.random((2, count, 1))
    over = u + v > 1.0
    u, v = np.where(over, 1.0 - u, u), np.where(over, 1.0 - v, v)
    return a[chosen] + u * (b[chosen] - a[chosen]) + v * (c[chosen] - a[chosen])


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
        context.workspace.status_text_set(f"Decomposing '{self._body}' for {seconds:.0f} s. Esc ends it")
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
        self._vertices, self._faces = points_of(body)
        if not len(self._faces):
            self.report({"ERROR"}, f"'{body.name}' has no face")
            return False
        settings = {"threshold": self.threshold, "max_convex_hull": self.max_hulls or -1, "seed": self.seed}
        self._job = Job(self._vertices, self._faces, settings)
        return True

    def _end(self, context):
        context.window_manager.event_timer_remove(self._timer)
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
        kept = []
        for piece in pieces:
            try:
                making.add_hull(body, piece)
                kept.append(piece)
            except ValueError:
                continue  # CoACD's flat slivers collide with nothing
        body.adf.body.collision_mesh_type = "CONVEX_HULL"
        volume, distance = quality(self._vertices, self._faces, kept)
        share = "volume unknown, the mesh is open" if volume is None else f"volume error {100 * volume:.1f} %"
        self.report({"INFO"}, f"{len(kept)} convex pieces, {share}, distance {1e3 * distance:.2f} mm")
        return {"FINISHED"}


CLASSES = (ADF_OT_decompose,)


def attach() -> None:
    """Nothing but the classes."""


def detach() -> None:
    """Nothing but the classes."""
