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
    return _function(context, "glFinish") or context.finish


DepthCopy = Callable[[moderngl.Framebuffer, moderngl.Framebuffer], None]
"""Copies the depths of the first frame buffer to the second, which is in use and as large."""


def depth_copier(context: moderngl.Context) -> DepthCopy | None:
    """What copies depths, where moderngl copies colours alone; None where the driver's functions cannot be called."""
    integers = (ctypes.c_uint,)
    bind = _function(context, "glBindFramebuffer", *2 * integers)
    blit = _function(context, "glBlitFramebuffer", *8 * (ctypes.c_int,), *2 * integers)
    if bind is None or blit is None:
        return None

    def copy(source: moderngl.Framebuffer, target: moderngl.Framebuffer) -> None:
        bind(READ_FRAMEBUFFER, source.glo)
        blit(0, 0, *source.size, 0, 0, *target.size, DEPTH_BUFFER_BIT, NEAREST)
        bind(READ_FRAMEBUFFER, target.glo)

    return copy


READ_FRAMEBUFFER, DEPTH_BUFFER_BIT, NEAREST = 0x8CA8, 0x100, 0x2600
"""Constants of OpenGL's registry."""


def _function(context: moderngl.Context, name: str, *types: type) -> Callable[..., None] | None:
    """A function of OpenGL that returns nothing; None where it cannot be called."""
    load = getattr(getattr(context.mglo, "_context", None), "load_opengl_function", None)
    address = load(name) if load else 0
    return ctypes.CFUNCTYPE(None, *types)(address) if address else None


SOFTWARE = ("llvmpipe", "softpipe", "swr", "software")
"""What drivers that draw on the processor call themselves."""


def draws_on_processor(context: moderngl.Context) -> bool:
    """Whether a software rasteriser draws, to which several samples a pixel cost as much as the picture itself."""
    return any(name in context.info["GL_RENDERER"].lower() for name in SOFTWARE)
