"""Files that are loaded several times, and objects that a file lists several times: each copy is connected to itself."""

from __future__ import annotations

import re
from pathlib import Path

import ligature
import pytest
import yaml

from tests.fuzz.scenes import scene

SCENES = 25
LETTERS = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"


def prefixed(found: re.Match[str]) -> str:
    """``BODY b003`` as ``BODY Linkabc``: the name of each body is the beginning of those of all later ones."""
    return f"BODY Link{LETTERS[: int(found[1])]}"


def written(number: int, folder: Path) -> tuple[Path, int]:
    """A generated scene whose files have one namespace and whose bodies have ambiguous names; how many models it has."""
    case = scene(number)
    for name, text in case.files.items():
        text = re.sub(r"BODY b(\d\d\d)", prefixed, text)
        if name.startswith("model"):
            text = yaml.safe_dump({**yaml.safe_load(text), "namespace": "/ambf/env/"}, sort_keys=False)
        (folder / name).write_text(text)
    return folder / case.entry, len(yaml.safe_load(case.files[case.entry])["multibody configs"])


@pytest.mark.parametrize("number", range(SCENES))
def test_a_scene_that_is_loaded_twice_is_there_twice(number: int, tmp_path: Path) -> None:
    entry, models = written(number, tmp_path)
    once = ligature.load(entry)
    twice = ligature.load(entry, models=[*range(models), *range(models)])
    n = len(once.bodies)
    assert len(twice.bodies) == 2 * n
    ends = [(joint.parent, joint.child) for joint in once.joints]
    found = [(joint.parent, joint.child) for joint in twice.joints]
    assert found == [*ends, *((parent + n, child + n) for parent, child in ends)]
    for kind in ("sensors", "actuators"):
        parents = [item.parent for item in getattr(once, kind)]
        assert [item.parent for item in getattr(twice, kind)] == [*parents, *(p + n for p in parents)]
    parents = [ghost.attachment.parent for ghost in once.ghosts]
    moved = [parent and (parent[0], parent[1] + n) for parent in parents]
    assert [ghost.attachment.parent for ghost in twice.ghosts] == [*parents, *moved]
    topics = [{b.identity.topic for b in found.bodies if not b.identity.passive} for found in (once, twice)]
    assert len(topics[1]) == 2 * len(topics[0])


@pytest.mark.parametrize("count", [2, 150])
def test_any_number_of_copies_has_names_of_their_own(count: int, tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(f"bodies: [{', '.join(['B'] * count)}]\nB: {{name: b, mass: 1}}\n")
    found = ligature.load(tmp_path / "m.yaml")
    assert [body.identity.identifier for body in found.bodies] == ["B", *(f"B{i}" for i in range(1, count))]
