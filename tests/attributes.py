"""All that a running simulation holds, attribute by attribute: for tests that look for what a snapshot forgets."""

from __future__ import annotations

import enum
from collections import deque
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from ligature import Simulation
from ligature.robots.ecm import Ecm
from ligature.robots.mtm import Mtm
from ligature.robots.psm import Psm
from numpy.typing import NDArray

Array = NDArray[Any]

CACHES: dict[str, str] = {
    # what a rod or hole works with within one tick; every row is written before it is read
    "Rod._table": "addresses of arrays",
    "Engine._restored": "what Bullet makes of a pose that it is given: the same for the same pose",
    "Rod._arrays": "what of it lasts are attributes of the rod, too",
    "Joints.table": "addresses of arrays",
    "Motions.table": "addresses of arrays",
    "Engine._boxes": "an address in Bullet's memory",
    "Readout._table": "addresses of arrays",
    "Readout._state_table": "addresses of arrays",
    "Rod._touch_tables": "addresses of arrays",
    "Rod._tick_table": "addresses of arrays",
    "Rod._tick": "the rod's arrays and tables",
    "Rods._tick_tables": "addresses of arrays",
    "Rods._ticks": "addresses of arrays",
    "Rod._buffers": "in the order of `Rod._touches`, of which the first lasts",
    "Rod._order": "in which order these are",
    **dict.fromkeys(("Coasting.spent", "Coasting._corners", "Coasting._clock"), "scratch"),
    "Rod._passage_table": "addresses of arrays",
    "Rod._elements": "the rod's arrays and the state record",
    "Rod._element_table": "addresses of arrays",
    "Rod._corners": "written by every call of `box`",
    "Rod._constraint_rows": "follows from constraints, attachments and pads",
    "Rod._motion": "the colliders' array",
    **dict.fromkeys(
        (
            "Rod._near",
            "Rod._met",
            "Rod._apart",
            "Rod._movable",
            "Rod._pushed",
            "Nodes.met",
            "Shapes.node",
        ),
        "gathered anew in the tick after a restore",
    ),
    **dict.fromkeys(
        (
            f"Touches.{name}"
            for name in ("local", "arm", "gap", "target", "friction", "switches", "room", "begun", "ended", "push")
        ),
        "written for every contact before it is read",
    ),  # fmt: skip
    **dict.fromkeys(("Watch.seen", "Watch.fresh", "Watch.R"), "scratch"),
    "Holes._passage_table": "addresses of arrays",
    "Holes._site_table": "addresses of arrays",
    "Holes._path_table": "addresses of arrays",
    "Holes._rod_tables": "addresses of arrays",
    "Holes.search_table": "addresses of arrays",
    **dict.fromkeys((f"Search.{name}" for name in ("passages", "paths", "sites", "rods")), "addresses of arrays"),
    **dict.fromkeys(
        (
            "Holes._scratch",
            "Search.motion",
            "Holes._reaction",
            "Holes._twist",
            "Holes._pull",
            "Holes._mass",
            "Holes._inertia",
            "Paths.pose",
            "Sites.shared",
            "Passages.J",
            "Passages.T",
            "Passages.d",
            "Passages.A",
            "Passages.B",
        ),
        "written before it is read in every tick",
    ),  # fmt: skip
    "ImpulseExchange._exchanges": "what of it lasts are attributes of the grasps, too",
    "Grasps._holds": "what of it lasts are attributes of the grasps, too",
    **dict.fromkeys(("Grasps.look_table", "Looks.due", "Looks.box"), "set before compiled code reads it"),
    **dict.fromkeys(("CourseArrays.due", "CourseArrays.watched"), "set before compiled code reads it"),
    **dict.fromkeys(("Courses.table", "CourseArrays.own", "CourseArrays.aim"), "addresses of arrays"),
    "Rod._spring_table": "addresses of arrays",
    "Rod.springs": "written by every tick that tissue takes part in",
    "Rod._lent": "counted anew by every tick that meets the rod, before it is read",
    "Run.chain": "follows from the rod and its needle",
    # soft tissue
    "ElasticGrid._responses": "follows from the grid",
    "Field.found": "counts how often boxes were found",
    "Field.response": "follows from the points; a restore fills it",
    "Contacts.partners": "read from the bodies before it is used; friction follows from the scene",
    "ElasticGrid._bulk": "what of it lasts are attributes of the grid, too",
    "ScenePiercer._mount": "what of it lasts are attributes of the needle, too",
    **dict.fromkeys(
        (
            "ElasticGrid._bulk_table",
            "Interface.table",
            "NeedleInTissue.table",
            "ThreadInTissue.table",
            "Frame.table",
            "BodyContacts._tables",
            "ScenePiercer._tables",
            "ScenePiercer._nodes",
            "SceneThread._tables",
            "LyingThread._tables",
        ),
        "addresses of arrays",
    ),
    **dict.fromkeys(
        (
            "Elimination.work",
            "Field.load",
            "Field.change",
            "Lips._near",
            "Lips._gap",
            "NeedleInTissue._rows",
            "NeedleInTissue._weights8",
            "NeedleInTissue._weights4",
            "NeedleInTissue._normal",
            "NeedleInTissue._left",
            "NeedleInTissue._count",
            "NeedleArrays.rows",
            "NeedleArrays.H",
            "NeedleArrays.g",
            "NeedleArrays.wrench",
            "NeedleArrays.way",
            "Strand.rows",
            "Strand.tangent",
            "Strand.three",
            "ThreadInTissue._settles",
            "Contacts.solve",
            "Contacts.overflow",
            "Parts.live",
            "Parts.known",
            "Parts.R",
            "Parts.centre",
            *(
                f"Around.{name}"
                for name in ("light", "moments", "kept", "inside", "read", "wanted", "motion", "pushed")
            ),
            "Around.turn",
            "FrameArrays.turn",
            "ScenePiercer.spring",
            "ScenePiercer.met",
            "Piece._motion",
            "SceneThread._run",
            "SceneThread._holds",
            "LyingThread._none",
            "LyingThread._holds",
            *(
                f"Lying.{name}"
                for name in ("spring", "normal", "gap", "row", "inside", "mine", "found", "corner", "at", "W", "K")
            ),
        ),
        "written before it is read in every tick",
    ),
    "Masses._scaled": "follows from the scene",
    "Tissues._reported": "what of the problems was reported",
    # what is read from Bullet after each tick, or when somebody asks
    **dict.fromkeys(
        (
            *(f"Motions.{name}" for name in ("pose", "twist", "position", "velocity", "effort", "push")),
            "TreeControl._position",
            *(
                f"Trees.{name}"
                for name in ("pose", "twist", "frame", "speed", "joints", "reaction", "push", "load", "wanted")
            ),
            *(f"Trees.{name}" for name in ("read", "linked", "uid")),
        ),
        "read from Bullet, or computed, before it is used",
    ),  # fmt: skip
    **dict.fromkeys(("Axes.motor", "Axes.limit"), "written by every tick before it is used"),
    **dict.fromkeys(("Trees.answer", "Trees.wanted_at"), "addresses of arrays"),
    **dict.fromkeys(("Trees.sleepers", "Boxes.phase", "Boxes.at", "Boxes.owner", "Boxes.last"), "in Bullet's memory"),
    "Boxes.moved": "a restore compares all boxes; every tick writes it",
    **dict.fromkeys(("Boxes.parked", "Boxes.out"), "scratch"),
    "Trees.before": "scratch",
    "Trees.quiet": "a restore rouses all trees; the next tick decides anew",
    **dict.fromkeys(("Trees.still", "Trees.asleep"), "decided anew by every tick, for trees that are quiet"),
    "Trees.last_motor": "unknown after a restore, also in the simulation that took the snapshot",
    **dict.fromkeys(("Trees.foreseen", "Trees.pressed"), "part of an effort, which nobody has before the next tick"),
    **dict.fromkeys(("Trees.change", "Trees.acceleration"), "scratch"),
    **dict.fromkeys(
        (
            "Engine.client",
            "Engine._end",
            "Placement.client",
            "Motions._client",
            "Motions.handle",
            "TreeControl._client",
            "Lift._client",
            "Closures._client",
            "Parting._client",
            "Weld.constraint",
        ),
        "Bullet's own numbers",
    ),  # fmt: skip
    "Closures._table": "addresses of arrays",
    "Closures._share": "set by every tick before it is used",
    "Closures._torn": "set by every tick before it is used",
    **dict.fromkeys(
        (
            f"Loops.{name}"
            for name in (
                "gap",
                "most",
                "moved",
                "end",
                "error",
                "inertia",
                "axis",
                "first",
                "linear",
                "M",
                "J",
                "row_of",
                "rank",
                "firm",
                "B",
                "scale",
                "A",
                "multiplier",
                "step",
                "shift",
                "place",
                "bound",
                "speed",
                "wanted",
                "wanted_at",
            )  # fmt: skip
        ),
        "written by every tick before it is read",
    ),
    "Trees.ticks": "ticks since a restore; before the first nobody has an effort",
    "ContactWrenches._owned": "saves asking again",
    # what sensors make of the state
    **dict.fromkeys(
        (
            *(f"GhostArrays.{name}" for name in ("apart", "measured", "room", "inside", "due", "seen", "moved")),
            *(f"Ghosts._{name}" for name in ("apart", "measured", "room", "inside", "due", "seen", "moved")),
            "Contacts._table",
            "Contacts._groups",
            "ContactWrenches._groups",
            "Ghosts.sensed",
        ),
        "saves asking again; `sense` fills it from the state",
    ),
    **dict.fromkeys(("Mounts.world", "Mounted.world"), "`sense` fills it from the state"),
    **dict.fromkeys(
        (
            "Readout._state",
            "FieldViews._state",
            "FieldViews._views",
            "FieldViews.fresh",
            "Actuators._written",
            "Grasps._written_empty",
        ),
        "what of the state record is up to date",
    ),
    **dict.fromkeys(
        (
            "Mounts._table",
            "Mounts._field_table",
            "Ghosts._table",
            "Colliders.table",
            "Engine.place_table",
            "World.always",
        ),  # fmt: skip
        "addresses of arrays",
    ),
    "Contacts.events": "`sense` fills it from the state",
    "ArmSet._records": "what of the state record is up to date",
    "Axes._setpoint": "of an arm whose drives are off it is read from the joints",
    # what waits for whoever reports it
    "Device.events": "an outbox",
    **dict.fromkeys(("World.problems", "Rods.problems", "ArmSet.problems", "Tissues._problems"), "an outbox"),
}
"""Attributes that a snapshot need not hold, as ``Class.attribute``, each with the reason."""


