"""Files of those who learn: datasets (HDF5), ranges of a randomisation (YAML), networks (ONNX), for `tests.fuzz.readers`."""

from __future__ import annotations

import io
import random
import shutil
import tempfile
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from rich.console import Console

ROOT = Path(__file__).resolve().parents[2]

RANGES = """mass: [0.8, 1.2]
friction: [0.5, 1.5]
light: [0.5, 2.0]
camera_shift: [-0.005, 0.005]
action_delay: [0, 3]
joint_noise: [0.0, 0.001]
"""

HUGE = 1 << 44
"""Of rows that a hostile dataset claims."""


# --- datasets ---------------------------------------------------------------------------------


@lru_cache(maxsize=1)
def dataset_bytes() -> bytes:
    """A dataset of two episodes of an arm, copied so that it has few bytes."""
    import ligature
    from ligature.datasets import DatasetWriter

    simulation = ligature.Simulation(ligature.load(ROOT / "scenes" / "suturing_small" / "launch.yaml", (1,)))
    with tempfile.TemporaryDirectory() as folder:
        whole, small = Path(folder, "a.h5"), Path(folder, "b.h5")
        with DatasetWriter(whole, simulation, cameras=(), rate=100.0, phases=("reach", "pull")) as writer:
            for success in (True, False):
                for phase in ("reach", "reach", "pull"):
                    simulation.step(10)
                    writer.sample(phase)
                writer.end_episode(success)
        with h5py.File(whole) as source, h5py.File(small, "w", libver="latest") as target:
            _copy(source, target)
        return small.read_bytes()


def _copy(source: Any, target: Any) -> None:
    """Attributes, groups and arrays, these in one piece each."""
    target.attrs.update(source.attrs)
    for name, item in source.items():
        if isinstance(item, h5py.Group):
            _copy(item, target.create_group(name))
        else:
            target.create_dataset(name, data=item[()], dtype=item.dtype).attrs.update(item.attrs)


def rebuilt(data: bytes, rng: random.Random) -> bytes:
    """A dataset after a few changes of what is in it: a well-formed file that holds something else."""
    changed = io.BytesIO(data)
    with h5py.File(changed, "r+") as file:
        for _ in range(rng.choice((1, 1, 2, 4))):
            names: list[str] = []
            file.visit(names.append)
            name = rng.choice(names)
            try:
                rng.choice(CHANGES)(file, name, rng)
            except (KeyError, TypeError, ValueError, OSError, RuntimeError):
                continue  # what an earlier change took away, or what HDF5 does not write
    return changed.getvalue()


def _odd(rng: random.Random) -> Any:
    return rng.choice(
        (0, -1, 3, 2**40, float("nan"), float("inf"), "", "x" * 3000, "1", b"\xff\xfe", True,
         np.zeros(0), np.zeros((2, 3)), np.array(["a", "b"], dtype=object), h5py.Empty("f8"))
    )  # fmt: skip


def _change_attribute(file: Any, name: str, rng: random.Random) -> None:
    item = rng.choice((file, file[name]))
    key = rng.choice([*item.attrs, "samples", "success", "phases", "rate"])
    if rng.random() < 0.4:
        del item.attrs[key]
    else:
        item.attrs[key] = _odd(rng)


def _drop(file: Any, name: str, rng: random.Random) -> None:
    del file[name]


def _reshape(file: Any, name: str, rng: random.Random) -> None:
    """Another array, a group, or a claim, in the place of what was there."""
    del file[name]
    what = rng.randrange(5)
    if what == 0:
        file.create_group(name)
    elif what == 1:
        file.create_dataset(name, shape=rng.choice([(HUGE,), (3, HUGE), (HUGE, 7)]), dtype="f4", chunks=True)
    elif what == 2:
        file[name] = rng.choice(
            [np.zeros((3, 1)), np.zeros((0, 7)), np.full(3, 255), np.zeros((3, 7, 2)), np.array(2.0)]
        )
    elif what == 3:
        file[name] = np.array(["a", "b", "c"], dtype=object)
    else:
        file[name] = np.full((3, 7), rng.choice((np.nan, np.inf, 1e308, 0.0)))


def _link(file: Any, name: str, rng: random.Random) -> None:
    """A way elsewhere: around in a circle, out of the file, or to the bytes of another."""
    del file[name]
    what = rng.randrange(4)
    if what == 0:
        file[name] = h5py.SoftLink("/" if rng.random() < 0.5 else f"/{name}")
    elif what == 1:
        file[name] = h5py.ExternalLink(rng.choice(("/etc/passwd", "../b.h5", "none.h5", "/dev/zero")), "/")
    elif what == 2:
        file.create_dataset(name, (4,), "u1", external=[("/etc/passwd", 0, 4)])
    else:
        file[name] = file["/"]


CHANGES: tuple[Callable[[Any, str, random.Random], None], ...] = (
    _change_attribute, _change_attribute, _drop, _reshape, _reshape, _link
)  # fmt: skip


def read_dataset(path: Path) -> None:
    """List a dataset, then export it."""
    from ligature.cli.dataset import export, info

    from tests.fuzz.readers import Refused

    console = Console(file=io.StringIO(), width=10_000)
    out = path.parent / "exported"
    shutil.rmtree(out, ignore_errors=True)
    listed = info(path, console)
    printed = console.file.getvalue()  # type: ignore[attr-defined]
    exported = export(path, out, "lerobot-3.0", "h264", "", console)
    shutil.rmtree(out, ignore_errors=True)
    if listed or exported:
        words = printed if listed else console.file.getvalue()  # type: ignore[attr-defined]
        raise Refused(words.splitlines()[-1])


# --- randomisations and networks --------------------------------------------------------------


def read_ranges(path: Path) -> None:
    """Ranges of a randomisation."""
    from ligature.environments.randomisation import Randomisation

    from tests.fuzz.readers import Refused

    try:
        Randomisation.of(path)
    except ValueError as error:
        raise Refused(str(error)) from error


@lru_cache(maxsize=1)
def network_bytes() -> bytes:
    """A network that turns 4 numbers of a state into an action."""
    import onnx

    kind = onnx.TensorProto.FLOAT
    graph = onnx.helper.make_graph(
        [
            onnx.helper.make_node("MatMul", ["state", "W"], ["way"]),
            onnx.helper.make_node("Tanh", ["way"], ["action"]),
        ],
        "policy",
        [onnx.helper.make_tensor_value_info("state", kind, [1, 4])],
        [onnx.helper.make_tensor_value_info("action", kind, [1, 7])],
        [onnx.numpy_helper.from_array(np.full((4, 7), 0.1, np.float32), "W")],
    )
    model = onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 17)], ir_version=9)
    return bytes(model.SerializeToString())


def read_network(path: Path) -> None:
    """A policy, and what it does with an observation."""
    from ligature.environments.policies import PolicyError, checked, load_policy

    from tests.fuzz.readers import Refused

    env: Any = None
    try:
        act = load_policy(str(path))(env, 0)
        checked(act({"state": np.linspace(-1.0, 1.0, 4)}), 7)
    except PolicyError as error:
        raise Refused(str(error)) from error
