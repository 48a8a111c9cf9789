"""The command ``ligature``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Optional

import typer
from rich.console import Console

from ligature.cli.arguments import (
    AllowPlugins,
    Cameras,
    CockpitAddress,
    DatasetFile,
    Devices,
    Launch,
    Models,
    Rate,
    Roots,
    Size,
    Speed,
    UpdateRate,
    five_numbers,
    indices,
    launch_files,
    page_address,
    sampling_of,
    task_name,
)
from ligature.cli.numbers import Commands
from ligature.cli.options import RunOptions, arm_entry, arm_names, name_prefix, rate_notes
from ligature.cli.supervisor import supervise

app = Commands(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Simulator for robot-assisted suturing.",
)


dataset_app = Commands(no_args_is_help=True, help="Inspect datasets and export them to LeRobot's formats.")
app.add_typer(dataset_app, name="dataset")

FIRST_THROW = Path("needle_insertion")
"""Default scene of the cockpit."""


@app.command()
def run(
    launch: Launch,
    models: Models = None,
    root: Roots = None,
    rate: UpdateRate = 1000.0,
    speed: Speed = 1.0,
    namespace: Annotated[str, typer.Option("--ns", help="Prefix of every namespace.")] = "",
    min_hz: Annotated[int | None, typer.Option("--min-hz", help="Publishing rate without commands.", min=1)] = None,  # noqa: UP045
    max_hz: Annotated[int | None, typer.Option("--max-hz", help="Publishing rate with commands.", min=1)] = None,  # noqa: UP045
    arm: Annotated[
        Optional[list[str]],  # noqa: UP045
        typer.Option(help="An arm, NAME=KIND:BODY:TOOL; replaces the arms found in the scene; repeatable."),
    ] = None,
    only: Annotated[str, typer.Option(help="Only these arms, for example PSM1,PSM2.")] = "",
    masters: Annotated[
        bool,
        typer.Option("--masters/--no-masters", help="Simulate master arms; switch them off beside a real console."),
    ] = True,
    base_frames: Annotated[
        str, typer.Option(help="Arm in the frame of whose tip the others give their poses: ECM, as a dVRK with a cart.")
    ] = "",
    src_crtk: Annotated[
        bool, typer.Option("--src-crtk", help="Publish arms under /CRTK too, as the challenge's node does.")
    ] = False,
    names: Annotated[
        str, typer.Option(help="Name policy: ambf, or src for the suturing challenge's scripts.")
    ] = "ambf",
    cameras: Annotated[
        Optional[bool],  # noqa: UP045
        typer.Option(
            "--cameras/--no-cameras",
            help="Publish pictures of all cameras, or of none; the default is that of the scene.",
        ),
    ] = None,
    window: Annotated[bool, typer.Option("--window", help="Show the scene in a window.")] = False,
    camera_windows: Annotated[
        bool, typer.Option("--camera-windows", help="Show each camera in a window of its own, as AMBF does.")
    ] = False,
    task: Annotated[
        str, typer.Option(help="Judge a task on ROS: pose_estimation, insertion or suture.", callback=task_name)
    ] = "",
    record: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(help="File to record all commands to; 'ligature replay' simulates the run again from it."),
    ] = None,
    cockpit: Annotated[bool, typer.Option("--cockpit", help="Serve the web page (cockpit) on this machine.")] = False,
    cockpit_at: CockpitAddress = None,
    devices: Devices = None,
    soft: Annotated[
        Optional[list[str]],  # noqa: UP045
        typer.Option(help="Simulate a rigid body as soft tissue, BODY or BODY=MATERIAL; repeatable."),
    ] = None,
    allow_plugins: AllowPlugins = False,
) -> None:
    """Run a scene on ROS 1; starts a master when none answers."""
    if names not in ("ambf", "src"):
        raise typer.BadParameter(f"--names must be 'ambf' or 'src', not '{names}'")
    arms = tuple(arm or ())
    try:
        for text in arms:
            arm_entry(text)
        if soft:
            from ligature.model.softening import requested  # with it the parser of scenes, which a run's start spares

            requested(soft)
        names_of_arms = arm_names(only)
        name_prefix(namespace)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error
    options = RunOptions(
        str(launch), indices(models), (), tuple(str(r) for r in root or ()), namespace, rate, speed,
        min_hz=min_hz, max_hz=max_hz, names=names, arms=arms, src_crtk=src_crtk, cameras=cameras,
        window=window or camera_windows, camera_windows=camera_windows, task=task, record=str(record) if record else "",
        cockpit=page_address(cockpit_at) if cockpit or cockpit_at else "", notes=rate_notes(rate),
        devices=indices(devices) or (), soft=tuple(soft or ()), only=names_of_arms, masters=masters,
        base_frames=base_frames, allow_plugins=allow_plugins,
    )  # fmt: skip
    supervise(options)


@app.command()
def cockpit(
    launch: Launch = FIRST_THROW,
    models: Models = None,
    root: Roots = None,
    at: CockpitAddress = None,
    rate: UpdateRate = 1000.0,
    speed: Speed = 1.0,
    devices: Devices = None,
    allow_plugins: AllowPlugins = False,
) -> None:
    """Run a scene with a live web page and without ROS; see `run --cockpit` for both.

    Without LAUNCH it is the scene of a first throw: one arm, a needle, and tissue.
    """
    options = RunOptions(
        str(launch), indices(models), (), tuple(str(r) for r in root or ()), rate=rate, speed=speed,
        cockpit=page_address(at), ros=False, notes=rate_notes(rate), devices=indices(devices) or (),
        allow_plugins=allow_plugins,
    )  # fmt: skip
    supervise(options)


@app.command()
def check(
    files: Annotated[
        list[Path],
        typer.Argument(
            help="Launch, world, model or input-device files, or names of bundled scenes.", callback=launch_files
        ),
    ],
    strict: Annotated[bool, typer.Option(help="Reject files that AMBF rejects.")] = False,
    root: Roots = None,
    verbose: Annotated[bool, typer.Option("-v", help="Also list keys without effect.")] = False,
    models: Models = None,
    author: Annotated[
        bool,
        typer.Option("--author", help="Also report what may surprise authors, as Blender's Check Scene."),
    ] = False,
) -> None:
    """Report every problem of a scene as file:line:column; exit status 1 on errors."""
    from ligature.cli.check import check as run_check

    console = Console(highlight=False, soft_wrap=True)
    raise typer.Exit(run_check(files, root or [], strict, verbose, console, indices(models), author))


@app.command()
def bench(
    launch: Launch,
    models: Models = None,
    seconds: Annotated[float, typer.Option(help="Wall-clock seconds to measure.", min=0.1)] = 5.0,
    rate: UpdateRate = 200.0,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    root: Roots = None,
) -> None:
    """Measure the physics of a scene: ticks per second, real-time factor, times by phase, memory."""
    from ligature.cli.bench import bench as run_bench

    raise typer.Exit(run_bench(launch, indices(models), root or [], seconds, rate, json, Console(highlight=False)))


@app.command("compile")
def compile_kernels(
    scenes: Annotated[
        Optional[list[Path]],  # noqa: UP045
        typer.Argument(help="Launch files; by default two bundled scenes.", callback=launch_files),
    ] = None,
) -> None:
    """Compile the kernels of scenes ahead of their first start, several at a time."""
    from ligature.cli.compile import compile_ahead

    raise typer.Exit(compile_ahead(scenes or [], Console(highlight=False, soft_wrap=True)))


@app.command()
def render(
    launch: Launch,
    camera: Annotated[str, typer.Option(help="Camera name, or a unique part of it.")],
    out: Annotated[Path, typer.Option(help="Folder to write to.")] = Path("out"),
    models: Models = None,
    seconds: Annotated[float, typer.Option(help="Simulated seconds before the image.", min=0)] = 0.0,
    width: Annotated[int, typer.Option(help="Width in pixels; 0 for the camera's own.", min=0)] = 0,
    height: Annotated[int, typer.Option(help="Height in pixels; 0 for the camera's own.", min=0)] = 0,
    root: Roots = None,
    format: Annotated[str, typer.Option(help="Format of depth, ids and normals: npy, png or exr.")] = "npy",
    annotations: Annotated[str, typer.Option(help="Annotations to write: coco, mask, or coco,mask.")] = "",
    exposure: Annotated[float, typer.Option(help="Exposure compensation in stops.")] = 0.0,
    noise: Annotated[float, typer.Option(help="Standard deviation of colour noise; 1 is full scale.", min=0)] = 0.0,
    depth_noise: Annotated[float, typer.Option(help="Standard deviation of depth noise in metres.", min=0)] = 0.0,
    distortion: Annotated[str, typer.Option(help="Lens distortion k1,k2,p1,p2,k3 as in OpenCV.")] = "0,0,0,0,0",
    seed: Annotated[int, typer.Option(help="Seed of the noise.", min=0)] = 0,
) -> None:
    """Render one camera image headless: colour, depth, ids, normals, calibration, annotations."""
    from ligature.cli.render import ANNOTATIONS
    from ligature.cli.render import render as run_render
    from ligature.render import ImageSensor
    from ligature.render.files import FORMATS

    if format not in FORMATS:
        raise typer.BadParameter(f"--format must be one of {', '.join(FORMATS)}, not '{format}'")
    kinds = [kind for kind in annotations.split(",") if kind]
    if not set(kinds) <= set(ANNOTATIONS):
        raise typer.BadParameter(f"--annotations must be any of {', '.join(ANNOTATIONS)}, not '{annotations}'")
    try:
        sensor = ImageSensor(exposure, noise, five_numbers(distortion), depth_noise, seed)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None
    console = Console(highlight=False, soft_wrap=True)
    raise typer.Exit(
        run_render(
            launch, indices(models), root or [], camera, out, seconds, (width, height), format, kinds, sensor, console
        )
    )


@app.command()
def decompose(
    mesh: Annotated[Path, typer.Argument(help="Mesh file: OBJ, STL or 3DS.")],
    out: Annotated[Optional[Path], typer.Option("-o", help="OBJ file to write.")] = None,  # noqa: UP045
    threshold: Annotated[
        float, typer.Option(help="Allowed concavity; smaller values fit more closely.", min=0.01, max=1)
    ] = 0.05,
    max_hulls: Annotated[int, typer.Option(help="Maximum number of hulls; -1 for no limit.")] = -1,
) -> None:
    """Decompose a mesh into convex parts, one material each: a collision mesh for ADF."""
    from ligature.cli.decompose import decompose as run_decompose

    raise typer.Exit(run_decompose(mesh, out, threshold, max_hulls, Console(highlight=False, soft_wrap=True)))


@app.command()
def fmt(
    files: Annotated[list[Path], typer.Argument(help="Scene files of any kind.")],
    check: Annotated[bool, typer.Option(help="Only report files that are not in canonical form.")] = False,
    lossy: Annotated[bool, typer.Option(help="Also write files that lose comments or unused blocks.")] = False,
) -> None:
    """Write scene files in canonical form: keys in the schema's order, numbers and vectors in one style."""
    from ligature.cli.documents import fmt as run_fmt

    raise typer.Exit(run_fmt(files, check, lossy, Console(highlight=False, soft_wrap=True)))


