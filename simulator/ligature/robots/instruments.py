"""The instruments of the da Vinci Research Kit as data: lengths, joint limits, names.

Metres and radians. Source: ``share/tool`` of the dVRK's sawIntuitiveResearchKit 2.4.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from ligature.robots.chain import Array

STANDARD_TIP = ((0.0, -1.0, 0.0), (0.0, 0.0, 1.0), (-1.0, 0.0, 0.0))
"""Rotation from the wrist yaw link to the tip of most instruments."""


class InstrumentLengths(NamedTuple):
    """``shaft`` from the insertion carriage to the wrist pitch axis, ``wrist`` from there to the wrist yaw axis."""

    shaft: float
    wrist: float


@dataclass(frozen=True, eq=False)
class Instrument:
    """One instrument with a wrist of three joints: roll, wrist pitch, wrist yaw.

    ``lower`` and ``upper`` (3,) are the limits of those joints, ``jaw`` (2,) the lowest and highest jaw angle,
    ``R_wrist_tip`` (3, 3) the rotation of the tip in the wrist yaw link. ``generation`` is the kind of manipulator
    that it was made for, "Classic" or "S".
    """

    name: str
    id: int
    generation: str
    lengths: InstrumentLengths
    lower: Array
    upper: Array
    jaw: Array
    R_wrist_tip: Array

    @property
    def type(self) -> str:
        """Name and number as CRTK's ``tool_type`` has them, for example ``LARGE_NEEDLE_DRIVER:420006``."""
        return f"{self.name}:{self.id}"


class _Wrist(NamedTuple):
    """Limits, symmetric about zero."""

    roll: float
    pitch: float
    yaw: float


_A = _Wrist(4.53786, 1.39626, 1.39626)
_B = _Wrist(4.4506, 1.2217, 1.39626)
_BIPOLAR = _Wrist(4.4506, 1.2217, 1.5708)
_CAUTERY = _Wrist(4.53786, 1.39626, 1.4835)
_CLIP = _Wrist(4.4506, 1.2217, 1.27409)
_STAPLER = _Wrist(4.4506, 0.5236, 0.5236)

# number, name, wrist length, limits of the wrist, jaw low and high
_TABLE: tuple[tuple[int, str, float, _Wrist, float, float], ...] = (
    (400001, "POTTS_SCISSORS", 0.0091, _A, -0.698132, 0.5236),
    (400003, "SMALL_CLIP_APPLIER", 0.0091, _A, -0.349066, 0.698132),
    (400006, "LARGE_NEEDLE_DRIVER", 0.0091, _A, -0.698132, 1.39626),
    (400007, "ROUND_TIP_SCISSORS", 0.0091, _A, -0.698132, 0.698132),
    (400033, "MICRO_FORCEPS", 0.0091, _A, -0.349066, 1.39626),
    (400035, "ROUND_TOOTH_FORCEPS", 0.0091, _A, -0.698132, 1.39626),
    (400036, "DEBAKEY_FORCEPS", 0.0091, _A, -0.349066, 1.39626),
    (400048, "LONG_TIP_FORCEPS", 0.0091, _A, -0.349066, 1.39626),
    (400049, "CADIERE_FORCEPS", 0.0091, _A, -0.349066, 1.39626),
    (400093, "PROGRASP_FORCEPS", 0.0107, _A, -0.349066, 1.39626),
    (400127, "BOWEL_GRASPER", 0.0107, _B, -0.349066, 1.39626),
    (400172, "MARYLAND_BIPOLAR_FORCEPS", 0.0107, _BIPOLAR, -0.349066, 1.39626),
    (400178, "CURVED_SCISSORS", 0.0091, _A, -0.349066, 1.39626),
    (400179, "MONOPOLAR_CURVED_SCISSORS", 0.0091, _A, -0.349066, 1.39626),
    (400181, "RESANO_FORCEPS", 0.0091, _A, -0.349066, 1.39626),
    (400183, "PERMANENT_CAUTERY_HOOK", 0.0093, _CAUTERY, 0.0, 0.5),
    (400184, "PERMANENT_CAUTERY_SPATULA", 0.0093, _CAUTERY, 0.0, 0.5),
    (400189, "DOUBLE_FENESTRATED_GRASPER", 0.0107, _B, -0.349066, 1.39626),
    (400194, "MEGA_NEEDLE_DRIVER", 0.0112, _B, -0.349066, 1.39626),
    (400205, "FENESTRATED_BIPOLAR_FORCEPS", 0.0107, _BIPOLAR, -0.698132, 1.39626),
    (400207, "TENACULUM_FORCEPS", 0.0107, _B, -0.349066, 1.39626),
    (400208, "THORACIC_GRASPER", 0.0107, _B, -0.349066, 1.39626),
    (400230, "LARGE_CLIP_APPLIER", 0.0107, _CLIP, -0.349066, 0.785398),
    (400296, "LRG_SUTURECUT_NEEDLE_DRIVER", 0.0091, _A, -0.349066, 0.7854),
    (400309, "MEGA_SUTURECUT_NEEDLE_DRIVER", 0.01, _B, -0.349066, 1.39626),
    (410298, "STAPLER_45", 0.0, _STAPLER, -0.2, 0.349),
    (420001, "POTTS_SCISSORS", 0.0091, _A, -0.698132, 0.5236),
    (420006, "LARGE_NEEDLE_DRIVER", 0.0091, _A, -0.349066, 1.39626),
    (420007, "ROUND_TIP_SCISSORS", 0.0091, _A, -0.698132, 0.698132),
    (420033, "MICRO_FORCEPS", 0.0091, _A, -0.349066, 1.39626),
    (420036, "DEBAKEY_FORCEPS", 0.0091, _A, -0.349066, 1.39626),
    (420048, "LONG_TIP_FORCEPS", 0.0091, _A, -0.349066, 1.39626),
    (420049, "CADIERE_FORCEPS", 0.0091, _A, -0.349066, 1.39626),
    (420093, "PROGRASP_FORCEPS", 0.0107, _A, -0.349066, 1.39626),
    (420172, "MARYLAND_BIPOLAR_FORCEPS", 0.0107, _BIPOLAR, -0.349066, 1.39626),
    (420178, "CURVED_SCISSORS", 0.0091, _A, -0.349066, 1.39626),
    (420179, "MONOPOLAR_CURVED_SCISSORS", 0.0091, _A, -0.349066, 1.39626),
    (420181, "RESANO_FORCEPS", 0.0091, _A, -0.349066, 1.39626),
    (420183, "PERMANENT_CAUTERY_HOOK", 0.0093, _CAUTERY, 0.0, 0.5),
    (420184, "PERMANENT_CAUTERY_SPATULA", 0.0093, _CAUTERY, 0.0, 0.5),
    (420194, "MEGA_NEEDLE_DRIVER", 0.0112, _B, -0.349066, 1.39626),
    (420205, "FENESTRATED_BIPOLAR_FORCEPS", 0.0107, _BIPOLAR, -0.698132, 1.39626),
    (420230, "LARGE_CLIP_APPLIER", 0.0107, _CLIP, -0.349066, 0.785398),
    (420296, "LARGE_SUTURECUT_NEEDLEDRIVER", 0.0091, _A, -0.349066, 0.7854),
    (420309, "MEGA_SUTURECUT_NEEDLE_DRIVER", 0.01, _B, -0.349066, 1.39626),
    (420327, "MEDIUM-LARGE_CLIP_APPLIER", 0.0107, _CLIP, -0.349066, 0.733038),
)

