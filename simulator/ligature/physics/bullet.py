"""Bullet's own C interface inside PyBullet, for compiled code: no Python object for each joint of each tick.

PyBullet's functions make a tuple for each joint that they read and parse a list for each that they set, and whoever
calls them does as much again: a third of a tick. Compiled code calls the functions beneath, with the same arguments in
the same order, so that Bullet gets the same numbers. Handles of Bullet are whole numbers here: addresses.

PyBullet lists its clients at an address that it tells nobody. The first `connect` finds it: the word of PyBullet's
memory that holds a client afterwards and was 0 before. Where it is not found, the handle is 0, the callers use
PyBullet, and the next `connect` looks again.

Bullet makes a box for every link, one without a shape too, and compares each with all others in every tick.
`exclude_void` takes those that can never touch anything out of that; Bullet skips boxes without an owner.

Bullet passes over a multibody whose colliders sleep: no acceleration, no motor, no limit. It puts nothing to sleep by
itself here; `let_sleep` does so for one tick, and Bullet wakes what touches something that moves within that tick.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
from collections.abc import Iterator
from typing import Any

import llvmlite.binding
import numpy as np
import pybullet
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from ligature.kernels import inlined

Integers = NDArray[np.int64]

VELOCITY_CONTROL, TORQUE_CONTROL = int(pybullet.VELOCITY_CONTROL), int(pybullet.TORQUE_CONTROL)

WORLD_FRAME = int(pybullet.WORLD_FRAME)

VELOCITY_GAIN = 1.0
"""Gain of a velocity motor, which PyBullet sets unless told otherwise."""

_address, _int, _real = types.intp, types.int32, types.float64

_FUNCTIONS = {
    "b3SubmitClientCommandAndWaitStatus": _address(_address, _address),
    "b3InitStepSimulationCommand": _address(_address),
    "b3RequestActualStateCommandInit": _address(_address, _int),
    "b3GetStatusActualState2": _int(*([_address] * 13)),
    "b3JointControlCommandInit2": _address(_address, _int, _int),
    "b3JointControlSetDesiredVelocity": _int(_address, _int, _real),
    "b3JointControlSetKd": _int(_address, _int, _real),
    "b3JointControlSetMaximumForce": _int(_address, _int, _real),
    "b3JointControlSetDesiredForceTorque": _int(_address, _int, _real),
    "b3CreatePoseCommandInit": _address(_address, _int),
    "b3CreatePoseCommandSetBasePosition": _int(_address, _real, _real, _real),
    "b3CreatePoseCommandSetBaseOrientation": _int(_address, _real, _real, _real, _real),
    "b3CreatePoseCommandSetJointPositions": _int(_address, _int, _address),
    "b3CreatePoseCommandSetJointVelocities": _int(_address, _address, _int, _address),
    "b3CreatePoseCommandSetBaseLinearVelocity": _int(_address, _address),
    "b3CreatePoseCommandSetBaseAngularVelocity": _int(_address, _address),
    "b3ApplyExternalForceCommandInit": _address(_address),
    "b3ApplyExternalForce": types.void(_address, _int, _int, _address, _address, _int),
    "b3ApplyExternalTorque": types.void(_address, _int, _int, _address, _int),
    "b3InitRequestContactPointInformation": _address(_address),
    "b3GetContactPointInformation": types.void(_address, _address),
}  # fmt: skip
"""What compiled code calls, by its name in Bullet's header `PhysicsClientC_API.h`."""

_file = os.path.realpath(pybullet.__file__)
_library = ctypes.CDLL(_file)


def _external(name: str) -> Any:
    """A function of Bullet for compiled code."""
    with contextlib.suppress(AttributeError):  # then no handle is found, and nobody calls it
        llvmlite.binding.add_symbol(name, ctypes.cast(getattr(_library, name), ctypes.c_void_p).value)
    return types.ExternalFunction(name, _FUNCTIONS[name])