@app.command()
def diff(before: Path, after: Path) -> None:
    """List the differences of two scene files, object by object; exit status 1 when they differ."""
    from ligature.cli.documents import diff as run_diff

    raise typer.Exit(run_diff(before, after, Console(highlight=False, soft_wrap=True)))


@app.command()
def inertia(
    file: Annotated[Path, typer.Argument(help="A mesh, or a model file.")],
    density: Annotated[
        Optional[float],  # noqa: UP045
        typer.Option(help="In kg/m³, where no mass is stated; default: that of the tissue, else 1000.", min=1e-9),
    ] = None,
    mass: Annotated[Optional[float], typer.Option(help="In kg, instead of the density.", min=1e-12)] = None,  # noqa: UP045
) -> None:
    """Mass, centre of mass and principal moments of a mesh, or of the bodies of a model, as ADF keys."""
    from ligature.cli.documents import inertia as run_inertia

    raise typer.Exit(run_inertia(file, density, mass, Console(highlight=False, soft_wrap=True)))


@app.command()
def convert(
    source: Annotated[Path, typer.Argument(help="A URDF, SDF or MJCF file, or a model.")],
    out: Annotated[Path, typer.Option("-o", help="The model to write; of a model the .urdf or .sdf.")],
    namespace: Annotated[str, typer.Option(help="Namespace of the model.")] = "/ambf/env/",
) -> None:
    """Turn a URDF, SDF or MJCF robot into an ADF model, or a model into URDF or SDF; reports what is lost."""
    from ligature.cli.convert import convert as run_convert

    raise typer.Exit(run_convert(source, out, namespace, Console(highlight=False, soft_wrap=True)))


