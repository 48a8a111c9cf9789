"""Changes small things in modules, one at a time, and lists the changes that no test notices.

    python -m tests.bench.mutants [ROOM | MODULE[=TESTS] ...] [--most N] [--seed S]

A mutant is a module with one operator, comparison, constant or condition changed, or one statement left out. The tests of
the module run against it in a process of their own, forked after the packages that do not change were imported, so that a
mutant takes as long as its tests. ``TESTS`` are paths below `tests`, divided by commas: those of the module's package where
`PARTS` has none; a package is all of its modules. Without arguments `PARTS` are done. Kernels run as Python, for machine code
that is kept would hide what changed; tests marked `machine_code` are left out then.
"""

from __future__ import annotations

import argparse
import ast
import copy
import importlib.util
import io
import math
import os
import random
import re
import resource
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, redirect_stdout
from importlib.abc import MetaPathFinder, SourceLoader
from importlib.machinery import ModuleSpec
from pathlib import Path

from hypothesis import Phase, settings

ROOT = Path(__file__).resolve().parents[2]
PARTS = {
    "adf.values": "adf",
    "adf.scalars": "adf",
    "adf.findings": "adf/test_findings.py,adf/test_reader.py,adf/test_rules.py",
    "adf.frames": "adf,model/test_frames.py",
    "adf.align": "adf/test_align.py",
    "adf.resolver": "adf/test_resolver.py",
    "adf.patch": "adf",
    "adf.update": "adf",
    "adf.nodes": "adf/test_nodes.py,adf/test_patch.py,fuzz/test_spelling.py",
    "adf.relax": "adf/test_nodes.py,fuzz/test_spelling.py",
    "adf.slips": "adf/test_nodes.py,fuzz/test_spelling.py",
    "adf.rules": "adf/test_rules.py,adf/test_findings.py",
    "adf.checker": "adf/test_findings.py,adf/test_rules.py,adf/test_bounds.py,adf/test_reader.py",
    "adf.references": "model/test_lookup.py,model/test_naming.py,model/test_load.py",
    "adf.contents": "adf/test_contents.py",
    "adf.writer": "adf/test_writer.py",
    "model.messages": "model/test_commands.py,bus/test_codec.py",
    "model.commands": "model/test_commands.py,bus/test_codec.py,bus/test_mailbox.py",
    "model.endoscopes": "model/test_endoscopes.py",
    "model.extents": "model/test_extents.py",
    "model.rods": "model/test_rods.py",
    "model.sutures": "model/test_sutures.py",
    "model.tissue": "model/test_tissue.py",
    "model.softening": "model/test_softening.py",
    "model.lookup": "model/test_lookup.py",
    "model.jaws": "model/test_jaws.py",
    "model.needles": "model/test_needles.py",
    "model.holes": "model/test_holes.py",
    "model.trees": "model/test_trees.py,model/test_load.py",
    "model.axes": "model/test_joints.py,model/test_mechanism.py",
    "model.joints": "model/test_joints.py,adf/test_rules.py",
    "model.parenting": "model/test_parenting.py,model/test_load.py",
    "model.mechanism": "model/test_mechanism.py",
    "model.naming": "model/test_naming.py,model/test_load.py,model/test_prefix.py,model/test_proxies.py",
    "bus.codec": "bus/test_codec.py,bus/test_mailbox.py",
    "bus.newest": "bus/test_newest.py,bus/test_mailbox.py,bus/test_outbox.py",
    "bus.mailbox": "bus/test_mailbox.py",
    "bus.pacing": "bus/test_pacing.py",
    "bus.record": "bus/test_record.py",
    "bus.ring": "bus/test_outbox.py,bus/test_mailbox.py,bus/test_block.py",
    "bus.block": "bus/test_block.py",
    "bus.events": "bus/test_events.py",
    "bus.outbox": "bus/test_outbox.py",
    "bus.recording": "bus/test_recording.py",
    "bus.watchdog": "bus/test_watchdog.py",
    "robots.chain": "robots/test_chain.py",
    "robots.fitting": "robots/test_fitting.py",
    "robots.impedance": "robots/test_impedance.py",
    "robots.instruments": "robots/test_instruments.py",
    "robots.operating_state": "robots/test_operating_state.py",
    "robots.trajectory": "robots/test_trajectory.py,robots/test_operating_state.py",
    "robots.device": "robots/test_operating_state.py,robots/test_arm.py",
    "robots.axes": "robots/test_arm.py,robots/test_psm.py",
    "robots.ecm": "robots/test_ecm.py",
    "robots.poses": "robots",
    "tissue.elements": "tissue/test_elements.py",
}
"""Modules and the tests that are theirs."""

