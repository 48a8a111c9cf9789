"""Runs CoACD in a separate process, so that a crash, a hang or Ctrl-C in its native code affects nothing else.

``python -m ligature.mesh.coacd_process INPUT OUTPUT SETTINGS PARENT LIMIT``: INPUT is an npz file of ``vertices``
(n, 3) and ``faces`` (m, 3), OUTPUT gets one array (k, 3) of vertices per convex piece, SETTINGS is a JSON object of
keyword arguments of ``coacd.run_coacd``, PARENT the id of the process that waits: this one ends with it. LIMIT is the
maximum processor time in seconds. Any length unit.
"""

from __future__ import annotations

import json
import resource
import sys

import numpy as np

from ligature.process import end_with_parent


def main(source: str, target: str, settings: str, parent: str, limit: str) -> None:
    """Decompose the mesh of ``source`` into ``target``."""
    end_with_parent(int(parent))
    resource.setrlimit(resource.RLIMIT_CPU, (int(limit), int(limit) + 1))
    import coacd

    coacd.set_log_level("error")
    with np.load(source, allow_pickle=False) as stored:
        mesh = coacd.Mesh(stored["vertices"], stored["faces"])
    pieces = coacd.run_coacd(mesh, **json.loads(settings))
    np.savez(target, **{f"{number:05d}": vertices for number, (vertices, _) in enumerate(pieces)})


if __name__ == "__main__":
    main(*sys.argv[1:])