@app.command()
def poses(
    file: Launch,
    out: Annotated[Path, typer.Option(help="The npz file to write.")],
    models: Models = None,
    seconds: Annotated[float, typer.Option(help="Simulated seconds.", min=0.001)] = 2.0,
    rate: Annotated[float, typer.Option(help="Poses per simulated second.", min=1, max=1000)] = 60.0,
    root: Roots = None,
) -> None:
    """Simulate a scene and write the poses of all bodies over time, for editors that play them back."""
    from ligature.cli.poses import poses as run_poses

    raise typer.Exit(run_poses(file, indices(models), root or [], seconds, rate, out, Console(highlight=False)))


@app.command()
def demo(
    throws: Annotated[
        int, typer.Option(help="Number of throws, beginning at the first pair of holes.", min=1, max=4)
    ] = 2,
    tissue: Annotated[bool, typer.Option("--tissue", help="Suture soft tissue without holes instead.")] = False,
    knot: Annotated[bool, typer.Option("--knot", help="The same, and a square knot that holds the wound.")] = False,
    seed: Annotated[int, typer.Option(help="Seed of the needle's pose; 0 keeps the pose of the scene.", min=0)] = 0,
    out: Annotated[Path, typer.Option(help="Folder for pictures and an animation.")] = Path("out"),
    dataset: Annotated[Optional[Path], typer.Option(help="HDF5 dataset to write instead of pictures.")] = None,  # noqa: UP045
    episodes: Annotated[int, typer.Option(help="For a dataset: sutures, with one seed after the other.", min=1)] = 1,
    rate: Rate = None,
    size: Size = None,
    camera: Cameras = None,
) -> None:
    """Let two arms suture autonomously; prints the score, writes pictures."""
    from ligature.cli.demo import demo as run_demo

    if episodes != 1 and dataset is None:
        raise typer.BadParameter("--episodes describes a dataset; add '--dataset FILE.h5'")
    sampling, console = sampling_of(dataset, rate, size, camera), Console(highlight=False, soft_wrap=True)
    raise typer.Exit(run_demo(throws, seed, out, dataset, console, episodes, sampling, tissue, knot))


