"""The table of what is supported, generated from the schema: ``docs/adf.md`` is its text."""

from __future__ import annotations

from ligature.adf.schema import NOT_SIMULATED, PLURALS, SCHEMA, Fault, Key, Status

_INTRODUCTION = """# ADF support

ADF is the YAML format of AMBF's scenes. This page lists every key that Ligature reads, by kind of file or object, with
type, default and effect. The effects follow the loader of AMBF 2.0. Other keys are reported as unknown,
with a suggestion. To write your first file, see [your first scene](tutorial_scene.md). `ligature check` lists the keys
of a file that have no effect. The effects of a key are:

- **used** (not marked in the tables): the same effect as in AMBF (`tests/adf/test_effects.py` tests each).
- **{ignored}**: valid, without effect in AMBF and Ligature; reported at debug level (`ligature check -v`).
- **{unused}**: has an effect only in AMBF; the value is checked, and `ligature check -v` names it.
- **{kept}**: passed to plug-ins as written; Python plug-ins run if the user allows it ([plug-ins](plugins.md)).
- **{not_simulated_status}**: key of a kind of object that is not simulated.
- **{ours}**; files that use it stay valid in AMBF.

A bad value is an error with its file, line and column, and its object is left out. If the table states "bad: default",
it is a warning, and the default is used.

{simulated} are simulated; {not_simulated} are read, checked and reported as not simulated.

Ligature deviates from AMBF only where AMBF has a defect on which no file relies:

- a sensor of unknown type is left out; AMBF crashes;
- an object with a bad value is left out; AMBF rejects the whole file, as `--strict` does;
- a joint without `type` is revolute, with a warning;
- `enable motor` alone is accepted;
- objects of the same name get separate topics;
- a missing low-resolution mesh is replaced by the high-resolution one, with a warning;
- a collision margin of at least half the thickness of a box or cylinder, through which spheres would fall, is reduced.

This page is generated from the schema by `make docs`.
"""


def support_table() -> str:
    """The text of ``docs/adf.md``."""
    listed = [kind for kind in SCHEMA if kind in PLURALS and kind != "input device"]
    parts = [
        _INTRODUCTION.format(
            ignored=Status.IGNORED.value,
            unused=Status.UNUSED.value,
            kept=Status.KEPT.value,
            not_simulated_status=Status.NOT_SIMULATED.value,
            ours=Status.OURS.value,
            simulated=_enumerated([k for k in listed if k not in NOT_SIMULATED]).capitalize(),
            not_simulated=_enumerated([k for k in listed if k in NOT_SIMULATED]),
        )
    ]
    for kind, keys in SCHEMA.items():
        title = "Input devices file" if kind == "input devices" else kind[0].upper() + kind[1:]
        parts.append(f"\n## {title}\n\n| key | type | default | unit | meaning |\n|---|---|---|---|---|\n")
        parts += [_row(key) for key in keys]
    return "".join(parts)


def _enumerated(kinds: list[str]) -> str:
    *first, last = (PLURALS[kind] for kind in kinds)
    return f"{', '.join(first)} and {last}" if first else last


def _row(key: Key) -> str:
    type_ = key.type.value
    if key.choices:
        type_ += " " + ", ".join(sorted(set(key.choices.values())))
    default = "required" if key.required else _default(key.default)
    meaning = key.doc
    if key.status is not Status.USED:
        meaning = f"{meaning}; {key.status.value}" if meaning else key.status.value
    if key.fault is Fault.VALUE:
        meaning += "; bad: default"
    return f"| `{key.path}` | {type_} | {default} | {key.unit} | {meaning} |\n"


def _default(value: object) -> str:
    if value is None or value == "" or value == ():
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    return str(value)