ALIASES: Mapping[str, str] = MappingProxyType(
    {
        "BLACK_DIAMOND_MICRO_FORCEPS": "MICRO_FORCEPS",
        "BIPOLAR_MARYLAND_FORCEPS": "MARYLAND_BIPOLAR_FORCEPS",
        "MONOPOLAR_CURVED_SCISSOR": "MONOPOLAR_CURVED_SCISSORS",
    }
)
"""Other names under which instruments are known."""

SNAKES: Mapping[int, str] = MappingProxyType(
    {400143: "MARYLAND_DISSECTOR", 400117: "NEEDLE_DRIVER", 420117: "NEEDLE_DRIVER"}
)
"""Instruments with a snake wrist, which have no lengths of this kind and are not modelled."""


def _instrument(number: int, name: str, wrist: float, limits: _Wrist, low: float, high: float) -> Instrument:
    stapler, classic = limits is _STAPLER, number < 420000
    shaft = 0.41557 if stapler else 0.4162 if classic else 0.467
    tip = ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)) if stapler else STANDARD_TIP
    upper = np.array(limits)
    arrays = (-upper, upper, np.array([low, high]), np.array(tip))
    for values in arrays:
        values.flags.writeable = False
    return Instrument(name, number, "Classic" if classic else "S", InstrumentLengths(shaft, wrist), *arrays)


INSTRUMENTS: Mapping[int, Instrument] = MappingProxyType({row[0]: _instrument(*row) for row in _TABLE})
"""Every instrument with a wrist of three joints, by its number."""

_TYPE = re.compile(r"(?P<name>[A-Z0-9_-]+?)(_GEARED)?(:(?P<number>\d+)(\[[^\]]*\])?)?\Z")


def instrument(tool_type: str | int) -> Instrument:
    """The instrument that ``tool_type`` means: its number, ``NAME:NUMBER``, ``NAME:NUMBER[VERSION]`` or ``NAME``.

    A name alone means the Classic generation. Geared variants (``NAME_GEARED``) have the kinematics of the plain ones.

    Raises
    ------
    ValueError
        For an unknown instrument, stating which part is not known.
    """
    text = str(tool_type).strip()
    match = _TYPE.match(text)
    if match is None:
        raise ValueError(f"'{text}' is not a tool type; write NAME:NUMBER, for example LARGE_NEEDLE_DRIVER:400006")
    name, number = match["name"], match["number"]
    if number is None and not name.isdigit():
        return _by_name(name)
    found = _by_number(int(number or name))
    if number is not None and ALIASES.get(name, name) != found.name:
        raise ValueError(f"instrument {number} is called {found.name}, not {name}")
    return found


def _by_name(name: str) -> Instrument:
    for candidate in INSTRUMENTS.values():
        if candidate.name == ALIASES.get(name, name):
            return candidate
    raise ValueError(f"no instrument is called '{name}'")


def _by_number(number: int) -> Instrument:
    if number in SNAKES:
        raise ValueError(f"{SNAKES[number]}:{number} has a snake wrist, which is not modelled")
    if number not in INSTRUMENTS:
        raise ValueError(f"unknown instrument {number}; known are for example 400006 and 420006")
    return INSTRUMENTS[number]