@app.command()
def evaluate(
    policy: Annotated[
        str,
        typer.Argument(help="expert, random, a network *.onnx, FILE.py:FUNCTION or MODULE:FUNCTION (its code runs)."),
    ],
    env: Annotated[str, typer.Option("--env", help="Task of the environment, such as reach, pick or hand_over.")],
    episodes: Annotated[int, typer.Option(help="Number of episodes.", min=1)] = 100,
    first_seed: Annotated[int, typer.Option(help="Seed of the first; train with seeds below it.", min=0)] = 1_000_000,
    max_steps: Annotated[
        Optional[int],  # noqa: UP045
        typer.Option(
            help="Actions until an episode is cut; by default as many as the registered environment allows.", min=1
        ),
    ] = None,
    action: Annotated[str, typer.Option(help="cartesian or joint.")] = "cartesian",
    observation: Annotated[str, typer.Option(help="state, image or both.")] = "state",
    randomise: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(help="YAML file of ranges from which every episode draws masses, lights, delays and more."),
    ] = None,
    out: Annotated[Optional[Path], typer.Option(help="Folder for evaluation.json and a page with pictures.")] = None,  # noqa: UP045
    pictures: Annotated[int, typer.Option(help="Episodes with pictures on the page.", min=0)] = 4,
    jobs: Annotated[int, typer.Option("-j", help="Processes.", min=1)] = 1,
) -> None:
    """Measure a policy in an environment: success, time, path and forces over held-out seeds, with intervals."""
    from ligature.cli.evaluate import evaluate as run_evaluate

    options = {"task": env, "action": action, "observation": observation}
    if randomise is not None:
        options["randomise"] = str(randomise)
    seeds = range(first_seed, first_seed + episodes)
    console = Console(highlight=False, soft_wrap=True)
    raise typer.Exit(run_evaluate(policy, options, seeds, max_steps, out, pictures, jobs, console))