submit = _external("b3SubmitClientCommandAndWaitStatus")
init_step = _external("b3InitStepSimulationCommand")
init_state_request = _external("b3RequestActualStateCommandInit")
get_state = _external("b3GetStatusActualState2")
init_motors = _external("b3JointControlCommandInit2")
set_velocity = _external("b3JointControlSetDesiredVelocity")
set_gain = _external("b3JointControlSetKd")
set_strength = _external("b3JointControlSetMaximumForce")
set_effort = _external("b3JointControlSetDesiredForceTorque")
init_motion = _external("b3CreatePoseCommandInit")
set_position = _external("b3CreatePoseCommandSetBasePosition")
set_orientation = _external("b3CreatePoseCommandSetBaseOrientation")
set_joint_positions = _external("b3CreatePoseCommandSetJointPositions")
set_joint_velocities = _external("b3CreatePoseCommandSetJointVelocities")
set_linear_velocity = _external("b3CreatePoseCommandSetBaseLinearVelocity")
set_angular_velocity = _external("b3CreatePoseCommandSetBaseAngularVelocity")
init_forces = _external("b3ApplyExternalForceCommandInit")
add_force = _external("b3ApplyExternalForce")
add_torque = _external("b3ApplyExternalTorque")
init_contact_request = _external("b3InitRequestContactPointInformation")
get_contacts = _external("b3GetContactPointInformation")


@intrinsic  # type: ignore[misc]
def real_at(typing_context: Any, address: Any, index: Any) -> Any:
    """The real number at ``index`` of those at an address."""

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        numbers = builder.inttoptr(arguments[0], ir.PointerType(ir.DoubleType()))
        return builder.load(builder.gep(numbers, [arguments[1]]))

    return types.float64(types.intp, types.intp), build


@intrinsic  # type: ignore[misc]
def whole_at(typing_context: Any, address: Any) -> Any:
    """The whole number of 32 bits at an address."""

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        number = builder.load(builder.inttoptr(arguments[0], ir.PointerType(ir.IntType(32))))
        return builder.sext(number, ir.IntType(64))

    return types.int64(types.intp), build


@intrinsic  # type: ignore[misc]
def word_at(typing_context: Any, address: Any) -> Any:
    """The whole number of 64 bits at an address."""

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.load(builder.inttoptr(arguments[0], ir.PointerType(ir.IntType(64))))

    return types.int64(types.intp), build


@intrinsic  # type: ignore[misc]
def put_word(typing_context: Any, address: Any, value: Any) -> Any:
    """Put the word of 64 bits ``value`` at an address."""

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place = builder.inttoptr(arguments[0], ir.PointerType(ir.IntType(64)))
        builder.store(arguments[1], place)
        return context.get_dummy_value()

    return types.void(types.intp, types.int64), build


# --- handles ------------------------------------------------------------------------------------


def connect() -> tuple[int, int]:
    """A new client in this process: PyBullet's number of it, and its handle for compiled code; 0 is none."""
    missing = [name for name in _FUNCTIONS if not hasattr(_library, name)]
    if _Clients.begin is None and not missing:
        return _connect_watched()
    client = int(pybullet.connect(pybullet.DIRECT))
    return client, 0 if missing else _handle(client)


class _Clients:
    """Where PyBullet lists its clients, and what is in each of them.

    Attributes
    ----------
    begin
        Address of the first in the list; None until it is found, 0 where handles are not to be used.
    kind
        The first word of every client: the address of its class's functions; None until it is known.
    """

    begin: int | None = None
    kind: int | None = None


def _connect_watched() -> tuple[int, int]:
    """Connect, and find out where PyBullet notes that."""
    segments = list(_segments())
    before = [words.copy() for words in segments]
    client = int(pybullet.connect(pybullet.DIRECT))
    found = [
        words.ctypes.data + 8 * int(k)
        for words, old in zip(segments, before, strict=True)
        for k in np.flatnonzero((words != old) & (old == 0))
        if _is_client(int(words[k]))
    ]
    if len(found) == 1:
        _Clients.begin = found[0] - 8 * client
    return client, _handle(client)


