"""Files of strangers that are no scenes: records, bags, recordings of devices, teleoperation, robots, pictures.

Each reader is given mutants of small valid files. It must end in time and within the memory of a worker, with what it
reads or with an error of its own kind that names the file; whatever else it raises, a user would see as a traceback.
"""

from __future__ import annotations

import io
import json
import random
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from tests.fuzz import learning
from tests.fuzz.mutate import mutate

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Reader:
    """A kind of file: a valid one, its name, what reads it, and whether it is text."""

    kind: str
    name: str
    seed: Callable[[], bytes]
    read: Callable[[Path], Any]
    text: bool = False
    named: bool = True
    """Whether errors name the file; where they do not, the caller does."""

    change: Callable[[bytes, random.Random], bytes] | None = None
    """What makes a mutant; by default bytes are changed."""


class Refused(Exception):
    """An error of the kind that a user is shown."""


# --- records ----------------------------------------------------------------------------------


def record_bytes() -> bytes:
    """A record of three commands."""
    import tempfile

    from ligature.bus.record import Header, RecordWriter
    from ligature.cli.options import RunOptions
    from ligature.model.commands import BodyCommand, CommandType, Reset
    from ligature.robots.commands import ServoJp

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "a.record")
        writer = RecordWriter(path, Header(RunOptions("scene.yaml").to_text(), "ab" * 32))
        writer.write(1, ServoJp(0, (0.1, 0.2, 0.3)))
        writer.write(1, Reset(True))
        writer.write(7, BodyCommand(3, CommandType.FORCE, (1.0, 0.0, 1e-300, 0.0, 0.0, 0.0)))
        writer.finish(9, "cd" * 32)
        return path.read_bytes()


def sealed(data: bytes) -> bytes:
    """A record with the digest that fits what it holds, as somebody hostile writes it."""
    import hashlib

    return data[:-16] + hashlib.blake2b(data[:-16], digest_size=16).digest()


def sealed_mutant(data: bytes, rng: random.Random) -> bytes:
    """A changed record with the digest that fits."""
    return sealed(mutate(data, rng, binary=True))


def read_record(path: Path) -> None:
    from ligature.bus.record import Record, RecordError
    from ligature.cli.options import RunOptions

    try:
        record = Record.read(path)
        assert record.updates <= 10**9
        options = RunOptions.from_text(record.header.options)
        assert isinstance(options.scene, str) and options.rate >= 1.0
    except (RecordError, ValueError) as error:
        raise Refused(str(error)) from error


# --- bags -------------------------------------------------------------------------------------


@lru_cache(maxsize=2)
def bag_bytes(compression: str = "none") -> bytes:
    """A bag of poses and commands."""
    import tempfile

    import rosbag
    import rospy
    from ambf_msgs.msg import RigidBodyState
    from geometry_msgs.msg import PoseStamped
    from sensor_msgs.msg import JointState

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "a.bag")
        with rosbag.Bag(str(path), "w", compression=compression) as bag:
            for number in range(5):
                stamp = rospy.Time(10, number * 1000)
                bag.write("/ambf/env/Needle/State", RigidBodyState(sim_step=number), stamp)
                bag.write("/PSM1/servo_jp", JointState(position=[0.1] * 6), stamp)
                bag.write("/pose", PoseStamped(), stamp)
        return path.read_bytes()


def read_bag(path: Path) -> None:
    from ligature.ros.bags import BagError, messages, opened, topics

    try:
        with opened(path) as bag:
            for _ in messages(bag, sorted(topics(bag))):
                pass
    except BagError as error:
        raise Refused(str(error)) from error


# --- teleoperation ----------------------------------------------------------------------------

INPUT = "".join(
    json.dumps(row) + "\n"
    for row in (
        {"t": 0.0, "event": "enable", "value": True},
        {"t": 0.01, "device": "pen", "pose": [0, 0, 0, 0, 0, 0, 1], "grip": 0.5, "buttons": {"grey": False}},
        {"t": 0.02, "event": "pair", "value": ["MTMR", "PSM1"]},
    )
)

TELEOP = """camera: ECM
prefix: /
settings: {scale: 0.2, align: true, workspace: [[-0.1, -0.1, 0.02], [0.1, 0.1, 0.25]], jaw: [-0.35, 1.05]}
devices:
  pen: {kind: touch, topic: /arm1/, buttons: {grey: clutch, white: close}, force: {gain: 0.5, limit: 2.0}}
  left: {kind: hydra, paddle: left, buttons: {bumper: clutch, "1": next}}
pairs: {pen: [PSM1, PSM2], left: [PSM2]}
"""


