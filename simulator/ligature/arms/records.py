"""Writes the state of all arms into the state record, in one compiled call. Radians, metres, N·m, N."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate, chain
from operator import attrgetter, is_
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import compiled
from ligature.model.state import ARM_DTYPE, ARM_JOINTS, StateRecord
from ligature.physics.bullet import real_at
from ligature.physics.contact_wrenches import ALWAYS_FELT
from ligature.physics.trees import Trees, open_trees, read_tree
from ligature.robots.arm import Arm
from ligature.robots.axes import Axes, Mode
from ligature.robots.chain import describe_tip
from ligature.robots.mtm_arm import MtmArm
from ligature.robots.psm_arm import PsmArm
from ligature.tables import opener, table_of

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

_FIRST_NUMBER = ARM_DTYPE.fields["measured_js"][1]  # type: ignore[index]
"""Where the numbers of an arm begin in its record, in bytes: all the same from the measured joints on."""

NUMBERS = (ARM_DTYPE.itemsize - _FIRST_NUMBER) // 8

GROUPS = 2
"""Groups of joints of an arm at most: its joints, and its jaw or gripper."""

INPUTS = 6 * (ARM_JOINTS + 1) + 6
"""Numbers of which those of the tip are made: joints, opening, wrench."""


UNKNOWN = (None,)
"""An outline that no arm has: its first part is never None."""

FROM_DRIVES = ALWAYS_FELT
"""The group of an arm whose wrench follows from its drives."""


class ArmArrays(NamedTuple):
    """What the arms of a scene report, and where it comes from: m arms."""

    joints: Integers  # (m,) number of joints
    fingers: Flags  # (m,) whether there is a jaw or a gripper
    own: Integers  # (m, 2) address of the state (3, n) of a group of joints, 0 where trees have it
    axes: Integers  # (m, 8, 2) axes of the trees: of each joint, then of the jaw; -1 for no second one
    aim: Integers  # (m, 2) address of the set-point (3, n) of a group
    aimless: Flags  # (m, 2) whether the set-point is where the joints are
    table: Array  # (m, 7, 6) of the kinematic chain
    modified: Flags  # (m,) whether the table is Craig's
    tip: Array  # (m, 4, 4) in the last link
    base: Array  # (m, 4, 4) in the reference frame
    absolute: Flags  # (m,) whether wrenches on the tip are in base axes
    wrench: Array  # (m, 6) on the tip, base axes
    fresh: Flags  # (m,) whether the numbers have to be made anew
    inputs: Array  # (m, INPUTS) of which they were made
    measured: Array  # (m, 3, 8) scratch: of joints and jaw
    setpoint: Array  # (m, 3, 8)
    numbers: Array  # (m, NUMBERS) in the order of the record


def _arrays(m: int) -> ArmArrays:
    z, whole, no = np.zeros, np.int64, np.bool_
    return ArmArrays(
        joints=z(m, whole), fingers=z(m, no), own=z((m, GROUPS), whole), axes=np.full((m, ARM_JOINTS + 1, 2), -1),
        aim=z((m, GROUPS), whole), aimless=z((m, GROUPS), no), table=z((m, ARM_JOINTS, 6)), modified=z(m, no),
        tip=z((m, 4, 4)), base=z((m, 4, 4)), absolute=z(m, no), wrench=z((m, 6)), fresh=np.ones(m, no),
        inputs=z((m, INPUTS)), measured=z((m, 3, ARM_JOINTS + 1)), setpoint=z((m, 3, ARM_JOINTS + 1)),
        numbers=z((m, NUMBERS)),
    )  # fmt: skip


_open_arms = opener(_arrays(1))


@compiled
def describe_arms(handle: int, tree_table: Integers, arm_table: Integers) -> bool:
    """Make the numbers of all arms whose joints, wrench or frames are others now; whether there are any."""
    trees, arms = open_trees(tree_table), _open_arms(arm_table)
    if handle != 0:
        for k in range(trees.uid.shape[0]):
            if not trees.read[k]:
                read_tree(handle, trees, k)
    found = False
    for m in range(arms.joints.shape[0]):
        n = arms.joints[m]
        _look(trees, arms, m, 0, 0, n)
        if arms.fingers[m]:
            _look(trees, arms, m, 1, ARM_JOINTS, 1)
        if not (_note_inputs(arms, m) or arms.fresh[m]):
            continue
        found, arms.fresh[m] = True, False
        numbers = arms.numbers[m]
        a, b = 6 * ARM_JOINTS, 6 * ARM_JOINTS + 6
        for c in range(3):
            numbers[a + c], numbers[a + 3 + c] = arms.measured[m, c, ARM_JOINTS], arms.setpoint[m, c, ARM_JOINTS]
        describe_tip(
            arms.table[m, :n], arms.modified[m], arms.tip[m], arms.base[m], arms.absolute[m],
            arms.measured[m, :, :n], arms.setpoint[m, :, :n], arms.wrench[m],
            numbers[:a].reshape((2, 3, ARM_JOINTS)), numbers[b : b + 28].reshape((4, 7)),
            numbers[b + 28 : b + 52].reshape((4, 6)),
            numbers[b + 52 : b + 52 + 12 * ARM_JOINTS].reshape((2, 6, ARM_JOINTS)),
        )  # fmt: skip
    return found


@compiled
def _look(trees: Trees, arms: ArmArrays, m: int, group: int, begin: int, n: int) -> None:
    """Record the ``n`` joints from ``begin`` on of one group of arm ``m``: measured values and set points."""
    own, aim = arms.own[m, group], arms.aim[m, group]
    for c in range(3):
        for j in range(n):
            if own != 0:
                value = real_at(own, c * n + j)
            else:
                one, other = arms.axes[m, begin + j, 0], arms.axes[m, begin + j, 1]
                value = trees.joints[c, one]
                if other >= 0:  # both fingers share the opening, and each bears the effort of the jaw
                    value = value + trees.joints[c, other]
                    value = 0.5 * value if c == 2 else value
            arms.measured[m, c, begin + j] = value
            at_rest = arms.aimless[m, group] and c < 2
            arms.setpoint[m, c, begin + j] = value if at_rest else real_at(aim, c * n + j)


@compiled
def _note_inputs(arms: ArmArrays, m: int) -> bool:
    """Whether joints or wrench of arm ``m`` changed since the last call."""
    changed, i, inputs = False, 0, arms.inputs[m]
    for c in range(3):
        for j in range(ARM_JOINTS + 1):
            measured, setpoint = arms.measured[m, c, j], arms.setpoint[m, c, j]
            changed = changed or inputs[i] != measured or inputs[i + 1] != setpoint
            inputs[i], inputs[i + 1] = measured, setpoint
            i += 2
    for a in range(6):
        changed = changed or inputs[i + a] != arms.wrench[m, a]
        inputs[i + a] = arms.wrench[m, a]
    return changed


class ArmRecords:
    """Keeps the part of the arms in a state record up to date.

    Assigning to a field of a record takes longer than all arithmetic here: the numbers are gathered in arrays, and only
    what changed is assigned.
    """

    def __init__(self, arms: Sequence[Arm]) -> None:
        self._arms = tuple(arms)
        self._arrays = _arrays(len(arms))
        self._table = table_of(self._arrays)
        self._groups = [(m, g, group) for m, arm in enumerate(arms) for g, group in enumerate(_groups(arm))]
        for m, g, group in self._groups:
            self._find(m, g, group)
        self._named = SimpleNamespace(**{f"arm{m}": arm for m, arm in enumerate(arms)}, none=None)
        names = [[f"arm{m}.{name}" for name in arm.outline()] for m, arm in enumerate(arms)]
        self._outline_of = attrgetter(*chain(*names), "none")
        self._outline: tuple[Any, ...] = ()
        ends = list(accumulate(map(len, names)))
        self._parts = [slice(end - len(own), end) for end, own in zip(ends, names, strict=True)]
        self._outlines: list[tuple[Any, ...]] = [UNKNOWN] * len(arms)
        self._bases = [arm.base_frame for arm in arms]
        self._groups_felt = [FROM_DRIVES] * len(arms)
        self._felt = [True] * len(arms)
        self._state: StateRecord | None = None
        self._numbers = np.zeros((0, NUMBERS))

    def _find(self, m: int, g: int, group: Axes) -> None:
        """Store the addresses and indices of the joints of a group."""
        arrays, begin = self._arrays, g * ARM_JOINTS
        state, axes = group.plant.source()
        arrays.own[m, g] = 0 if state is None else state.ctypes.data
        arrays.axes[m, begin : begin + len(axes)] = axes
        arrays.aim[m, g] = group.setpoint.ctypes.data
        if g == 0:
            arrays.joints[m] = group.n
        else:
            arrays.fingers[m] = True

    def stale(self, state: StateRecord, felt: int) -> list[int]:
        """The arms to `look` at: those that feel something, and all if commands changed any, which is found at once."""
        if state is not self._state:
            self._attach(state)
        before, self._outline = self._outline, self._outline_of(self._named)
        if len(before) != len(self._outline) or not all(map(is_, before, self._outline)):
            return list(range(len(self._arms)))
        return [m for m, group in enumerate(self._groups_felt) if group & felt or self._felt[m]]

    def look(self, m: int, felt: int) -> None:
        """Take down what commands and contacts changed of arm ``m``, for `write`; ``felt`` is that of wrenches."""
        outline = self._outline[self._parts[m]]
        if not all(map(is_, outline, self._outlines[m])):
            self._renew(m, self._arms[m])
            self._outlines[m] = outline
        if self._groups_felt[m] & felt:
            self._arrays.wrench[m], self._felt[m] = self._arms[m].spatial_measured_cf(), True
        elif self._felt[m]:
            self._arrays.wrench[m], self._felt[m] = 0.0, False

    def write(self, handle: int, trees: Integers) -> bool:
        """Write numbers that have changed, and return whether any have; the arguments are those of `Motions`."""
        found = bool(describe_arms(handle, trees, self._table))
        if found:
            self._numbers[:] = self._arrays.numbers
        return found

    def _attach(self, state: StateRecord) -> None:
        """Write to another record from now on."""
        self._state = state
        records = state["arm"][0]
        fields = np.asarray(records).view(np.uint8).reshape(len(self._arms), ARM_DTYPE.itemsize)
        self._numbers = fields[:, _FIRST_NUMBER:].view(np.float64)
        self._outline, self._outlines = (), [UNKNOWN] * len(self._arms)

    def _renew(self, m: int, arm: Arm) -> None:
        """Update modes, kinematics and frames of an arm, and write its status."""
        arrays = self._arrays
        for number, g, group in self._groups:
            if number == m:
                arrays.aimless[m, g] = group.mode in (Mode.OFF, Mode.EFFORT)
        table, arrays.modified[m], arrays.tip[m] = arm.kinematics.tables()
        arrays.table[m, : len(table)] = table
        arrays.base[m], arrays.absolute[m], arrays.fresh[m] = arm.base_frame, arm.cf_orientation_absolute, True
        self._bases[m] = arm.base_frame  # kept, so that no other gets its identity
        self._groups_felt[m] = getattr(arm.tip_wrench, "group", FROM_DRIVES)
        assert self._state is not None
        _write_status(self._state["arm"][0][m], arm)


def _groups(arm: Arm) -> tuple[Axes, ...]:
    """The joints of an arm, and its jaw or gripper."""
    if isinstance(arm, MtmArm):
        return arm.joints, arm.gripper
    if isinstance(arm, PsmArm) and arm.jaw is not None:
        return arm.joints, arm.jaw.axes
    return (arm.joints,)


def _write_status(record: Any, arm: Arm) -> None:
    """Write the fields that change seldom."""
    state, axes = arm.operating_state, arm.joints
    record["operating"], record["homed"], record["busy"] = state.state, state.is_homed, state.is_busy
    if isinstance(arm, PsmArm):
        record["tool"], record["tool_present"] = arm.kinematics.instrument.id, arm.tool_present
    record["ratio"], record["reference"] = (axes.ratio_v, axes.ratio_a), arm.reference.encode("utf-8")[:64]