def _handle(client: int) -> int:
    """The handle of a client, 0 where it is not known."""
    if not _Clients.begin:
        return 0
    handle = ctypes.c_int64.from_address(_Clients.begin + 8 * client).value
    return handle if _is_client(handle) else 0


# --- boxes --------------------------------------------------------------------------------------

_TO_BROAD_PHASE = (8, 0x812628, 8, 0x1060)
"""Where in a client of PyBullet 3.2.7, and in each object that is found there, the address of the next one is: what
the client keeps, the processor of its commands, what that keeps, and the broad phase, `btSimpleBroadphase`."""

_MOST_BOXES = 65536
"""Boxes for which PyBullet gives its broad phase room."""

_BOX = np.dtype(
    {
        "names": ["owner", "group", "mask", "number"],
        "formats": [np.int64, np.int32, np.int32, np.int32],
        "offsets": [0, 8, 12, 16],
        "itemsize": 96,
    }
)
"""A box of Bullet, `btSimpleBroadphaseProxy`; the k-th has the number k + 2."""


LAST_BOX, FIRST_BOX, PAIRS, BOX_BYTES = 16, 24, 48, 96
"""Where in the broad phase the place of the last box, the address of the first and that of all pairs are, in bytes."""

PAIR_COUNT, FIRST_PAIR, PAIR_BYTES = 12, 24, 32
"""Where among pairs their number and the address of the first are; a pair begins with the addresses of its boxes."""

_COLLIDER_BOX, _COLLIDER_FLAGS, _COLLIDER_STATE = 376, 408, 424
"""Where in what owns a box, a `btMultiBodyLinkCollider`, address of the box, flags and state of sleep are."""

_STANDS = 1
"""Bullet's `CF_STATIC_OBJECT`: it never wakes such a collider."""

_WAKES, _SLEEPS = 1, 2
"""Bullet's `ACTIVE_TAG` and `ISLAND_SLEEPING`."""

_MARK = 0x3FF0000000000000
"""1.0, as a word: put after the state, where Bullet counts how long a collider rests and puts 0 as it wakes it."""


def find_boxes(handle: int) -> int:
    """Address of the broad phase of a client that compares all pairs of boxes.

    It is 0 where the client has another broad phase, or where this version of PyBullet keeps it elsewhere.
    """
    at: int | None = handle
    for offset in _TO_BROAD_PHASE:
        at = _word(at + offset) if at else None
    if not at or any(_word(at + 8 * k) is None for k in range(4)):
        return 0
    count, most, last, first = _head(at)
    known = most == _MOST_BOXES and 0 < count <= most and last < most and _word(first) is not None
    if not known or _word(first + _BOX.itemsize * _MOST_BOXES - 8) is None:
        return 0
    boxes = _boxes(at)
    return at if (boxes["number"] == np.arange(len(boxes)) + 2).all() else 0


def exclude_void(boxes: int) -> int:
    """Have Bullet no longer compare the boxes with neither group nor mask; returns how many there are.

    ``boxes`` is an address from `find_boxes`. Bullet compares a box again as soon as its group or mask is set.
    """
    if not boxes:
        return 0
    found = _boxes(boxes)
    void = (found["group"] == 0) & (found["mask"] == 0)
    found["owner"][void] = 0
    return int(void.sum())


def find_sleepers(boxes: int) -> Integers:
    """For each box of a broad phase, in order, where Bullet keeps whether its owner sleeps.

    It is 0 for an owner that stands. ``boxes`` is an address from `find_boxes`; all boxes still have their owners.
    There is none where this version of PyBullet keeps it elsewhere.
    """
    none = np.zeros(0, dtype=np.int64)
    if not boxes:
        return none
    found = _boxes(boxes)
    for k, owner in enumerate(found["owner"].tolist()):
        box = found.ctypes.data + _BOX.itemsize * k
        words = [_word(owner + at) for at in (_COLLIDER_BOX, _COLLIDER_STATE, _COLLIDER_STATE + 8)]
        if not owner or words != [box, _WAKES, 0]:
            return none
    stands = [bool((_word(owner + _COLLIDER_FLAGS) or 0) & _STANDS) for owner in found["owner"].tolist()]
    return np.where(stands, 0, found["owner"] + _COLLIDER_STATE)