def read_input(path: Path) -> None:
    from ligature.teleop.record import Replay

    try:
        replay = Replay(path)
        for _ in replay.due(0.0):
            pass
        for _ in replay.due(1.0):
            pass
    except ValueError as error:
        raise Refused(str(error)) from error


def read_teleop(path: Path) -> None:
    from ligature.cli.teleop import teleop
    from rich.console import Console

    console = Console(file=io.StringIO(), width=10_000)
    if teleop(path, (), None, None, None, True, None, None, "", console) != 0:
        raise Refused(console.file.getvalue())  # type: ignore[attr-defined]


def read_devices(path: Path) -> None:
    """The input devices of a launch file, which stands beside them."""
    from tests.fuzz.seeds import write_scene

    devices = path.read_bytes()
    folder = path.parent / "devices"
    if not folder.exists():
        folder.mkdir()
        write_scene(folder)
    (folder / path.name).write_bytes(devices)
    read_teleop(folder / "launch.yaml")


def devices_text() -> bytes:
    return (ROOT / "tests" / "fuzz" / "scene" / "devices.yaml").read_bytes()


# --- robots -----------------------------------------------------------------------------------

URDF = """<?xml version="1.0"?>
<robot name="arm">
  <link name="base"><visual><geometry><box size="0.1 0.2 0.3"/></geometry></visual></link>
  <link name="tip">
    <inertial><origin xyz="0 0 0.1" rpy="0 0.1 0"/><mass value="0.2"/>
      <inertia ixx="1e-3" ixy="0" ixz="0" iyy="1e-3" iyz="0" izz="1e-3"/></inertial>
    <collision><origin xyz="0 0 0.1"/><geometry><cylinder radius="0.01" length="0.2"/></geometry></collision>
    <visual><geometry><mesh filename="part.obj" scale="1 1 1"/></geometry></visual>
  </link>
  <joint name="turn" type="revolute">
    <parent link="base"/><child link="tip"/><origin xyz="0 0 0.2" rpy="0 0 0.3"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="5" velocity="2"/>
  </joint>
</robot>
"""

SDF = """<?xml version="1.0"?>
<sdf version="1.7"><model name="arm">
  <link name="base"><pose>0 0 0.1 0 0 0.3</pose><inertial><mass>2</mass></inertial>
    <visual name="v"><geometry><box><size>0.1 0.2 0.3</size></box></geometry></visual></link>
  <link name="tip"><pose relative_to="turn">0 0 0.1 0 0.1 0</pose>
    <inertial><pose>0 0 0.1 0 0 0</pose><mass>0.2</mass><inertia><ixx>1e-3</ixx><iyy>1e-3</iyy><izz>1e-3</izz></inertia></inertial>
    <collision name="c"><geometry><cylinder><radius>0.01</radius><length>0.2</length></cylinder></geometry></collision></link>
  <joint name="turn" type="revolute"><pose relative_to="base">0 0 0.2 0 0 0</pose><parent>base</parent><child>tip</child>
    <axis><xyz expressed_in="__model__">0 1 0</xyz><limit><lower>-1</lower><upper>1</upper></limit></axis></joint>
</model></sdf>
"""

