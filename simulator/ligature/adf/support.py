"""The table of what is supported, generated from the schema: ``docs/adf.md`` is its text."""

from __future__ import annotations

from ligature.adf.schema import NOT_SIMULATED, SCHEMA, Key, Status

_INTRODUCTION = """# ADF support

Every key that the reader knows, by kind of file or object, with its type, default and what becomes of it. Section
numbers (§) are those of the ADF specification. Keys that are not here are reported as unknown, with a suggestion.

- **used**: has the effect that AMBF gives it.
- **read and ignored, as in AMBF**: legal, without effect there and here; told at debug level (`ligature check -v`).
- **Ligature's own**: AMBF ignores it, so files that use it stay valid there.

Bodies, joints, ghost objects, sensors, actuators, cameras, lights and sutures are simulated; {not_simulated} are read,
checked and reported as not simulated.

Where AMBF's behaviour is a defect that no file relies on, ours is the sane one: an unknown sensor type leaves that
sensor out instead of crashing, one bad value leaves its object out instead of refusing the file (`--strict` refuses
it), a joint without `type` is revolute with a warning, a lone `enable motor` is accepted, duplicates get topics of
their own, a missing low-resolution mesh falls back to the high-resolution one with a warning.
"""


def support_table() -> str:
    """The text of ``docs/adf.md``."""
    parts = [_INTRODUCTION.format(not_simulated=", ".join(f"{kind}s" for kind in sorted(NOT_SIMULATED)))]
    for kind, keys in SCHEMA.items():
        parts.append(
            f"\n## {kind[0].upper()}{kind[1:]}\n\n| key | type | default | unit | meaning |\n|---|---|---|---|---|\n"
        )
        parts += [_row(key) for key in keys]
    return "".join(parts)


def _row(key: Key) -> str:
    type_ = key.type.value
    if key.choices:
        type_ += " " + ", ".join(sorted(set(key.choices.values())))
    default = "required" if key.required else _default(key.default)
    meaning = key.doc
    if key.status is not Status.USED:
        meaning = f"{meaning}; {key.status.value}" if meaning else key.status.value
    return f"| `{key.path}` | {type_} | {default} | {key.unit} | {meaning} |\n"


def _default(value: object) -> str:
    if value is None or value == "" or value == ():
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    return str(value)
