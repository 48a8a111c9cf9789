"""Code, tests, messages and documents use the field's words, and not those that these replaced.

One table lists each replaced word with what to write. Identifiers are read by the tokenizer and split at underscores
and capitals; phrases are searched in comments, strings and Markdown.
"""

from __future__ import annotations

import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SUFFIXES = (
    ".py", ".md", ".sh", ".js", ".html", ".css", ".glsl", ".vert", ".frag", ".launch", ".toml", ".yaml", ".yml", ".xml",
    ".msg", ".srv", ".cff",
)  # fmt: skip

FOLDERS = (
    "simulator", "blender_addon", "docs", "tests", "examples", "scenes", "launch", "ros_msgs", ".ci", ".github", "Makefile",
    "Dockerfile", "README.md", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md", "CITATION.cff", "package.xml",
)  # fmt: skip
"""Folders and files that are searched."""

NAMES = {
    r"tells?|told": "report, log, warn",
    r"say(s|ing)?|said": "report, log, publish",
    r"times real time": "real_time_factor",
    r"leads?|led": "command, drive, control; leader, follower",
    r"recall(s|ed)?": "snapshot, restore",
    r"fastest": "max_velocity",
    r"hardest": "max_acceleration",
    r"burdens?": "attached_load, payload",
    r"bury|buried": "release_client",
    r"patience": "timeout, deadline",
    r"ties?|tied|bonds?|pinch(es|ed)?|clamps?|grips?|holders?": "attachment, grasp, weld",
    r"let pass": "disable_collision",
    r"stand behind": "lower_priority",
    r"weigh(s|ed)?": "update_mass, set_mass",
    r"spare[sd]?": "exclude, ignore",
}
"""Parts of identifiers, joined by spaces, and what to write."""

WHOLE_NAMES = {
    r"Holds?|Pads": "Attachment, Grasp",
    r"_?gives?": "compliance (m/N), stiffness (N/m)",
    r"_?(memory|Memory)": "snapshot",
}
"""Identifiers as they stand, and what to write."""

PHRASES = {
    r"(is|are|was|were|be|been|being) told": "is reported, is logged",
    r"told (of|by name|once|on)": "reported",
    r"tells (the |its )?(user|operator|reader|caller|you|of|that)": "reports, warns",
    r"(is|are|was|were|be|been|being) led|led (arm|body|bodies|joint)s?": "is commanded, kinematically controlled",
    r"who leads": "leader, operator",
    r"leads? \w+ arms?|leads? arms?": "commands, drives",
    r"says? so": "reports it",
    r"recall(s|ed)?": "snapshot, restore",
    r"driven by poses": "kinematically controlled",
    r"(that|which|who|what) (is|are|was|were) not there": "missing",
    r"makes? no sense": "invalid",
    r"refused? (in|with) words": "rejected with a reason",
    r"(cannot|can not|could not) be had": "failed, unavailable",
    r"where (it|they|he|she) (lies|lie|lay)": "path, folder",
    r"what outlives": "orphan process, leftover",
    r"stands? behind (everything|all|others|physics)": "lowers its scheduling priority",
    r"fastest": "maximum velocity",
    r"hardest": "maximum acceleration",
    r"burdens?": "attached load, payload",
    r"bury|buried": "release",
    r"patience": "timeout, deadline",
    r"lets? \w+ pass": "disable collision",
    r"tied|ties?|bonds?|pinch(es|ed)?|grips?|clamps": "attachment, grasp, weld",
}
"""Phrases of comments, strings and documents, and what to write."""

GRIP = "the operator's grip on a handle, and its key in teleoperation files"
HOLD = "CRTK's command `hold`"
SHARED = "shared memory, and memory that a process uses"
PINCH = "the dVRK's topic `gripper/pinch`, and the point of an instrument that its kinematics call so"
FORMER = "a former name that is accepted with a warning"
KNOTS = "a knot is tied"
ALLOWED = {
    ("simulator/ligature/teleop/", "grip"): GRIP, ("simulator/ligature/teleop/", "grips"): GRIP,
    ("simulator/ligature/cockpit/", "grip"): GRIP, ("docs/teleoperation.md", "grip"): GRIP,
    ("tests/fuzz/readers.py", "grip"): GRIP, ("tests/teleop/", "grip"): GRIP, ("tests/teleop/", "grips"): GRIP,
    ("tests/ros/", "grip"): GRIP, ("tests/bench/teleop_suture.py", "grip"): GRIP,
    ("simulator/ligature/cockpit/motion.py", "hold"): HOLD, ("simulator/ligature/robots/commands.py", "hold"): HOLD,
    ("simulator/ligature/ros/arms/commands.py", "hold"): HOLD, ("tests/fuzz/test_commands.py", "hold"): HOLD,
    ("simulator/ligature/bus/", "memory"): SHARED, ("simulator/ligature/bus/", "_memory"): SHARED,
    ("tests/bus/test_events.py", "memory"): SHARED, ("tests/bench/soak.py", "memory"): SHARED,
    ("simulator/ligature/robots/", "pinch"): PINCH, ("simulator/ligature/ros/arms/events.py", "pinch"): PINCH,
    ("simulator/ligature/bus/block.py", "patience"): FORMER, ("tests/bus/test_block.py", "patience"): FORMER,
    ("simulator/ligature/cli/main.py", "patience"): FORMER, ("tests/cli/test_commands.py", "patience"): FORMER,
    ("docs/command_line.md", "patience"): FORMER,
    ("CHANGELOG.md", "patience"): FORMER, ("CHANGELOG.md", "fastest"): FORMER,
    ("simulator/ligature/teleop/config.py", "patience"): FORMER, ("simulator/ligature/teleop/config.py", "fastest"): FORMER,
    ("tests/teleop/test_config.py", "patience"): FORMER, ("tests/teleop/test_config.py", "fastest"): FORMER,
    ("simulator/ligature/bus/record.py", "tell"): "a method of files",
    ("simulator/ligature/ros/intake.py", "tell"): "a method of files",
    ("tests/ros/test_flood.py", "tell"): "a method of files",
    ("docs/suture.md", "tied"): KNOTS, ("docs/suture.md", "ties"): KNOTS, ("tests/suture/test_knots.py", "tied"): KNOTS,
    ("tests/bench/knot.py", "tied"): KNOTS, ("simulator/ligature/environments/", "tie"): KNOTS,
    ("tests/environments/", "tie"): KNOTS, ("examples/record_experts.py", "tie"): KNOTS,
}  # fmt: skip
"""Words that stand in a sense of their own, by file or folder, each with the reason."""


