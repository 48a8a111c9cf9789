"""Follows one document, one command and one export call by call through the code of two revisions.

    python -m tests.bench.walks [REVISION ...]

A revision is what git knows by that name; ``.`` is the working tree. The functions of the project are noted in the order in
which they are called first. Who reads them in that order opens one module after the other; to open one again is a *return*.
Exports need Blender.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from itertools import groupby
from pathlib import Path
from types import FrameType

HERE = Path(__file__).resolve()
PROJECT = HERE.parents[2]
BEFORE = "8a7470f"
"""Ligature 0.1, the last commit before 0.2 began."""

WALKS = ("document", "command", "export")
SCENE, ARM = "scenes/suturing_small/launch.yaml", "scenes/suturing_small/psm1.yaml"


class Walk:
    """Modules and names of the functions of files below ``root``, each when it is called first; for `sys.setprofile`."""

    def __init__(self, root: Path) -> None:
        self._root = f"{root}{os.sep}"
        self._seen: set[object] = set()
        self.functions: list[tuple[str, str]] = []

    def __call__(self, frame: FrameType, event: str, _: object) -> None:
        code = frame.f_code
        if event != "call" or code in self._seen or not code.co_filename.startswith(self._root):
            return
        self._seen.add(code)
        if not code.co_name.startswith("<"):  # lambdas and comprehensions are read where they stand
            module = code.co_filename.removeprefix(self._root).removesuffix(".py")
            self.functions.append((module, code.co_qualname))

    def follow(self, work: Callable[[], object]) -> list[tuple[str, str]]:
        """The functions that are called while ``work`` runs."""
        sys.setprofile(self)
        try:
            work()
        finally:
            sys.setprofile(None)
        return self.functions


def stretches(functions: list[tuple[str, str]]) -> list[str]:
    """The modules that who reads along has open, one after the other."""
    return [module for module, _ in groupby(module for module, _ in functions)]


def returns(modules: list[str]) -> Counter[str]:
    """How often who reads along opens each module again."""
    return Counter({module: count - 1 for module, count in Counter(modules).items() if count > 1})


def document(root: Path) -> list[tuple[str, str]]:
    """The model of an arm, from its file to the immutable scene; once before, so that caches are filled."""
    import ligature

    ligature.load(root / ARM)
    return Walk(root / "simulator" / "ligature").follow(lambda: ligature.load(root / ARM))


def command(root: Path) -> list[tuple[str, str]]:
    """A wrench on the needle, from a front end's bytes through the mailbox into the simulation."""
    import ligature
    from ligature.bus import Mailbox
    from ligature.bus.codec import encode
    from ligature.bus.ring import RING_BYTES, Ring
    from ligature.model.commands import BodyCommand, CommandType

    simulation = ligature.Simulation(ligature.load(root / SCENE))
    body = simulation.bodies["BODY Needle"].body.index
    ring = Ring(memoryview(bytearray(RING_BYTES)))
    box = Mailbox(simulation.scene, {"front end": ring})
    wrench = BodyCommand(body, CommandType.FORCE, (0.1, 0.0, 0.0, 0.0, 0.0, 0.0))

    def work() -> None:
        ring.push(encode(wrench))
        for message in box.take():
            simulation.apply(message)

    return Walk(root / "simulator" / "ligature").follow(work)


def export(root: Path) -> list[tuple[str, str]]:
    """The model of an arm that was brought into Blender, written to another folder."""
    import addon_utils
    import bpy

    module = addon_utils.enable("adf_studio", default_set=True)
    from adf_studio.read_file import import_file
    from adf_studio.write_file import export_file

    done = import_file(root / ARM, bpy.context.scene)
    target = Path(tempfile.mkdtemp()) / "psm1.yaml"
    return Walk(Path(module.__file__).parent).follow(lambda: export_file(done.collection, target))


def child(name: str, root: Path, out: Path) -> None:
    """Follow one walk in the process of one revision."""
    if name != "export":
        sys.path.insert(0, str(root / "simulator"))
    out.write_text(json.dumps({"document": document, "command": command, "export": export}[name](root)))


def unpack(revision: str, folder: Path) -> None:
    """The tree of a revision."""
    if revision == ".":
        for name in ("simulator", "scenes", "blender_addon", "docs"):
            shutil.copytree(PROJECT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        return
    archive = subprocess.run(["git", "archive", revision], cwd=PROJECT, check=True, capture_output=True).stdout
    subprocess.run(["tar", "-x", "-C", folder], input=archive, check=True)


def walked(name: str, root: Path) -> list[tuple[str, str]]:
    """The calls of a walk through the tree at ``root``."""
    out = root / f"{name}.json"
    words = [sys.executable, str(HERE)]
    environment = {**os.environ, "PYTHONPATH": str(root / "simulator")}
    if name == "export":
        scripts = root / "scripts"
        subprocess.run([sys.executable, root / "blender_addon" / "pack.py", "--stage", scripts / "addons"], check=True)
        words = ["blender", "-b", "--factory-startup", "--python-exit-code", "1", "--python", str(HERE), "--"]
        environment = {**os.environ, "BLENDER_USER_SCRIPTS": str(scripts)}
    done = subprocess.run(
        [*words, "--child", name, str(root), str(out)], env=environment, capture_output=True, text=True, cwd=root
    )
    if not out.exists():
        raise RuntimeError(f"the walk of the {name} failed:\n{done.stdout[-2000:]}{done.stderr[-4000:]}")
    return [(module, function) for module, function in json.loads(out.read_text())]


def report(line: str) -> None:
    """Write a line at once."""
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def main(words: list[str]) -> int:
    """Print the counts of each walk at each revision."""
    if words[:1] == ["--child"]:
        child(words[1], Path(words[2]), Path(words[3]))
        return 0
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("revisions", nargs="*", default=[BEFORE, "."])
    parser.add_argument("--walk", choices=WALKS, action="append", help="by default all")
    parser.add_argument("--all", action="store_true", help="print the modules in their order")
    given = parser.parse_args(words)
    for name in given.walk or WALKS:
        if name == "export" and shutil.which("blender") is None:
            report("export: Blender is not installed")
            continue
        for revision in given.revisions:
            with tempfile.TemporaryDirectory() as folder:
                unpack(revision, Path(folder))
                functions = walked(name, Path(folder))
            modules = stretches(functions)
            again = returns(modules)
            rate = f"{100 * again.total() / len(functions):.0f} for 100 functions"
            counts = f"{len(functions)} functions of {len(set(modules))} modules, {again.total()} returns, {rate}"
            report(f"{name} at {revision}: {counts}")
            report("    " + ", ".join(f"{module} {count}" for module, count in again.most_common()))
            if given.all:
                report("    " + " ".join(modules))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]))
