"""The table of what is supported, generated from the schema: ``docs/adf.md`` is its text."""

from __future__ import annotations

from ligature.adf.schema import NOT_SIMULATED, PLURALS, SCHEMA, Fault, Key, Status

_INTRODUCTION = """# ADF support

Every key that the reader knows, by kind of file or object, with its type, default and what becomes of it. Section
numbers (§) are those of the ADF specification. Keys that are not here are reported as unknown, with a suggestion.

- **used**, where nothing else is stated: has the effect that AMBF gives it (`tests/adf/test_effects.py` tries each).
- **{ignored}**: legal, without effect there and here; reported at debug level (`ligature check -v`).
- **{unused}**: AMBF uses it, and its meaning is stated; its value is checked, and `ligature check -v` names it.
- **{kept}**: handed to them as written; those in Python are run when the user allows it ([plug-ins](plugins.md)).
- **{not_simulated_status}**: of kinds that are not simulated.
- **{ours}**, so files that use it stay valid there.

A bad value is an error at its place, and leaves its object out; where the table states "bad: default", it is a warning
and the default is taken. {simulated} are simulated; {not_simulated} are read, checked and reported as not simulated.

Where AMBF's behaviour is a defect that no file relies on, ours is the sane one: an unknown sensor type leaves that
sensor out instead of crashing, one bad value leaves its object out instead of refusing the file (`--strict` refuses
it), a joint without `type` is revolute with a warning, a lone `enable motor` is accepted, duplicates get topics of
their own, a missing low-resolution mesh falls back to the high-resolution one with a warning.

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