@app.command()
def record(
    out: Annotated[Path, typer.Argument(help="The bag to write.")],
    exclude: Annotated[str, typer.Option(help="Regular expression of topics to exclude.")] = "",
    seconds: Annotated[float, typer.Option(help="Duration; 0 records until Ctrl-C.", min=0)] = 0.0,
    keep_free: Annotated[float, typer.Option(help="Gigabytes of disk space to keep free.", min=0)] = 1.0,
) -> None:
    """Record all ROS topics into a bag; the file gets its name when it is complete."""
    from ligature.cli.record import record as run_record

    raise typer.Exit(run_record(out, exclude, seconds, keep_free, Console(highlight=False, soft_wrap=True)))


@app.command()
def replay(
    file: Annotated[Path, typer.Argument(help="A record of 'ligature run --record', or a bag.")],
    scene: Annotated[Optional[Path], typer.Option(help="Launch file; replaces the recorded one.")] = None,  # noqa: UP045
    joints: Annotated[str, typer.Option(help="For a bag: play measured or setpoint joints instead of commands.")] = "",
    speed: Annotated[float, typer.Option("-s", help="For a bag: playback speed.", min=0.001)] = 1.0,
    dataset: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(
            help="HDF5 file to write pictures and motion to: of a record simulated again, or as a bag has them."
        ),
    ] = None,
    page: Annotated[
        bool, typer.Option("--page", help="For a record: show it on a web page, with a slider through its time.")
    ] = False,
    compare: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(help="For a page: another record of the scene, shown beside the first."),
    ] = None,
    at: CockpitAddress = None,
    rate: Rate = None,
    size: Size = None,
    camera: Cameras = None,
    task: Annotated[
        str,
        typer.Option(
            help="For a dataset: judge insertion or suture; by default the task of the run.", callback=task_name
        ),
    ] = "",
    success: Annotated[
        Optional[bool],  # noqa: UP045
        typer.Option("--success/--failure", help="For a dataset: the outcome of the run, if no task scores it."),
    ] = None,
    text: Annotated[str, typer.Option(help="For a dataset: the task as an instruction in words.")] = "",
    allow_plugins: AllowPlugins = False,
) -> None:
    """Simulate a recorded run again bit for bit, or play a bag into the running simulator."""
    if page or compare is not None:
        if dataset is not None or joints or task or text or success is not None:
            raise typer.BadParameter("--page shows records: it must be without --dataset, --joints, --task, --text")
        address = page_address(at)
        from ligature.cli.replay_page import show

        files = [file] if compare is None else [file, compare]
        raise typer.Exit(show(files, scene, address, Console(highlight=False, soft_wrap=True)))
    from ligature.cli.replay import replay as run_replay
    from ligature.cli.sampling import Sampled

    if joints not in ("", "measured", "setpoint"):
        raise typer.BadParameter(f"--joints must be 'measured' or 'setpoint', not '{joints}'")
    sampling = sampling_of(dataset, rate, size, camera)
    if dataset is None and (task or text or success is not None):
        raise typer.BadParameter("--task, --success and --text describe a dataset; add '--dataset FILE.h5'")
    sampled = None if dataset is None else Sampled(dataset, sampling, task, success, text)
    console = Console(highlight=False, soft_wrap=True)
    raise typer.Exit(run_replay(file, scene, joints, speed, console, sampled, allow_plugins))


