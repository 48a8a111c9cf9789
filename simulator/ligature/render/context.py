"""The OpenGL context: EGL without a display, on a GPU or on Mesa's software rasteriser."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable

import moderngl


class RenderUnavailable(RuntimeError):
    """No OpenGL is available on this machine; the message names what to install."""


_process = 0
"""The process that made the first context."""


def has_drawn() -> bool:
    """Whether this process, or one that it was forked from, made a context: no child that it forks can draw then."""
    return _process != 0


def check_process() -> None:
    """Raise `RenderUnavailable` in a child that was forked after a context was made: drawing there would never end."""
    if _process not in (0, os.getpid()):
        raise RenderUnavailable(
            "OpenGL does not work in a process that was forked after its parent had drawn; start it with "
            "multiprocessing.get_context('spawn'), or take the first picture in the child"
        )


def create_context() -> moderngl.Context:
    """A stand-alone OpenGL 3.3 core context; raises `RenderUnavailable`."""
    global _process
    check_process()
    try:
        _process = os.getpid()
        return tidy(moderngl.create_standalone_context(require=330, backend="egl"))  # type: ignore[arg-type]
    except Exception as error:
        raise RenderUnavailable(
            f"no OpenGL 3.3 context through EGL ({error}); install libegl1 and libgl1-mesa-dri "
            "for the software rasteriser, or a GPU driver; the simulator runs on without cameras"
        ) from error


def tidy(context: moderngl.Context) -> moderngl.Context:
    """``context``, whose ``gc`` gives objects back that Python has dropped, wherever Python found that they are."""
    context.gc_mode = "context_gc"
    return context


def finish_of(context: moderngl.Context) -> Callable[[], None]:
    """What waits until all is drawn; other threads of Python run meanwhile, which they do not in moderngl's calls."""
    load = getattr(getattr(context.mglo, "_context", None), "load_opengl_function", None)
    address = load("glFinish") if load else 0
    return ctypes.CFUNCTYPE(None)(address) if address else context.finish


SOFTWARE = ("llvmpipe", "softpipe", "swr", "software")
"""What drivers that draw on the processor call themselves."""


def draws_on_processor(context: moderngl.Context) -> bool:
    """Whether a software rasteriser draws, to which several samples a pixel cost as much as the picture itself."""
    return any(name in context.info["GL_RENDERER"].lower() for name in SOFTWARE)
