"""Every key of every kind of object with values of another type: nothing that a file holds ends the reader in a surprise."""

from __future__ import annotations

import copy
import random
from pathlib import Path
from typing import Any

import ligature
import pytest
from ligature.adf import Severity
from ligature.adf.schema import SCHEMA, Key, Status

from tests.adf.test_effects import AT, LISTS, SUBJECTS, Files, contexts, folder, merge, put

__all__ = ["folder"]

ODD: tuple[Any, ...] = (
    None, "", [], {}, "oops", True, -1, 10**400, 2**31, 1e12, "1e-3", "١", [None], [[1]], {"x": None}, {"position": []}, [{"x": {}}],
)  # fmt: skip
"""Values that are right for few keys: null, empty, of another type, too large, digits of another script."""

EACH = 2
"""Odd values that each key is tried with, null and one by lot."""

VEHICLE = {"chassis": "BODY base", "wheels": [{"body": "BODY link", "radius": 0.1, "down direction": AT}]}
KEYS = [(kind, key) for kind, keys in SCHEMA.items() for key in keys]


def outcome(at: Path, kind: str, key: Key, value: Any) -> list[str]:
    """What is reported of a small scene in which ``key`` has a value; a scene that is refused has errors."""
    files = Files()
    if kind == "vehicle":
        files.files["model.yaml"] |= {"vehicles": ["X"], "X": copy.deepcopy(VEHICLE)}
        subject = files.files["model.yaml"]["X"]
    else:
        subject = files.subject(kind)
        merge(subject, next(contexts(kind, key)))
    put(subject, key.path, value)
    try:
        scene = ligature.load(files.write(at), devices=[0] if kind == "input device" else ())
    except ligature.SceneError as error:
        assert error.diagnostics and all(d.message for d in error.diagnostics)
        return [str(d) for d in error.diagnostics]
    return [str(d) for d in scene.diagnostics if d.severity >= Severity.WARNING]


def test_every_kind_has_a_subject() -> None:
    tops = {"launch", "world", "model", "input devices"}
    assert set(SCHEMA) == {*SUBJECTS, *tops, "vehicle"} and set(LISTS) <= set(SUBJECTS)


@pytest.mark.parametrize("kind", SCHEMA)
def test_no_value_of_any_key_is_a_surprise(kind: str, folder: Path) -> None:
    for owner, key in KEYS:
        if owner != kind:
            continue
        rng = random.Random(f"{kind} {key.path}")
        for value in (None, *rng.sample(ODD[1:], EACH - 1)):
            try:
                outcome(folder, kind, key, value)
            except Exception as error:
                pytest.fail(f"{kind}: '{key.path}: {value!r:.40}' ends in {type(error).__name__}: {error}")


IGNORED = [(kind, key) for kind, key in KEYS if key.status is Status.IGNORED and "[]" not in key.path]


@pytest.mark.parametrize("kind", sorted({kind for kind, _ in IGNORED}))
def test_keys_without_effect_take_any_value(kind: str, folder: Path) -> None:
    """AMBF never looks at them."""
    for owner, key in IGNORED:
        if owner == kind and key.path != "parent":
            rng = random.Random(key.path)
            assert outcome(folder, kind, key, rng.choice(ODD)) == outcome(folder, kind, key, 1), key.path


@pytest.mark.parametrize("value", ODD, ids=lambda value: repr(value)[:20])
def test_the_parent_of_a_body_is_reported_where_it_is_a_name(value: Any, folder: Path) -> None:
    """A newer AMBF follows it."""
    (parent,) = (key for kind, key in KEYS if (kind, key.path) == ("body", "parent"))
    words = "\n".join(outcome(folder, "body", parent, value))
    assert ("which only AMBF since October 2024 follows" in words) == (
        isinstance(value, str | bool | int | float) and value != ""
    )