MJCF = """<mujoco model="arm">
  <compiler angle="radian"/>
  <asset><material name="red" rgba="1 0 0 1"/></asset>
  <worldbody>
    <body name="base" pos="0 0 0.1">
      <geom type="box" size="0.1 0.1 0.1" material="red"/>
      <body name="tip" pos="0 0 0.2">
        <joint name="turn" type="hinge" axis="0 1 0" range="-1 1"/>
        <geom type="capsule" fromto="0 0 0 0 0 0.2" size="0.02"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def convert_robot(path: Path) -> None:
    from ligature.cli.convert import convert
    from rich.console import Console

    out = path.parent / "out" / "robot.yaml"
    out.parent.mkdir(exist_ok=True)
    console = Console(file=io.StringIO(), width=10_000)
    if convert(path, out, "/ambf/env/", console) != 0:
        raise Refused(console.file.getvalue())  # type: ignore[attr-defined]


# --- pictures ---------------------------------------------------------------------------------


def picture_bytes(format: str) -> bytes:
    from PIL import Image

    file = io.BytesIO()
    picture = Image.new("RGB", (17, 9))
    picture.putdata([(13 * k % 256, 7 * k % 256, 3 * k % 256) for k in range(17 * 9)])
    picture.save(file, format)
    return file.getvalue()


def _chunk(kind: bytes, content: bytes) -> bytes:
    """A chunk of a PNG."""
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


def png_head(width: int, height: int) -> bytes:
    """The first 33 bytes of a PNG of grey pixels."""
    return b"\x89PNG\r\n\x1a\n" + _chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0))


def png_of(width: int, height: int) -> bytes:
    """A PNG of black pixels, however many."""
    packer = zlib.compressobj(9)
    content = b"".join(packer.compress(b"\0" * (1 + width)) for _ in range(height)) + packer.flush()
    return png_head(width, height) + _chunk(b"IDAT", content) + _chunk(b"IEND", b"")


def read_any_picture(path: Path) -> None:
    from ligature.model.pictures import MOST_PIXELS, PictureError, read_picture

    try:
        picture = read_picture(path)
        assert picture.size[0] * picture.size[1] <= MOST_PIXELS
        picture.convert("RGBA")
    except PictureError as error:
        raise Refused(str(error)) from error


READERS = (
    Reader("record", "a.record", record_bytes, read_record, named=False),
    Reader("sealed record", "b.record", record_bytes, read_record, named=False, change=sealed_mutant),
    Reader("bag", "a.bag", bag_bytes, read_bag),
    Reader("packed bag", "b.bag", lambda: bag_bytes("bz2"), read_bag),
    Reader("recorded input", "a.jsonl", INPUT.encode, read_input, text=True),
    Reader("teleoperation", "teleop.yaml", TELEOP.encode, read_teleop, text=True),
    Reader("URDF", "robot.urdf", URDF.encode, convert_robot, text=True),
    Reader("SDF", "robot.sdf", SDF.encode, convert_robot, text=True),
    Reader("MJCF", "robot.xml", MJCF.encode, convert_robot, text=True),
    *(
        Reader(
            format, f"a.{format.lower()}", lambda format=format: picture_bytes(format), read_any_picture, named=False
        )
        for format in ("PNG", "JPEG", "BMP", "TGA", "TIFF", "GIF", "PPM", "WEBP")
    ),
    Reader("input devices", "devices.yaml", devices_text, read_devices, text=True, named=False),
    Reader("dataset", "a.h5", learning.dataset_bytes, learning.read_dataset),
    Reader("rebuilt dataset", "b.h5", learning.dataset_bytes, learning.read_dataset, change=learning.rebuilt),
    Reader("ranges", "ranges.yaml", learning.RANGES.encode, learning.read_ranges, text=True),
    Reader("network", "policy.onnx", learning.network_bytes, learning.read_network, named=False),
)


@lru_cache
def _seed(reader: Reader) -> bytes:
    return reader.seed()


def mutant(number: int) -> tuple[Reader, bytes]:
    """The reader and the content of a mutant."""
    reader, rng = READERS[number % len(READERS)], random.Random(number)
    if reader.change is not None:
        return reader, reader.change(_seed(reader), rng)
    return reader, mutate(_seed(reader), rng, not reader.text, reader.name.endswith(".yaml"))


def attempt(reader: Reader, path: Path) -> str:
    """Read a file; ``clean`` or ``refused``. Raises AssertionError for an error without words or without the file."""
    try:
        reader.read(path)
    except Refused as error:
        text = str(error)
        assert text.strip(), "refused without a word"
        assert "Traceback" not in text
        assert not reader.named or path.name in text, f"the error does not name the file: {text[:200]}"
        return "refused"
    return "clean"


def try_reader(folder: Path, number: int, _: object) -> str:
    """Put a mutant into a folder and read it."""
    reader, data = mutant(number)
    if not (folder / "part.obj").exists():
        from tests.fuzz.seeds import OBJ

        (folder / "part.obj").write_text(OBJ)
    path = folder / reader.name
    path.write_bytes(data)
    return attempt(reader, path)


def read_seeds(folder: Path) -> None:
    """Read every valid file once: what readers import and compile is loaded then."""
    from tests.fuzz.seeds import OBJ

    (folder / "part.obj").write_text(OBJ)
    for reader in READERS:
        path = folder / reader.name
        path.write_bytes(_seed(reader))
        attempt(reader, path)
