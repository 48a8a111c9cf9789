"""Fixtures of all tests: where the scenes of others and the recordings of the reference are."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings
from hypothesis.internal.conjecture import providers

ROOT = Path(__file__).resolve().parent.parent
CORPUS = Path(os.environ.get("LIGATURE_CORPUS", ROOT.parent / "shared" / "corpus"))
np.seterr(divide="raise", over="raise", invalid="raise")

# a change is judged on the same examples every time; `make fuzz` looks for new ones
EXAMPLES = os.environ.get("LIGATURE_EXAMPLES", "same")
settings.register_profile("same", derandomize=True, deadline=None, database=None)
settings.register_profile("new", deadline=None, print_blob=True)
settings.load_profile(EXAMPLES)
if EXAMPLES == "same":
    # examples also use numbers from the source of our modules that are loaded, which are others in every process
    providers.is_local_module_file = lambda path: False


def _shared(variable: str, default: Path) -> Path:
    path = Path(os.environ.get(variable, default))
    if not path.is_dir():
        pytest.skip(f"{path} is absent; set {variable} to run this test")
    return path


@pytest.fixture
def hulls(monkeypatch: pytest.MonkeyPatch) -> None:
    """Moving meshes collide as their hulls: CoACD would take minutes for those of others, and here no piece matters."""
    from ligature.mesh.surface import hull_vertices  # Blender's Python has no `ligature`, and reads this file

    monkeypatch.setattr("ligature.physics.shapes.convex_pieces", lambda points, *_: [hull_vertices(points)])


@pytest.fixture(scope="session")
def corpus() -> Path:
    """Folder of real scenes of others; skips when it is absent."""
    return _shared("LIGATURE_CORPUS", ROOT.parent / "shared" / "corpus")


@pytest.fixture(scope="session")
def golden() -> Path:
    """Folder of topic lists, samples and traces recorded from AMBF; skips when it is absent."""
    return _shared("LIGATURE_GOLDEN", ROOT.parent / "shared" / "golden")
