"""The page of ``ligature evaluate``: one HTML file beside its pictures, without scripts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from ligature.environments.evaluation import UNITS
from ligature.render.files import staged

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 70rem; padding: 0 1rem; }
table { border-collapse: collapse; margin: 1rem 0; }
th, td { padding: .25rem .8rem; text-align: right; border-bottom: 1px solid #ddd; }
th:first-child, td:first-child { text-align: left; }
.done { color: #176b2c; }
.lost { color: #a02020; }
figure { display: inline-block; margin: .3rem; }
img { width: 320px; display: block; }
"""

SHARES = ("success", "lost")


def write_page(report: Mapping[str, Any], pictures: Sequence[tuple[int, Sequence[Path]]], path: Path) -> Path:
    """Write what `ligature.environments.evaluation.report` returns, with ``pictures`` by the seed of their episode."""
    title = f"{Path(report['policy']).name} in {report['environment'].get('task')}"
    options = ", ".join(f"{name} {value}" for name, value in report["environment"].items())
    text = [
        "<!doctype html>", '<html lang="en"><head><meta charset="utf-8">', f"<title>{escape(title)}</title>",
        f"<style>{STYLE}</style></head><body>", f"<h1>{escape(title)}</h1>",
        f"<p>{report['summary']['episodes']} episodes; {escape(options)}; Ligature {escape(report['ligature'])}. "
        f"Intervals of {report['confidence']:.0%}.</p>",
        _summary(report["summary"]), *(_figures(seed, files) for seed, files in pictures),
        _episodes(report["episodes"]), "</body></html>",
    ]  # fmt: skip
    with staged(path) as part:
        part.write_text("\n".join(text), "utf-8", errors="backslashreplace")  # names of files need not be UTF-8
    return path


def _summary(summary: Mapping[str, Any]) -> str:
    rows = []
    for name, value in summary.items():
        if isinstance(value, dict):
            form = "{:.1%}" if name in SHARES else "{:.3g}"
            cells = "".join(f"<td>{form.format(value[part])}</td>" for part in ("mean", "low", "high"))
            rows.append(f"<tr><td>{name.replace('_', ' ')}</td>{cells}<td>{UNITS.get(name, '')}</td></tr>")
    return "<table><tr><th></th><th>mean</th><th>low</th><th>high</th><th></th></tr>" + "".join(rows) + "</table>"


def _figures(seed: int, files: Sequence[Path]) -> str:
    moments = [f"{file.stem.split('_')[-1]} moment of seed {seed}" for file in files]
    return "".join(
        f'<figure><img src="{escape(file.name)}" alt="{moment}"><figcaption>{moment}</figcaption></figure>'
        for file, moment in zip(files, moments, strict=True)
    )


def _episodes(episodes: Sequence[Mapping[str, Any]]) -> str:
    names = [name for name in episodes[0] if name not in ("seed", "success", "lost")]
    head = "".join(f"<th>{name.replace('_', ' ')}</th>" for name in names)
    rows = []
    for e in episodes:
        kind, how = ("done", "done") if e["success"] else ("lost", e["lost"] or "not done")
        cells = "".join(f"<td>{e[name]:.4g}</td>" for name in names)
        rows.append(f'<tr><td>{e["seed"]}</td><td class="{kind}">{escape(how)}</td>{cells}</tr>')
    return f"<h2>Episodes</h2><table><tr><th>seed</th><th>ended</th>{head}</tr>{''.join(rows)}</table>"
