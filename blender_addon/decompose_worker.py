"""Runs CoACD in a process of its own: ``INPUT OUTPUT SETTINGS FOLDER…`` after ``--``, or as plain arguments.

INPUT is an npz file of ``vertices`` (n, 3) and ``faces`` (m, 3); OUTPUT gets one array of vertices
per convex piece; SETTINGS are JSON arguments of CoACD; the folders are searched for packages.
"""

import json
import sys


def main(source, target, settings, *folders):
    """Decompose the mesh of one file into the pieces of another."""
    sys.path += folders
    import coacd
    import numpy as np

    with np.load(source, allow_pickle=False) as stored:
        mesh = coacd.Mesh(stored["vertices"], stored["faces"])
    pieces = coacd.run_coacd(mesh, **json.loads(settings))
    np.savez(target, **{f"{number:05d}": piece[0] for number, piece in enumerate(pieces)})


if __name__ == "__main__":
    words = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    main(*words)
