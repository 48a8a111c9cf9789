"""Links of the pages lead somewhere; the site is built without a warning."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import ROOT
from tests.docs.pages import ALL, PAGES

LINK = re.compile(r"(?<!!)\[[^\]]*\]\(([^)\s]+)\)|!\[[^\]]*\]\(([^)\s]+)\)")
GENERATED = {"commands.md", "state.md", "topics.md", "contributing.md", "changelog.md"}
"""Pages that only the site has."""


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as forges and the site make them."""
    heads = re.findall(
        r"^#+ (.+)$", re.sub(r"```.*?```", "", page.read_text("utf-8"), flags=re.DOTALL), flags=re.MULTILINE
    )
    return {re.sub(r"[^\w\- ]", "", head.lower()).strip().replace(" ", "-") for head in heads}


def broken(page: Path) -> list[str]:
    """The links of a page that lead nowhere."""
    text = re.sub(r"^( *)```.*?^\1```$", "", page.read_text("utf-8"), flags=re.DOTALL | re.MULTILINE)
    found = []
    for match in LINK.finditer(text):
        target = match[1] or match[2]
        name, _, anchor = target.partition("#")
        if re.match(r"\w+:", target) or (page.parent == ROOT / "docs" and name in GENERATED):
            continue
        file = page if not name else (page.parent / name)
        if not file.exists() or (anchor and file.suffix == ".md" and anchor not in anchors(file)):
            found.append(target)
    return found


@pytest.mark.parametrize("page", ALL, ids=lambda page: page.stem)
def test_links_of_a_page_lead_somewhere(page: Path) -> None:
    assert broken(page) == []


def test_a_broken_link_is_found(tmp_path: Path) -> None:
    (tmp_path / "a.md").write_text("# One two\n[x](#one-two) [y](#three) [z](b.md) ![p](q.png) [w](a.md#one-two)\n")
    assert broken(tmp_path / "a.md") == ["#three", "b.md", "q.png"]


def test_every_page_stands_in_the_contents_of_the_site() -> None:
    named = set(re.findall(r"^(?:\w[\w ]* <)?(\w+)>?$", (ROOT / "docs" / "index.md").read_text(), flags=re.MULTILINE))
    assert {page.stem for page in PAGES} - {"index"} <= named


@pytest.mark.slow
def test_the_site_is_built_without_a_warning(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, ROOT / "docs" / "site" / "build.py", tmp_path / "site", "dummy"],
        capture_output=True, text=True, timeout=280,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