def _pattern(table: dict[str, str]) -> re.Pattern[str]:
    return re.compile(rf"\b(?:{'|'.join(f'(?:{words})' for words in table)})\b", re.IGNORECASE)


def _whole(table: dict[str, str]) -> re.Pattern[str]:
    return re.compile(rf"(?:{'|'.join(table)})\Z")


IN_NAMES, IN_PROSE, AS_NAMES = _pattern(NAMES), _pattern(PHRASES), _whole(WHOLE_NAMES)


def instead(found: str) -> str:
    """What the table has for a word."""
    for table in (NAMES, WHOLE_NAMES, PHRASES):
        for words, replacement in table.items():
            if re.fullmatch(words, found, re.IGNORECASE):
                return replacement
    raise KeyError(found)


def parts(name: str) -> str:
    """The words of an identifier: ``let_pass``, ``letPass`` and ``LET_PASS`` are 'let pass'."""
    return " ".join(re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", name)).lower()


def tokens(source: str) -> Iterator[tuple[int, bool, str]]:
    """Line, whether it is an identifier, and text of what can hold a word in Python source."""
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type in (tokenize.NAME, tokenize.COMMENT, tokenize.STRING):
            yield token.start[0], token.type == tokenize.NAME, token.string


def replaced_words(source: str, python: bool) -> Iterator[tuple[int, str]]:
    """Line and word of all that the tables replace in one file."""
    pieces = tokens(source) if python else ((i, False, line) for i, line in enumerate(source.splitlines(), 1))
    for line, is_name, text in pieces:
        if is_name and AS_NAMES.match(text):
            yield line, text
        elif is_name and text.startswith("test_"):  # a sentence
            yield from ((line, hit.group()) for hit in IN_PROSE.finditer(parts(text)))
        elif is_name:
            yield from ((line, hit.group()) for hit in IN_NAMES.finditer(parts(text)))
        else:
            for hit in IN_PROSE.finditer(re.sub(r"\s+", " ", text) if python else text):
                yield line, hit.group()


def files(place: str) -> list[Path]:
    """The text files of a folder, or the file itself."""
    root = ROOT / place
    found = [root] if root.is_file() else sorted(path for path in root.rglob("*") if path.suffix in SUFFIXES)
    return [path for path in found if "__pycache__" not in path.parts]


@pytest.mark.parametrize("place", FOLDERS)
def test_no_replaced_word_stands(place: str) -> None:
    searched = files(place)
    assert searched, f"{place} holds no text"
    findings = []
    for path in searched:
        name = path.relative_to(ROOT).as_posix()
        if path == Path(__file__):
            continue
        for line, word in replaced_words(path.read_text(encoding="utf-8"), path.suffix == ".py"):
            if not any(name.startswith(where) and word.lower() == allowed for where, allowed in ALLOWED):
                findings.append(f"{name}:{line}: '{word}'; write {instead(word)}")
    assert not findings, "\n".join(findings)


@pytest.mark.parametrize(("name", "word"), ALLOWED)
def test_every_exception_is_used(name: str, word: str) -> None:
    found = {
        hit.lower()
        for path in files(name)
        for _, hit in replaced_words(path.read_text(encoding="utf-8"), path.suffix == ".py")
    }
    assert word in found, f"{name} has no '{word}' any more: remove the exception"


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("sim.letPass(a, b)\n", ["let pass"]),
        ("LET_PASS = 1\n", ["let pass"]),
        ("class Bond: ...\n", ["bond"]),
        ("x = 'the file\\n    that is not there'\n", ["that is not there"]),
        ("def f():\n    '''A file that\n    is not there.'''\n", ["that is not there"]),
        ("# it is told once\n", ["is told"]),
        ("compiled = tile = misled = 0\n", []),
        ("hold()  # the command of CRTK\n", []),
        ("class Holds: ...\n", ["Holds"]),
        ("self.memory = give\n", ["memory", "give"]),
        ("say(what_was_said)\n", ["say", "said"]),
        ("essays = prosaic = 0\n", []),
        ("# the terminal says so\n", ["says so"]),
        ("def test_ruler_gives_lengths(): ...\n", []),
        ("def test_error_is_told(): ...\n", ["is told"]),
    ],
)
def test_words_are_found_in_names_and_prose(source: str, expected: list[str]) -> None:
    assert [word for _, word in replaced_words(source, True)] == expected


def test_every_word_of_the_table_is_found_in_its_own_pattern() -> None:
    for table, pattern in ((NAMES, IN_NAMES), (PHRASES, IN_PROSE)):
        for words, replacement in table.items():
            first = re.sub(r"\((\w[^|)]*)\|[^)]*\)(?!\?)|\([^)]*\)\?", r"\1", words).split("|")[0]
            first = re.sub(r"\w\?|\[\w+\]\?", "", first).replace(r"\w+", "it")
            assert pattern.search(first), (words, first)
            assert not pattern.search(replacement), (words, replacement)
