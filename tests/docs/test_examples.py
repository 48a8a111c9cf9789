"""What the pages show works: Python runs, commands are understood or run, files load."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import click
import pytest
import typer
from ligature.cli import ambf_simulator
from ligature.cli.main import app

from tests.conftest import ROOT
from tests.docs.pages import ALL, PAGES, blocks
from tests.opengl import opengl

BIN = Path(sys.executable).parent
ROS_PAGES = {"clients.md", "rostest.md"}
"""Their programs need a master and a running simulator; `tests/ros/test_client.py` and `test_rostest.py` make the same calls."""

RUN = [
    page
    for page in [*PAGES, ROOT / "README.md"]
    if page.name not in ROS_PAGES and any(b.language == "python" for b in blocks(page))
]
GROUP = typer.main.get_command(app)


@pytest.mark.parametrize("page", RUN, ids=lambda page: page.stem)
def test_python_of_a_page_runs(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From top to bottom in one namespace, in a folder with the files that the page gives, after its commands."""
    monkeypatch.chdir(tmp_path)
    for name in ("scenes", "examples"):
        (tmp_path / name).symlink_to(ROOT / name)
    namespace: dict[str, object] = {"__name__": page.stem}
    for block in blocks(page):
        file = next((word.removeprefix("file=") for word in block.words if word.startswith("file=")), "")
        if file:
            Path(file).write_text(block.text)
        elif "run" in block.words:
            _run(block.text, tmp_path)
        elif block.language == "python":
            code = compile("\n" * (block.line - 1) + block.text, str(page), "exec")
            with opengl():
                exec(code, namespace)


def _run(text: str, folder: Path) -> None:
    env = dict(os.environ, PATH=f"{BIN}:{os.environ['PATH']}")
    done = subprocess.run(["sh", "-e", "-c", text], cwd=folder, env=env, capture_output=True, text=True, timeout=200)
    if "no OpenGL" in done.stdout:
        pytest.skip(done.stdout)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize(
    "page",
    [page for page in PAGES if page not in RUN and any("run" in b.words for b in blocks(page))],
    ids=lambda page: page.stem,
)
def test_commands_of_a_page_run(page: Path, tmp_path: Path) -> None:
    for name in ("scenes", "examples"):
        (tmp_path / name).symlink_to(ROOT / name)
    for block in blocks(page):
        if "run" in block.words:
            _run(block.text, tmp_path)


def lines(page: Path) -> list[tuple[int, str]]:
    """The shell lines of a page that call our commands, those with a trailing backslash joined; with their numbers."""
    found = []
    for block in blocks(page):
        if block.language != "sh":
            continue
        text = re.sub(r"\\\n\s*", " ", block.text)
        found += [
            (block.line, line) for line in text.splitlines() if re.match(r"(\w+=\S+ )*(ligature|ambf_simulator) ", line)
        ]
    return found


@pytest.mark.parametrize("page", [page for page in ALL if lines(page)], ids=lambda page: page.stem)
def test_commands_of_a_page_are_understood(page: Path) -> None:
    """Names of commands and options, and how many arguments there are."""
    assert isinstance(GROUP, click.Group)
    for number, line in lines(page):
        words = [word for word in shlex.split(line, comments=True) if not re.match(r"[A-Z_]+=", word)]
        if words[0] == "ambf_simulator":
            ambf_simulator.parser().parse_args(words[1:])
            continue
        command: click.Command | None = GROUP
        given = words[1:]
        while isinstance(command, click.Group):
            name, given = given[0], given[1:]
            command = command.commands.get(name)
            assert command is not None, f"{page.name}:{number}: there is no command '{name}'"
        try:
            context = click.Context(command, info_name=name)
            _, rest, _ = command.make_parser(context).parse_args(given)
        except click.UsageError as error:
            raise AssertionError(f"{page.name}:{number}: {line}: {error.format_message()}") from None
        assert rest == [], f"{page.name}:{number}: {line}: {rest} is too much"


def test_a_wrong_option_in_a_page_is_found(tmp_path: Path) -> None:
    (tmp_path / "page.md").write_text("```sh\nligature check --no-such FILE\n```\n")
    with pytest.raises(AssertionError, match="page.md:2: ligature check --no-such FILE: No such option"):
        test_commands_of_a_page_are_understood(tmp_path / "page.md")


def test_every_page_has_an_example_that_is_run_or_read() -> None:
    """Pages of tables and of history aside."""
    without = {
        "index",
        "conformance",
        "glossary",
        "dependencies",
        "adf",
        "architecture",
        "benchmarks",
        "cheats",
        "questions",
    }
    silent = {page.stem for page in PAGES if page not in RUN and not lines(page) and page.name not in ROS_PAGES}
    assert silent <= without, silent - without
