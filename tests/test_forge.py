"""What a forge and its visitors read agrees with what the project does."""

from __future__ import annotations

import re
import subprocess
import sys

import yaml

from tests.conftest import ROOT
from tests.test_packaging import locked

sys.path.insert(0, str(ROOT / ".ci"))
import dockerfile_steps  # noqa: E402


def test_hooks_before_a_commit_have_the_versions_of_the_lock() -> None:
    pins = locked("requirements-dev.txt")
    hooks = {
        repo["repo"].rpartition("/")[2]: repo
        for repo in yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())["repos"]
    }
    assert hooks["ruff-pre-commit"]["rev"] == f"v{pins['ruff']}"
    assert hooks["mirrors-mypy"]["rev"] == f"v{pins['mypy']}"
    (mypy,) = hooks["mirrors-mypy"]["hooks"]
    assert [text.lower() for text in mypy["additional_dependencies"]] == [f"types-pyyaml=={pins['types-pyyaml']}"]


def test_workflows_call_targets_and_scripts_that_exist() -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE))
    called = set()
    for path in (ROOT / ".github" / "workflows").glob("*.yml"):
        jobs = yaml.safe_load(path.read_text())["jobs"].values()
        for job in jobs:
            tries = job.get("strategy", {}).get("matrix", {}).get("try", [])
            assert all((ROOT / ".ci" / f"{name}.sh").is_file() for name in tries)
            for step in job["steps"]:
                called |= set(re.findall(r"^make ([a-z-]+)$", step.get("run", ""), flags=re.MULTILINE))
    assert {"test", "wheel", "site"} <= called <= targets


def test_files_that_the_guide_for_contributors_names_exist() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text()
    named = set(re.findall(r"`((?:simulator|tests|docs|scenes|examples|blender_addon|\.ci)/[\w./-]+)`", text))
    assert len(named) > 15
    assert [name for name in sorted(named) if not (ROOT / name).exists()] == []


def test_the_image_runs_the_entry_point_as_an_ordinary_user() -> None:
    steps = dockerfile_steps.steps((ROOT / "Dockerfile").read_text())
    found = dict(steps)
    assert found["FROM"] == "debian:12-slim" and found["USER"] != "root" and found["ENTRYPOINT"] == "ligature"
    copied = {word for name, text in steps if name == "COPY" for word in text.split()[:-1]}
    context = {line[1:] for line in (ROOT / ".dockerignore").read_text().splitlines() if line.startswith("!")}
    assert copied == context


def test_an_unknown_instruction_of_the_dockerfile_is_not_skipped(tmp_path) -> None:
    (tmp_path / "Dockerfile").write_text('FROM debian:12-slim\nRUN a && \\\n    b\nSHELL ["sh"]\n')
    done = subprocess.run(
        [sys.executable, ROOT / ".ci" / "dockerfile_steps.py", tmp_path / "Dockerfile"], capture_output=True, text=True
    )
    assert done.returncode == 1 and "instruction 'SHELL' is unknown" in done.stderr
    assert dockerfile_steps.steps('RUN a && \\\n    b\nENTRYPOINT ["x", "y"]\n') == [
        ("RUN", "a && b"),
        ("ENTRYPOINT", "x y"),
    ]
