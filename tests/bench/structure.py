"""Draws which package imports which, at two revisions, and counts circles.

    python -m tests.bench.structure [REVISION ...] [--out FILE]

A revision is what git knows by that name; ``.`` is the working tree. Imports within functions count, those for types alone
are counted apart. Without arguments the state before packages, commands and snapshots were put in order is compared with the
working tree. The drawing is ``build/structure.png``.
"""

from __future__ import annotations

import argparse
import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = "simulator/ligature/"
BEFORE = "8a7470f"
"""Ligature 0.1, the last commit before 0.2 began."""

Arrows = dict[str, set[str]]


def sources(revision: str) -> dict[str, str]:
    """Text of each module of the package at a revision, by its dotted name."""
    if revision == ".":
        paths = [path.relative_to(ROOT).as_posix() for path in (ROOT / PACKAGE).rglob("*.py")]
        texts = [(ROOT / path).read_text(encoding="utf-8") for path in paths]
    else:
        listed = _git("ls-tree", "-r", "--name-only", revision, PACKAGE).split("\n")
        paths = [path for path in listed if path.endswith(".py")]
        texts = [_git("show", f"{revision}:{path}") for path in paths]
    names = [path.removeprefix("simulator/").removesuffix(".py").replace("/", ".") for path in paths]
    return dict(zip((name.removesuffix(".__init__") for name in names), texts, strict=True))


def _git(*words: str) -> str:
    return subprocess.run(["git", *words], cwd=ROOT, check=True, capture_output=True, text=True).stdout


def imports(text: str, names: set[str]) -> Iterator[tuple[str, bool]]:
    """Modules of ``names`` that a text imports, each with whether for types alone."""
    yield from _imports(ast.parse(text), names, False)


def _imports(node: ast.AST, names: set[str], for_types: bool) -> Iterator[tuple[str, bool]]:
    if isinstance(node, ast.ImportFrom) and node.module:
        for alias in node.names:
            whole = f"{node.module}.{alias.name}"
            if whole in names or node.module in names:
                yield (whole if whole in names else node.module), for_types
    elif isinstance(node, ast.Import):
        yield from ((alias.name, for_types) for alias in node.names if alias.name in names)
    for child in ast.iter_child_nodes(node):
        guarded = isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test) and child in node.body
        yield from _imports(child, names, for_types or guarded)


def package_of(module: str) -> str:
    """The package, or the module outside packages, that a module belongs to."""
    return module.split(".")[1] if "." in module else module


def arrows(modules: dict[str, str], of_packages: bool, with_types: bool) -> Arrows:
    """What each package, or module, imports of others."""
    found: Arrows = {}
    for name, text in modules.items():
        for target, for_types in imports(text, set(modules)):
            begin, end = (package_of(name), package_of(target)) if of_packages else (name, target)
            found.setdefault(begin, set())
            found.setdefault(end, set())
            if begin != end and (with_types or not for_types):
                found[begin].add(end)
    return found


def reached(graph: Arrows, begin: str) -> set[str]:
    """All that ``begin`` imports, directly or through others."""
    found: set[str] = set()
    rest = list(graph[begin])
    while rest:
        name = rest.pop()
        if name not in found:
            found.add(name)
            rest += graph[name]
    return found


def circles(graph: Arrows) -> set[frozenset[str]]:
    """Groups of which each member imports each other, directly or through others."""
    far = {name: reached(graph, name) for name in graph}
    groups = (frozenset({name, *(k for k in far[name] if name in far[k])}) for name in graph)
    return {group for group in groups if len(group) > 1}


def layers(graph: Arrows) -> dict[str, int]:
    """Height of each package over what imports nothing; packages of a circle are as high as what it stands on."""
    far = {name: reached(graph, name) for name in graph}
    heights: dict[str, int] = {}

    def height(name: str) -> int:
        if name not in heights:
            below = [k for k in graph[name] if name not in far[k]]
            heights[name] = 1 + max(map(height, below), default=-1)
        return heights[name]

    for name in graph:
        height(name)
    return heights


def draw(graphs: dict[str, Arrows], path: Path) -> None:
    """Draw graphs side by side, layer by layer; arrows that close a circle are red."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, plots = pyplot.subplots(1, len(graphs), figsize=(11 * len(graphs), 13), squeeze=False)
    for plot, (title, graph) in zip(plots[0], graphs.items(), strict=True):
        heights, bad = layers(graph), circles(graph)
        rows: dict[int, list[str]] = {}
        for name in sorted(graph):
            rows.setdefault(heights[name], []).append(name)
        widest = max(map(len, rows.values()))
        at = {
            name: ((i + 0.5) / len(row) * widest + 0.15 * (level % 2), level)
            for level, row in rows.items()
            for i, name in enumerate(row)
        }
        for begin, ends in graph.items():
            for end in ends:
                closes = any(begin in group and end in group for group in bad)
                style = {"color": "#c62828" if closes else "#90a4ae", "linewidth": 2.0 if closes else 0.7}
                plot.annotate(
                    "", at[end], at[begin], arrowprops={"arrowstyle": "-|>", "shrinkA": 14, "shrinkB": 14, **style}
                )
        for name, (x, y) in at.items():
            plot.text(x, y, name, ha="center", va="center", bbox={"boxstyle": "round", "fc": "white", "ec": "#37474f"})
        plot.set_xlim(-0.5, widest + 0.5)
        plot.set_ylim(-0.7, max(rows) + 0.7)
        plot.set_title(title)
        plot.axis("off")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.tight_layout()
    figure.savefig(path, dpi=80)


def report(line: str) -> None:
    """Write a line."""
    sys.stdout.write(line + "\n")


def main() -> int:
    """Print the counts of each revision, and draw them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("revisions", nargs="*", default=[BEFORE, "."])
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "structure.png")
    given = parser.parse_args()
    graphs = {}
    for revision in given.revisions:
        modules = sources(revision)
        packages = arrows(modules, of_packages=True, with_types=False)
        graphs["the working tree" if revision == "." else revision] = packages
        report(
            f"{revision}: {len(modules)} modules, {len(packages)} packages, {sum(map(len, packages.values()))} arrows between packages"
        )
        for of_packages, kind in ((True, "packages"), (False, "modules")):
            for with_types in (False, True):
                found = circles(arrows(modules, of_packages, with_types))
                named = "; ".join(", ".join(sorted(group)) for group in found)
                report(f"  circles of {kind}{', types included' * with_types}: {len(found)} {named}".rstrip())
    draw(graphs, given.out)
    report(f"drawn: {given.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
