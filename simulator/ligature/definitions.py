"""Message classes from definitions that strangers wrote: in a bag, or in what a publisher reports when it connects.

genpy turns a definition into Python and runs it. Values of constants and comments go into that text, and a crafted one
ends the string that it stands in: a bag could run any code. Only lines that declare fields are handed on.
"""

from __future__ import annotations

import re
from typing import Any

import genpy.dynamic
import roslib.message

MOST_CHARACTERS = 100_000
"""Longest definition with those of its parts that is read; those of pictures have 10 000."""

_FIELD = re.compile(r"[A-Za-z][\w/]{0,100}(\[\d{0,9}\])? +[A-Za-z]\w{0,100}")
_PART = re.compile(r"MSG: ?[A-Za-z]\w{0,100}/[A-Za-z]\w{0,100}")
_LINE = re.compile(r"={80}")
_TYPE = re.compile(r"[A-Za-z]\w{0,100}/[A-Za-z]\w{0,100}")


class DefinitionError(ValueError):
    """A definition from which no class can be made; the message gives the reason."""


def plain(definition: str) -> str:
    """The fields of a definition and of its parts: all that the bytes of a message depend on.

    Raises `DefinitionError` for a definition that is too long.
    """
    if len(definition) > MOST_CHARACTERS:
        raise DefinitionError(
            f"the message definition has {len(definition)} characters; the maximum is {MOST_CHARACTERS}"
        )
    lines = (" ".join(line.partition("#")[0].split()) for line in definition.splitlines())
    return "\n".join(line for line in lines if any(kind.fullmatch(line) for kind in (_FIELD, _PART, _LINE)))


def message_class(type_: str, md5: str, definition: str) -> Any:
    """The class of messages ``type_``: the installed one where its digest is ``md5``, else one made of the definition.

    Raises `DefinitionError`.
    """
    if not _TYPE.fullmatch(type_):
        raise DefinitionError(f"'{type_[:60]}' is not a message type")
    try:
        installed = roslib.message.get_message_class(type_)
    except Exception:  # whatever a broken package raises
        installed = None
    if installed is not None and installed._md5sum == md5:
        return installed
    try:
        return genpy.dynamic.generate_dynamic(type_, plain(definition))[type_]
    except (genpy.MsgGenerationException, KeyError, SyntaxError, ValueError, RecursionError) as error:
        raise DefinitionError(f"no usable definition of {type_}: {error}") from None