@app.command()
def score(
    task: Annotated[str, typer.Argument(help="pose_estimation, insertion or suture.", callback=task_name)],
    file: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Argument(help="A bag or a run's record; by default the running simulator."),
    ] = None,
    scene: Annotated[Optional[Path], typer.Option(help="Launch file; replaces the one of a record.")] = None,  # noqa: UP045
    timeout: Annotated[float, typer.Option(help="Seconds to wait for a report.", min=1)] = 3600.0,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    patience: Annotated[Optional[float], typer.Option(hidden=True, min=1)] = None,  # noqa: UP045
) -> None:
    """Score a task; exit status 0 done, 1 not done, 2 not judged."""
    from ligature.cli.score import score as run_score

    if patience is not None:
        Console(stderr=True, highlight=False).print("'--patience' is deprecated; write '--timeout'", style="yellow")
    raise typer.Exit(
        run_score(
            task, file, scene, timeout if patience is None else patience, json, Console(highlight=False, soft_wrap=True)
        )
    )


@app.command()
def teleop(
    config: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Argument(help="Teleoperation file, or a launch file with input devices; omit it with --device."),
    ] = None,
    device: Annotated[
        Optional[list[str]],  # noqa: UP045
        typer.Option(help="Device without a file, for example touch, or touch=/arm1/ for its topics; repeatable."),
    ] = None,
    record: Annotated[Optional[Path], typer.Option(help="File to record all device input to.")] = None,  # noqa: UP045
    replay: Annotated[Optional[Path], typer.Option(help="Recorded file to play back instead of the devices.")] = None,  # noqa: UP045
    calibrate: Annotated[Optional[str], typer.Option(help="Device to calibrate.")] = None,  # noqa: UP045
    check: Annotated[
        bool, typer.Option("--check", help="Read the file, print which device controls which arm, and end.")
    ] = False,
    timeout: Annotated[
        Optional[float],  # noqa: UP045
        typer.Option(
            help="Seconds without a reading after which a follower holds; replaces the file's value (default 0.1)."
        ),
    ] = None,
    devices: Annotated[Optional[str], typer.Option("-i", help="Indices of a launch file's input devices.")] = None,  # noqa: UP045
    namespace: Annotated[
        str, typer.Option("--ns", help="Prefix of arms and console; replaces the file's, as 'ligature run --ns'.")
    ] = "",
) -> None:
    """Drive arms on ROS with input devices: master arms, haptic pens, controllers, the keyboard."""
    from ligature.cli.teleop import teleop as run_teleop

    console = Console(highlight=False, soft_wrap=True)
    raise typer.Exit(
        run_teleop(
            config, device or (), record, replay, calibrate, check, timeout, indices(devices), namespace, console
        )
    )


@dataset_app.command("info")
def dataset_info(file: DatasetFile) -> None:
    """List the episodes of a dataset, with outcome and phases."""
    from ligature.cli.dataset import info

    raise typer.Exit(info(file, Console(highlight=False, soft_wrap=True)))


@dataset_app.command("join")
def dataset_join(file: DatasetFile) -> None:
    """Make one file of a dataset whose writer was killed before it could."""
    from ligature.cli.dataset import join_episodes

    raise typer.Exit(join_episodes(file, Console(highlight=False, soft_wrap=True)))


@dataset_app.command("export")
def dataset_export(
    file: DatasetFile,
    out: Annotated[Path, typer.Argument(help="Output folder; it must not exist.")],
    format: Annotated[str, typer.Option(help="lerobot-3.0, or lerobot-2.1 as Open-H asks for.")] = "lerobot-3.0",
    codec: Annotated[str, typer.Option(help="Video codec: h264, or av1 (smaller files, slower).")] = "h264",
    license: Annotated[str, typer.Option(help="Licence of the data, for its card, for example cc-by-4.0.")] = "",
) -> None:
    """Write a dataset in a format of LeRobot: Parquet, videos, statistics, splits, a card."""
    from ligature.cli.dataset import export

    raise typer.Exit(export(file, out, format, codec, license, Console(highlight=False, soft_wrap=True)))


def main() -> None:
    """Entry point of the command."""
    app()
