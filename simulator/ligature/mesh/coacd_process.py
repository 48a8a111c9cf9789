"""Runs CoACD in a separate process, so that a crash, a hang or Ctrl-C in its native code affects nothing else.

Its arguments are SETTINGS PARENT LIMIT: standard input is an npz file of ``vertices`` (n, 3)
and ``faces`` (m, 3), standard output gets one of an array (k, 3) of vertices per convex piece, SETTINGS is a JSON
object of keyword arguments of ``coacd.run_coacd``, PARENT the id of the process that waits: this one ends with it.
LIMIT is the maximum processor time in seconds. Any length unit.
"""

from __future__ import annotations

import io
import json
import os
import resource
import sys

import numpy as np

from ligature.process import end_with_parent


def main() -> None:
    """Decompose the mesh of standard input; what else is printed goes to the errors."""
    settings, parent, limit = sys.argv[1:]
    end_with_parent(int(parent))
    resource.setrlimit(resource.RLIMIT_CPU, (int(limit), int(limit) + 1))
    import coacd

    target = os.dup(sys.stdout.fileno())
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    coacd.set_log_level("error")
    with np.load(io.BytesIO(sys.stdin.buffer.read()), allow_pickle=False) as stored:
        mesh = coacd.Mesh(stored["vertices"], stored["faces"])
    pieces = coacd.run_coacd(mesh, **json.loads(settings))
    stored_pieces = io.BytesIO()
    np.savez(stored_pieces, **{f"{number:05d}": vertices for number, (vertices, _) in enumerate(pieces)})
    with os.fdopen(target, "wb") as out:
        out.write(stored_pieces.getvalue())