SECONDS = 60.0
"""Processor time after which a mutant counts as noticed, for it runs for ever; other work on the machine costs none."""

IDLE = 10.0
"""How many times that may pass on the clock: a mutant that waits for ever uses no processor."""

MEMORY = 4 << 30
"""Most bytes of a mutant: one that collects for ever counts as noticed before it takes the machine's memory."""

KERNEL = re.compile(r"^@(compiled|kernel|inlined)\b", re.MULTILINE)

COMPARED = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
}  # fmt: skip
OPERATED = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult}


def variants(node: ast.AST) -> Iterator[ast.AST]:
    """What may stand in the place of an expression."""
    new = copy.deepcopy(node)
    if isinstance(new, ast.Compare) and type(new.ops[0]) in COMPARED:
        new.ops[0] = COMPARED[type(new.ops[0])]()
        yield new
    elif isinstance(new, ast.BinOp) and type(new.op) in OPERATED:
        new.op = OPERATED[type(new.op)]()
        yield new
    elif isinstance(new, ast.BoolOp):
        new.op = ast.Or() if isinstance(new.op, ast.And) else ast.And()
        yield new
    elif isinstance(new, ast.UnaryOp) and isinstance(new.op, ast.Not):
        yield new.operand
    elif isinstance(new, ast.Constant) and isinstance(new.value, bool):
        new.value = not new.value
        yield new
    elif isinstance(new, ast.Constant) and isinstance(new.value, int | float):
        new.value = new.value + 1
        yield new


def mutants(source: str) -> list[tuple[int, str, Callable[[], str]]]:
    """Line, description and text of every mutant of a module."""
    tree, found = ast.parse(source), []
    for parent in ast.walk(tree):
        if isinstance(parent, ast.FunctionDef):  # neither defaults nor annotations
            places = [(parent, "body")]
        elif isinstance(parent, ast.arguments | ast.AnnAssign | ast.ImportFrom):
            continue
        else:
            places = [(parent, name) for name, _ in ast.iter_fields(parent)]
        for owner, name in places:
            value = getattr(owner, name)
            for i, node in enumerate(value if isinstance(value, list) else [value]):
                if not isinstance(node, ast.AST):
                    continue
                options = list(variants(node)) if isinstance(node, ast.expr) else []
                if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
                    options.append(ast.copy_location(ast.Pass(), node))
                for new in options:
                    at = i if isinstance(value, list) else None
                    before, after = ast.unparse(node), ast.unparse(new)
                    found.append((node.lineno, f"{before}  ->  {after}", _text(tree, owner, name, at, new)))
    return found


def _text(tree: ast.Module, owner: ast.AST, name: str, at: int | None, new: ast.AST) -> Callable[[], str]:
    def text() -> str:
        old = getattr(owner, name) if at is None else getattr(owner, name)[at]
        _put(owner, name, at, new)
        try:
            return ast.unparse(ast.fix_missing_locations(tree))
        finally:
            _put(owner, name, at, old)

    return text


def _put(owner: ast.AST, name: str, at: int | None, node: object) -> None:
    if at is None:
        setattr(owner, name, node)
    else:
        getattr(owner, name)[at] = node


class Changed(MetaPathFinder, SourceLoader):
    """Imports one module from another text than its file's."""

    def __init__(self, module: str, path: Path, text: str) -> None:
        self._module, self._path, self._text = module, path, text

    def find_spec(self, fullname: str, path: object = None, target: object = None) -> ModuleSpec | None:
        if fullname != self._module:
            return None
        return importlib.util.spec_from_file_location(fullname, self._path, loader=self)

    def get_filename(self, fullname: str) -> str:
        return str(self._path)

    def get_data(self, path: str) -> bytes:
        return self._text.encode()

    def path_stats(self, path: str) -> dict[str, int]:
        raise OSError("no bytecode")


