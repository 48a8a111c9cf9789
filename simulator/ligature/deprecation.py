"""Former names that still work: each use warns once a place, and names what to write instead."""

from __future__ import annotations

import warnings


def warn_deprecated(former: str, name: str, stacklevel: int = 3) -> None:
    """Warn that ``former`` is deprecated in favour of ``name``, at the caller of the function that calls this one."""
    warnings.warn(f"'{former}' is deprecated; write '{name}'", DeprecationWarning, stacklevel)
