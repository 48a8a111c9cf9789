"""Arguments and options that several commands have, and how their texts are read."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path
from typing import Annotated, Optional

import typer

from ligature.bundle import launch_file, scene_names
from ligature.cli.missing import remedy
from ligature.cli.options import model_indices
from ligature.cli.sampling import Sampling, picture_size


def launch_files(paths: list[Path] | None) -> list[Path]:
    """The launch files of paths and of names of bundled scenes."""
    return [launch_file(path) for path in paths or []]


Launch = Annotated[
    Path,
    typer.Argument(
        help=f"Launch file, one model file, or the name of a bundled scene: {', '.join(scene_names())}.",
        callback=launch_file,
    ),
]
Models = Annotated[Optional[str], typer.Option("-l", help="Indices of 'multibody configs', for example 10,11,6.")]  # noqa: UP045
Roots = Annotated[
    list[Path] | None,
    typer.Option("--root", help="Additional folder that scene files may be read from.", exists=True, file_okay=False),
]  # noqa: UP045

UpdateRate = Annotated[float, typer.Option("-p", help="Updates per simulated second.", min=1, max=1000)]
Speed = Annotated[float, typer.Option("-s", "--speed", help="Simulated time over wall time.", min=0.001)]

Rate = Annotated[
    Optional[float],  # noqa: UP045
    typer.Option("--rate", help="For a dataset: samples per simulated second, 10 by default.", min=0.1, max=1000),
]
Size = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option("--size", help="For a dataset: width x height of its pictures, 320x240 by default."),
]
Cameras = Annotated[
    Optional[list[str]],  # noqa: UP045
    typer.Option("--camera", help="For a dataset: a camera, or 'none'; repeatable. By default cameraL and cameraR."),
]

AllowPlugins = Annotated[
    bool,
    typer.Option(
        "--allow-plugins", help="Run the plug-ins that the scene's files name; their code can do all you can."
    ),
]
Devices = Annotated[Optional[str], typer.Option("-i", help="Indices of input devices whose proxies the scene gets.")]  # noqa: UP045

DatasetFile = Annotated[Path, typer.Argument(help="HDF5 dataset of demo, replay or DatasetWriter.")]
CockpitAddress = Annotated[
    Optional[str],  # noqa: UP045
    typer.Option(
        "--cockpit-at", "--at", metavar="ADDRESS:PORT",
        help="Address of the web page; other machines need a token in LIGATURE_COCKPIT_TOKEN.",
    ),
]  # fmt: skip


def indices(text: str | None) -> tuple[int, ...] | None:
    """Indices of a list such as ``10, 11,6``; None for none given."""
    if text is None:
        return None
    try:
        return model_indices(text)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None


def sampling_of(dataset: Path | None, rate: float | None, size: str | None, cameras: list[str] | None) -> Sampling:
    """How a dataset is sampled; its options without one are an error."""
    if dataset is None:
        if (rate, size, cameras or None) != (None, None, None):
            raise typer.BadParameter("--rate, --size and --camera describe a dataset; add '--dataset FILE.h5'")
        return Sampling()
    default = Sampling()
    try:
        pixels = default.size if size is None else picture_size(size)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None
    names = default.cameras if not cameras else tuple(name for name in cameras if name != "none")
    return Sampling(rate or default.rate, pixels, names)


def task_name(text: str) -> str:
    """``text``, unless it is given and no task has that name."""
    if text:
        from ligature.tasks import TASKS  # with it the model, which a run's start spares

        if text not in TASKS:
            raise typer.BadParameter(f"unknown task '{text}'; choose one of {', '.join(TASKS)}")
    return text


def page_address(text: str | None) -> str:
    """The address of the page; raises `typer.BadParameter` when the page may not be served there."""
    if importlib.util.find_spec("viser") is None:
        raise typer.BadParameter(remedy("viser"))
    from ligature.cockpit.address import DEFAULT, TOKEN_VARIABLE, AddressError, check_token, read_address

    try:
        check_token(read_address(text or DEFAULT), os.environ.get(TOKEN_VARIABLE, ""))
    except AddressError as error:
        raise typer.BadParameter(str(error)) from None
    return text or DEFAULT


def five_numbers(text: str) -> tuple[float, float, float, float, float]:
    """The five coefficients of a distortion."""
    try:
        k1, k2, p1, p2, k3 = (float(part) for part in text.split(","))
    except ValueError:
        raise typer.BadParameter(f"--distortion is five numbers k1,k2,p1,p2,k3, not '{text}'") from None
    return k1, k2, p1, p2, k3