SCRATCH = frozenset({
    "scratch", "scratch of a tick", "written before it is read in every tick",
    "written by every tick before it is read", "written for every contact before it is read",
})  # fmt: skip
"""Reasons in `CACHES` that are claims about what a tick reads."""


def attributes(simulation: Simulation) -> dict[str, bytes]:
    """Every value that the subsystems of a simulation reach, by its path; `CACHES` are left out."""
    return {path: leaf if isinstance(leaf, bytes) else leaf.tobytes() for path, leaf in _leaves(simulation).items()}


def scratch(simulation: Simulation) -> dict[str, Array]:
    """Every array of which `CACHES` states that a tick writes it before it reads it, by its path."""
    lasting = _leaves(simulation)
    return {
        path: leaf
        for path, leaf in _leaves(simulation, SCRATCH).items()
        if path not in lasting and not isinstance(leaf, bytes)
    }


def _leaves(simulation: Simulation, also: frozenset[str] = frozenset()) -> dict[str, Array | bytes]:
    """Arrays and other values that the subsystems reach; of `CACHES` those with the reasons ``also``."""
    found: dict[str, Array | bytes] = {}
    seen = {id(simulation): simulation}
    for subsystem in simulation._subsystems:
        found |= dict(_walk(type(subsystem).__name__, subsystem, seen, also))
    return found


