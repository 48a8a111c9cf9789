"""Kernels as other kernels contain them: LLVM code alone.

Numba makes of each function what a call from Python needs: wrappers that unpack its arguments, optimised code and
machine code. What contains a kernel needs none of them, for all that it contains is optimised and compiled with it.
Most kernels are called by kernels alone: without what nothing calls, all of them take half of the time or less.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import llvmlite.binding
from numba.core import typed_passes
from numba.core.caching import CompileResultCacheImpl
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, compile_result
from numba.core.compiler_machinery import register_pass
from numba.core.registry import CPUDispatcher

from ligature.kernel_cache import Code, KernelCache, cache_of


class _Library(JITCodeLibrary):
    """LLVM code that others link with, neither optimised nor made machine code of."""

    @classmethod
    def of_bitcode(cls, codegen: Any, name: str, bitcode: bytes) -> _Library:
        """What was kept by `serialize_using_object_code`."""
        library = cls(codegen, name)
        library._shared_module = llvmlite.binding.parse_bitcode(bitcode)
        library._finalized = True
        return library

    def _optimize_final_module(self) -> None:
        """Leave it to what contains the code."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True

    def serialize_using_object_code(self) -> tuple[str, str, bytes]:
        """Name, kind and bitcode: what Numba keeps of a library; there is no object code."""
        self._ensure_finalized()
        return self.name, "part", self._get_module_for_linking().as_bitcode()


class _Uncallable:
    """Stands where Numba has a function that Python can call; kernels find their parts by it."""


@register_pass(mutates_CFG=True, analysis_only=False)
class _Lowering(typed_passes.NativeLowering):
    """Turns a function with types into LLVM code, and registers it for those that contain it."""

    _name = "part_lowering"

    def run_pass(self, state: Any) -> bool:
        state.library = _Library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        part = _Uncallable()
        state.targetctx.insert_user_function(part, state.cr.fndesc, [state.library])
        state.cr = state.cr._replace(cfunc=part)
        return True


class _Compiler(Compiler):
    """Numba's passes, but for the lowering."""

    def define_pipelines(self) -> list[Any]:
        pipelines: list[Any] = super().define_pipelines()
        for pipeline in pipelines:
            pipeline.passes = [
                (_Lowering if kind is typed_passes.NativeLowering else kind, text) for kind, text in pipeline.passes
            ]
            pipeline.finalize()
        return pipelines


class _Code(CompileResultCacheImpl):
    """How a part is kept: as bitcode, beside the machine code that is made of the kernel for Python."""

    _locator_classes = Code._locator_classes

    def get_filename_base(self, fullname: str, abiflags: str) -> str:
        return f"{super().get_filename_base(fullname, abiflags)}.part"

    def rebuild(self, target_context: Any, payload: Any) -> Any:
        """Load a part."""
        (name, _, bitcode), fndesc, environment, signature, *_ = payload
        return compile_result(
            target_context=target_context, typing_context=target_context.typing_context, signature=signature,
            library=_Library.of_bitcode(target_context.codegen(), name, bitcode), fndesc=fndesc,
            environment=environment, entry_point=_Uncallable(), objectmode=False, lifted=(), reload_init=(),
        )  # fmt: skip


class _PartCache(KernelCache):
    _impl_class = _Code


class _Kept(CPUDispatcher):  # type: ignore[misc]
    """A function whose code is kept on disk. Most are never asked for it: they look for the place when they are."""

    _kind: type[KernelCache]
    _found: Any

    @property
    def _cache(self) -> Any:
        if self._found is None:
            self._found = cache_of(self.py_func, self._kind)
        return self._found

    @_cache.setter
    def _cache(self, none: Any) -> None:
        """Numba begins with a cache that keeps nothing."""
        self._found = None


class _Part(_Kept):
    """A kernel as others contain it, for all types of arguments; Python cannot call it, nor can it call itself."""

    _kind = _PartCache

    def add_overload(self, cres: Any) -> None:
        """Remember what was compiled or loaded for types of arguments."""
        self.overloads[tuple(cres.signature.args)] = cres


class Kernel(_Kept):
    """A function that compiles at its first call; kernels that call it contain its `part`."""

    _kind = KernelCache

    @cached_property
    def part(self) -> _Part:
        """The function as kernels contain it."""
        options = {**self.targetoptions, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
        return _Part(self.py_func, self.locals, options, _Compiler)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """What Numba asks for the types of a call in a kernel."""
        return self.part.get_call_template(args, kws)

    def get_overload(self, sig: Any) -> Any:
        """What Numba asks for the code of a call in a kernel."""
        return self.part.get_overload(sig)

    def add_overload(self, cres: Any) -> None:
        """Remember what was compiled or loaded for types of arguments; parts in it find what they refer to."""
        for environment in cres._find_referenced_environments():
            cres.codegen.set_env(environment.env_name, environment)
        super().add_overload(cres)
