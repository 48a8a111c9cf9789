"""What the system lets a process have no more of, in words: open files, processes and threads, memory."""

from __future__ import annotations

import errno
import resource

_BYTES = 1e6
_ENOUGH_FILES = 4096

NEEDED_MEMORY = 800_000_000
"""Bytes of address space with which small scenes run; below it libraries crash."""

_REMEDY = "raise the limit: 'ulimit -v unlimited', or 'as' in /etc/security/limits.conf"


def shortage(error: BaseException) -> str:
    """Of what ``error``, or one that it follows, says that the system allows no more; empty for other errors."""
    found: BaseException | None = error
    while found is not None:
        if text := _shortage(found):
            return text
        found = found.__cause__ or found.__context__
    return ""


def _shortage(error: BaseException) -> str:
    number = error.errno if isinstance(error, OSError) else None
    if number == errno.EMFILE:
        return (
            f"the system lets this process open {_allowed(resource.RLIMIT_NOFILE)} files, and it needs more, one for "
            f"each ROS topic: raise the limit, 'ulimit -n {_ENOUGH_FILES}', or 'nofile' in /etc/security/limits.conf"
        )
    if number == errno.ENFILE:
        return "the system has no more open files for any program: end some, or raise fs.file-max by sysctl"
    if number == errno.EAGAIN or (isinstance(error, RuntimeError) and "can't start new thread" in str(error)):
        return (
            f"the system lets this user have {_allowed(resource.RLIMIT_NPROC)} processes and threads, and no more can "
            "be started: end some, or raise the limit, 'ulimit -u', or 'nproc' in /etc/security/limits.conf"
        )
    loading = isinstance(error, ImportError | OSError) and (
        "map segment" in str(error) or "allocate memory" in str(error)
    )
    if number == errno.ENOMEM or isinstance(error, MemoryError) or loading:
        return f"there is not enough memory{_limit()}"
    return ""


def small_memory() -> str:
    """A warning when this process may have less address space than any scene needs; empty when it has enough."""
    soft, _ = resource.getrlimit(resource.RLIMIT_AS)
    if soft == resource.RLIM_INFINITY or soft >= NEEDED_MEMORY:
        return ""
    return f"with less than {NEEDED_MEMORY / _BYTES:.0f} MB this may crash at any moment{_limit()}"


def _limit() -> str:
    """The limit of address space and how to raise it, to be appended; empty where there is none."""
    soft, _ = resource.getrlimit(resource.RLIMIT_AS)
    if soft == resource.RLIM_INFINITY:
        return ""
    return f": the system lets this process have {soft / _BYTES:.0f} MB; {_REMEDY}"


def _allowed(kind: int) -> str:
    soft, _ = resource.getrlimit(kind)
    return "no more" if soft == resource.RLIM_INFINITY else str(soft)
