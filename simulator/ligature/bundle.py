"""The scenes and examples that come with Ligature, wherever it runs from."""

from __future__ import annotations

import difflib
from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent


def bundle_root() -> Path:
    """The folder that holds ``scenes`` and ``examples``.

    A wheel has them inside the package, a catkin install space in its share folder, a checkout beside ``simulator``.
    """
    places = (_PACKAGE / "bundled", _PACKAGE.parents[1], _PACKAGE.parents[3] / "share" / "ligature")
    return next((place for place in places if (place / "scenes").is_dir()), places[0])


SCENES = bundle_root() / "scenes"
EXAMPLES = bundle_root() / "examples"


def scene_names() -> list[str]:
    """Names of the bundled scenes, as `launch_file` takes them."""
    return sorted(path.parent.name for path in SCENES.glob("*/launch.yaml"))


def meant(path: Path) -> str:
    """The bundled scenes where ``path`` may be the misspelled name of one; else empty."""
    alike = difflib.get_close_matches(path.name, scene_names(), 1)
    bare = len(path.parts) == 1 and not path.suffix
    known = f"the scenes that come with Ligature are {', '.join(scene_names())}"
    return (f"did you mean '{alike[0]}'?" if alike else known) if bare else ""


def launch_file(path: Path) -> Path:
    """``path``, or the launch file of the bundled scene of that name where no such path exists."""
    bundled = SCENES / path / "launch.yaml"
    return bundled if len(path.parts) == 1 and not path.exists() and bundled.is_file() else path