def find_owners(boxes: int) -> tuple[Integers, Integers]:
    """Addresses (n,) of all boxes of a broad phase, in order, and of their owners; 0 for those that have none.

    There are none where this version of PyBullet keeps its pairs elsewhere.
    """
    none = np.zeros(0, dtype=np.int64)
    pairs = _word(boxes + PAIRS) if boxes else None
    if not pairs or (count := _word(pairs + PAIR_COUNT - 4)) is None or (room := _word(pairs + 16)) is None:
        return none, none
    count, room = count >> 32, room & 0xFFFFFFFF
    if count > room or (count and _word((_word(pairs + FIRST_PAIR) or 0) + PAIR_BYTES * count - 8) is None):
        return none, none
    found = _boxes(boxes)
    at = found.ctypes.data + BOX_BYTES * np.arange(len(found))
    known = [_word(_word(pairs + FIRST_PAIR) + PAIR_BYTES * j + 8 * side) for j in range(count) for side in range(2)]  # type: ignore[operator]
    return (at, found["owner"].copy()) if set(known) <= set(at.tolist()) else (none, none)


@inlined
def let_sleep(sleeper: int) -> None:
    """Have what owns a box sleep in the coming tick, unless it touches what moves; see `slept`."""
    put_word(sleeper, _SLEEPS)
    put_word(sleeper + 8, _MARK)


@inlined
def slept(sleeper: int) -> bool:
    """Whether what was to sleep in this tick did so."""
    return real_at(sleeper + 8, 0) == 1.0


def _boxes(at: int) -> NDArray[Any]:
    """The boxes of a broad phase; those that are free have no owner."""
    count, _, last, first = _head(at)
    size = max(count, last + 1) * _BOX.itemsize
    return np.ctypeslib.as_array((ctypes.c_uint8 * size).from_address(first)).view(_BOX)


def _head(at: int) -> tuple[int, int, int, int]:
    """Boxes in use, room, place of the last and address of the first in a broad phase."""
    count, most, last = (ctypes.c_int32 * 3).from_address(at + 8)
    return count, most, last, ctypes.c_int64.from_address(at + 24).value


# --- memory -------------------------------------------------------------------------------------


def _segments() -> Iterator[Integers]:
    """The words of the library's writable segments; zero-initialised ones have no file name and follow the others."""
    end = 0
    with contextlib.suppress(OSError), open("/proc/self/maps") as lines:
        for line in lines:
            span, access, *_, path = (*line.split(maxsplit=5), "")[:6]
            low, high = (int(number, 16) for number in span.split("-"))
            if access.startswith("rw") and (path.strip() == _file or (low == end and not path.strip())):
                end = high
                yield np.ctypeslib.as_array((ctypes.c_int64 * ((high - low) // 8)).from_address(low))


def _is_client(address: int) -> bool:
    """Whether there is an object of the client class at an address, which may be invalid."""
    if _Clients.kind is None:
        _Clients.kind = _class_of_clients()
    return address % 8 == 0 and address > 0 and _Clients.kind is not None and _word(address) == _Clients.kind


def _word(address: int) -> int | None:
    """The word at an address, None where there is no memory."""
    try:
        with open("/proc/self/mem", "rb", buffering=0) as own:
            own.seek(address)
            return int.from_bytes(own.read(8), "little")
    except (OSError, ValueError, OverflowError):
        return None


def _class_of_clients() -> int | None:
    """The first word of a client that is made for that; None where memory cannot be read, as with no file left."""
    make, end = _library.b3ConnectPhysicsDirect, _library.b3DisconnectSharedMemory
    make.restype, end.argtypes = ctypes.c_void_p, [ctypes.c_void_p]
    example = make()
    first = _word(example)
    end(example)
    return first
