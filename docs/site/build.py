"""Builds the site: lays out the pages of ``docs`` with the generated ones, then runs Sphinx; every warning is an error.

    python docs/site/build.py OUT [BUILDER]

Needs no network. A link from a page to a file of the repository becomes a link to a copy of it.
"""

from __future__ import annotations

import re
import shutil
import sys
import tempfile
from pathlib import Path

from sphinx.cmd.build import main as sphinx

SITE = Path(__file__).resolve().parent
DOCS, ROOT = SITE.parent, SITE.parents[1]
sys.path.insert(0, str(SITE))
import reference  # noqa: E402

_OUTSIDE = re.compile(r"\]\(\.\./([^)#\s]+)(#[^)\s]*)?\)")
_UNIT = re.compile(r"(?<=\d) (?=(?:s|ms|µs|m|mm|N|g|kg|Hz|kHz|MB|GB)\b)")
_ROOT_PAGES = {"CHANGELOG.md": "changelog.md", "CONTRIBUTING.md": "contributing.md", "README.md": "index.md"}


def lay_out(folder: Path) -> None:
    """Write the sources of the site into ``folder``."""
    shutil.copytree(DOCS / "pictures", folder / "pictures")
    for page in DOCS.glob("*.md"):
        (folder / page.name).write_text(_linked(page.read_text("utf-8"), folder), "utf-8")
    for name, page in _ROOT_PAGES.items():
        if page != "index.md":
            text = (ROOT / name).read_text("utf-8").replace("](docs/", "](")
            (folder / page).write_text(_linked(text, folder), "utf-8")
    (folder / "commands.md").write_text(reference.commands(), "utf-8")
    (folder / "topics.md").write_text(reference.topics(), "utf-8")
    (folder / "state.md").write_text(reference.state(), "utf-8")
    (folder / "api").mkdir()
    (folder / "api" / "ligature.md").write_text(reference.top(), "utf-8")
    for package in (*reference.PUBLIC, *reference.PARTS):
        (folder / "api" / f"{package}.md").write_text(reference.api(package), "utf-8")


def _linked(text: str, folder: Path) -> str:
    """A page whose links to files of the repository lead to other pages or to copies."""

    def link(found: re.Match[str]) -> str:
        name, anchor = found[1], found[2] or ""
        if name in _ROOT_PAGES:
            return f"]({_ROOT_PAGES[name]}{anchor})"
        source, copy = ROOT / name, folder / "files" / name
        if source.is_file():
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(source, copy)
        return f"](files/{name})"

    return "".join(map(_unbroken, _OUTSIDE.sub(link, text).splitlines(keepends=True)))


def _unbroken(line: str) -> str:
    """A line whose numbers, in a row of a table, stay with their units: narrow columns break at every space."""
    return _UNIT.sub("\N{NO-BREAK SPACE}", line) if line.startswith("|") else line


def build(out: Path, builder: str = "html") -> int:
    """Build the site in ``out``; returns Sphinx's exit status. The builder ``dummy`` checks everything, writes nothing."""
    with tempfile.TemporaryDirectory() as work:
        source = Path(work) / "source"
        source.mkdir()
        lay_out(source)
        status = sphinx(
            ["-b", builder, "-j", "auto", "-c", str(SITE), "-d", str(Path(work) / "doctrees"), "-W", "--keep-going", "-q", str(source), str(out)]
        )  # fmt: skip
    return int(status)


if __name__ == "__main__":
    sys.exit(build(Path(sys.argv[1]), *sys.argv[2:]))