def _walk(path: str, value: Any, above: dict[int, Any], also: frozenset[str]) -> Iterator[tuple[str, Array | bytes]]:
    """Paths and values below ``value``; what is ``above`` was walked already."""
    if isinstance(value, np.ndarray) and value.dtype != object:
        yield path, value
        return
    if isinstance(value, bool | int | float | str | bytes | enum.Enum | np.generic | None):
        yield path, repr(value).encode()
        return
    if id(value) in above:
        return
    if not isinstance(value, Ecm | Mtm | Psm):  # never changed, only replaced; some are shared until they are copied
        above[id(value)] = value
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        counter = {"Touches": "count", "Passages": "filled"}.get(type(value).__name__)
        rows = None if counter is None else int(getattr(value, counter)[0])
        for name, item in zip(value._fields, value, strict=True):
            item = item if rows is None or name == counter else item[:rows]
            yield from _attribute(path, value, name, item, above, also)
    elif isinstance(value, Mapping) and not hasattr(value, "__dict__"):
        for key in sorted(value, key=repr):
            yield from _walk(f"{path}[{key!r}]", value[key], above, also)
    elif isinstance(value, set | frozenset):
        yield path, repr(sorted(value, key=repr)).encode()
    elif isinstance(value, list | tuple | deque):
        yield f"{path}.len", str(len(value)).encode()
        items = value[:1] if path.endswith("_touches") else value
        for i, item in enumerate(items):
            yield from _walk(f"{path}[{i}]", item, above, also)
    elif hasattr(value, "__dict__") and type(value).__module__.startswith("ligature."):
        if type(value).__module__ not in ("ligature.model.scene", "ligature.model.shapes"):
            for name, item in sorted(vars(value).items()):
                yield from _attribute(path, value, name, item, above, also)


def _attribute(
    path: str, owner: Any, name: str, item: Any, above: dict[int, Any], also: frozenset[str]
) -> Iterator[tuple[str, Array | bytes]]:
    reasons = {CACHES.get(f"{kind.__name__}.{name}") for kind in type(owner).__mro__} - {None}
    if reasons <= also:
        yield from _walk(f"{path}.{name}", item, above, also)
