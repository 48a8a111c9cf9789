"""Kernels that others call by address instead of containing them.

Numba compiles a kernel anew as part of each kernel that calls it. Of large ones that costs more than the call.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import llvmlite.binding
from numba.core import cgutils, types
from numba.extending import intrinsic


def link(symbol: str) -> Callable[[int], None]:
    """A function for compiled code that calls the kernel offered as ``symbol`` with a whole number.

    LLVM ends the process where a kernel with it is loaded before that one has been offered.
    """

    @intrinsic  # type: ignore[misc]
    def call(typing_context: Any, number: Any) -> Any:
        def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            convention = context.call_conv
            kind = convention.get_function_type(types.none, (types.intp,))
            callee = cgutils.get_or_insert_function(builder.module, kind, symbol)
            convention.call_function(builder, callee, types.none, (types.intp,), arguments)
            return context.get_dummy_value()

        return types.void(types.intp), build

    called: Callable[[int], None] = call
    return called


def offer(symbol: str, kernel: Any) -> None:
    """Compile or load ``kernel``, which takes a whole number and raises nothing; others then call it as ``symbol``."""
    signature = types.void(types.intp)
    kernel.compile(signature)
    code = kernel.get_compile_result(signature)
    address = code.library.get_pointer_to_function(code.fndesc.llvm_func_name)
    llvmlite.binding.add_symbol(symbol, address)