class Unshrunk:
    """Has Hypothesis stop at the first example that fails: a smaller one, sought for up to minutes, says nothing more."""

    def pytest_sessionstart(self) -> None:
        """Change the profile that the tests' own configuration has loaded, before their modules are."""
        usual = settings.get_profile("same")
        settings.register_profile("unshrunk", parent=usual, phases=[Phase.explicit, Phase.generate])
        settings.load_profile("unshrunk")


def interpret_kernels() -> None:
    """Let kernels be plain functions."""
    from ligature import kernels

    kernels.compile_with = lambda function, **options: function


def parts_of(words: list[str]) -> dict[str, str]:
    """Modules and their tests for the words of the command line."""
    found = {}
    for word in words:
        name, _, tests = word.partition("=")
        package = ROOT / "simulator" / "ligature" / name.replace(".", "/")
        modules = sorted(package.rglob("*.py")) if package.is_dir() else [package.with_suffix(".py")]
        for path in modules:
            if path.name != "__init__.py":
                module = ".".join(path.relative_to(ROOT / "simulator" / "ligature").with_suffix("").parts)
                found[module] = tests or PARTS.get(module, module.partition(".")[0])
    return found


def survives(module: str, path: Path, text: str, tests: list[str], seconds: float = SECONDS) -> bool:
    """Whether the tests pass with a module of this text."""
    child = os.fork()
    if child == 0:
        os.setpgid(0, 0)
        resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(seconds),) * 2)
        resource.setrlimit(resource.RLIMIT_DATA, (MEMORY,) * 2)
        sys.meta_path.insert(0, Changed(module, path, text))
        code = 1
        try:
            import pytest

            marks = "not slow and not ros and not corpus"
            if KERNEL.search(text):
                interpret_kernels()
                marks += " and not machine_code"

            with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
                code = pytest.main(["-x", "-q", "-m", marks, "--no-header", *tests], plugins=[Unshrunk()])
        finally:
            os._exit(0 if code == 0 else 1)
    deadline = time.monotonic() + IDLE * seconds
    while time.monotonic() < deadline:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status) == 0
        time.sleep(0.02)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return False


def report(line: str) -> None:
    """Write a line at once."""
    sys.stdout.write(line + "\n" if line else "")
    sys.stdout.flush()


def main() -> int:
    """Print survivors module by module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", metavar="ROOM|MODULE[=TESTS]")
    parser.add_argument("--most", type=int, default=25, help="mutants of a module that are tried, drawn at random")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--seconds", type=float, default=SECONDS, help="processor time after which a mutant counts as noticed"
    )
    given = parser.parse_args()
    os.chdir(ROOT)
    sys.path[:0] = [str(ROOT / "simulator"), str(ROOT)]
    import numba  # noqa: F401
    import numpy  # noqa: F401
    import yaml  # noqa: F401

    parts = parts_of(given.parts) or PARTS
    lived = tried = 0
    passing: dict[tuple[str, bool], bool] = {}
    for name, tests in parts.items():
        module = f"ligature.{name}"
        path = ROOT / "simulator" / Path(*module.split(".")).with_suffix(".py")
        if not path.exists():
            report(f"{name}: no such module")
            continue
        folders = [f"tests/{test}" for test in tests.split(",")]
        found = mutants(path.read_text())
        if not found:
            continue
        kind = tests, bool(KERNEL.search(path.read_text()))
        if kind not in passing:
            passing[kind] = survives(module, path, path.read_text(), folders, given.seconds)
        if not passing[kind]:
            report(f"{name}: its tests fail, or take longer than {given.seconds:g} s, without a change")
            continue
        chosen = random.Random(given.seed).sample(found, min(given.most, len(found)))
        begin, left = time.monotonic(), []
        for line, what, text in sorted(chosen, key=lambda m: m[0]):
            if survives(module, path, text(), folders, given.seconds):
                left.append(f"    {path.name}:{line}: {what}")
        lived, tried = lived + len(left), tried + len(chosen)
        took = time.monotonic() - begin
        report(f"{name}: {len(left)} of {len(chosen)} survive ({len(found)} mutants in all, {took:.0f} s)")
        report("\n".join(left))
    report(f"{lived} of {tried} survive")
    return 0


if __name__ == "__main__":
    sys.exit(main())
