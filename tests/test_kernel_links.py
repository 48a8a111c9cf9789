"""Kernels call others by address: with the same result, compiled or loaded, in processes of their own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from ligature import kernels

PACKAGE = Path(kernels.__file__).parent
PROGRAM = """
import numpy as np
from ligature.kernel_links import link, offer
from ligature.kernels import kernel
from ligature.tables import opener, table_of
from typing import NamedTuple

class Group(NamedTuple):
    numbers: np.ndarray
    total: np.ndarray

open_group = opener(Group(np.zeros((1, 1)), np.zeros(1)))
call_add = link("ligature_test_add")

@kernel
def add(address):
    group = open_group(address)
    for i in range(group.numbers.shape[0]):
        for j in range(group.numbers.shape[1]):
            group.total[0] += group.numbers[i, j]

@kernel
def add_rows(tables):
    for r in range(tables.shape[0]):
        call_add(tables[r].ctypes.data)

def run():
    offer("ligature_test_add", add)
    groups = [Group(np.arange(6.0).reshape(2, 3) + k, np.zeros(1)) for k in range(3)]
    add_rows(np.array([table_of(group) for group in groups]))
    hits = sum(sum(made.stats.cache_hits.values()) for made in (add, add_rows))
    print([group.total[0] for group in groups], hits)
"""


def test_a_kernel_calls_one_by_address_when_it_is_compiled_and_when_it_is_loaded(tmp_path: Path) -> None:
    (tmp_path / "linked.py").write_text(PROGRAM)
    path = os.pathsep.join([str(tmp_path), str(PACKAGE.parent)])
    environment = {**os.environ, "PYTHONPATH": path, "LIGATURE_CACHE": str(tmp_path / "cache")}
    for hits in (0, 2):
        words = [sys.executable, "-c", "import linked; linked.run()"]
        done = subprocess.run(words, env=environment, capture_output=True, text=True, timeout=120)
        assert done.stdout == f"[15.0, 21.0, 27.0] {hits}\n", done.stdout + done.stderr
