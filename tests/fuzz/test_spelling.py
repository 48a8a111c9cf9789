"""Scenes in other hands: every spelling of a document reads as the document, and slips are reported with their remedy."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from ligature.adf import AdfError, Resolver, scalars
from ligature.adf.nodes import Mapping, parse, plain

from tests.fuzz.scenes import scene
from tests.fuzz.spelling import spelled

SPELLINGS = 150
SLIPS: dict[str, tuple[Callable[[str, int], str], str]] = {
    "a tab": (lambda line, at: "\t" + line.lstrip(), "tab"),
    "a no-break space": (lambda line, at: line.replace(": ", ":\u00a0", 1), "blank"),
    "no blank": (lambda line, at: line.replace(": ", ":", 1), "blank behind ':'"),
    "an open bracket": (lambda line, at: line.split(":")[0] + ": [1, 2", "bracket of line {at}"),
    "an open quotation": (lambda line, at: line.split(":")[0] + ": 'one", "quot"),
    "two colons": (lambda line, at: line.split(":")[0] + ": one: two", "quotes"),
    "a reserved sign": (lambda line, at: line.split(":")[0] + ": @one", "quotes"),
}
"""What a slip makes of a line with a value, and words of the remedy; lines count from 1."""


def read(value: Any) -> Any:
    """What a reader makes of the texts in ``value``."""
    if isinstance(value, dict):
        return {key: read(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [read(inner) for inner in value]
    for rule in (scalars.number, scalars.flag, scalars.integer):
        try:
            return rule(value) if isinstance(value, str) else value
        except ValueError:
            continue
    return value


ENCODINGS = ("utf-8", "utf-8", "utf-16-le", "utf-16-be", "utf-32-le", "utf-32-be")


def encoded(text: str, number: int) -> bytes:
    """``text`` as a file: UTF-8, or another encoding of YAML with its byte order mark."""
    encoding = ENCODINGS[number % len(ENCODINGS)]
    return text.encode() if encoding == "utf-8" else f"\ufeff{text.lstrip(chr(0xFEFF))}".encode(encoding)


@pytest.mark.parametrize("number", range(SPELLINGS))
def test_every_spelling_of_a_scene_reads_as_the_scene(number: int, tmp_path: Path) -> None:
    for name, text in scene(number).files.items():
        if name.endswith(".yaml"):
            document = yaml.safe_load(text)
            file = tmp_path / name
            file.write_bytes(encoded(spelled(document, number), number))
            assert read(plain(parse(Resolver([tmp_path]).read_text(file), file))) == read(document), name


def test_a_file_keeps_the_names_of_its_anchors_and_quoted_text() -> None:
    text = "a: &psm.jaw {x: 1}\nb: *psm.jaw\nc: 'x *psm.jaw'\nd: \"&psm.jaw\" # &psm.jaw\n"
    root = parse(text, Path("scene.yaml"))
    assert plain(root) == {"a": {"x": "1"}, "b": {"x": "1"}, "c": "x *psm.jaw", "d": "&psm.jaw"}
    value = root.get("a")
    assert isinstance(value, Mapping) and value.anchor == "psm.jaw"


def test_an_unknown_anchor_is_reported_by_its_own_name() -> None:
    with pytest.raises(AdfError, match=r"scene.yaml:2:4: error: alias '\*psm.jaw' names no anchor"):
        parse("a: &psm.arm {x: 1}\nb: *psm.jaw\n", Path("scene.yaml"))


@pytest.mark.parametrize("slip", SLIPS)
@pytest.mark.parametrize("number", range(10))
def test_a_slip_is_reported_with_its_remedy(slip: str, number: int) -> None:
    change, words = SLIPS[slip]
    lines = max(scene(number).files.values(), key=lambda text: text.count("\n    ")).splitlines()
    rng = random.Random(number)
    at = rng.choice([i for i, line in enumerate(lines) if ": " in line and line.startswith("    ")])
    lines[at] = change(lines[at], at)
    with pytest.raises(AdfError) as caught:
        parse("\n".join(lines) + "\n", Path("model.yaml"))
    (found,) = caught.value.diagnostics
    assert found.mark is not None
    assert words.format(at=at + 1) in found.hint, str(found)


def test_many_anchors_with_odd_names_take_no_longer_than_others(tmp_path: Path) -> None:
    """A search for free names that begins anew for each of them takes hours here."""
    text = "".join(f"k{i}: &p.{i:05d} {i}\nq{i}: *p.{i:05d}\n" for i in range(5000))
    found = plain(parse(text, tmp_path / "many.yaml"))
    assert [found[f"q{i}"] for i in range(5000)] == [found[f"k{i}"] for i in range(5000)]
    assert found["q4999"] != found["q4998"]
