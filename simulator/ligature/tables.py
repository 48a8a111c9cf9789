"""Hands groups of arrays to compiled code as tables of their addresses and shapes.

A rod's tick works on some 150 arrays; handing them over one by one took a third of its time.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import typeof, types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.arrayobj import make_array, populate_array
from numba.np.numpy_support import as_dtype
from numpy.typing import NDArray


def table_of(group: NamedTuple) -> NDArray[np.int64]:
    """Addresses and shapes of the arrays of ``group``, or of groups in it, for the function that `opener` makes.

    Valid as long as the group lives. Raises ValueError for an array that is not contiguous.
    """
    return np.array(_words(group), dtype=np.int64)


def _words(group: NamedTuple) -> list[int]:
    words: list[int] = []
    for name, item in zip(group._fields, group, strict=True):
        if isinstance(item, tuple):
            words += _words(item)  # type: ignore[arg-type]
        elif not item.flags.c_contiguous:
            raise ValueError(f"array '{name}' is not contiguous; copy it with numpy.ascontiguousarray")
        else:
            words += [item.ctypes.data, *item.shape]
    return words


@intrinsic  # type: ignore[misc]
def copy_into(typing_context: Any, target: Any, source: Any) -> Any:
    """Copy a contiguous array over another of the same shape and type, both in compiled code."""
    if not (isinstance(source, types.Array) and source.layout == "C" and target == source):
        return None

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        to, origin = (make_array(target)(context, builder, value) for value in arguments)
        cgutils.raw_memcpy(builder, to.data, origin.data, origin.nitems, origin.itemsize)
        return context.get_dummy_value()

    return types.void(target, source), build


def opener(example: NamedTuple) -> Callable[[Any], Any]:
    """A function for compiled code that turns a table, or its address, into a group of the types of ``example``."""
    kind = typeof(example)

    @intrinsic  # type: ignore[misc]
    def open_table(typing_context: Any, table: Any) -> Any:
        address = isinstance(table, types.Integer)

        def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            if address:
                words = builder.inttoptr(arguments[0], ir.IntType(64).as_pointer())
            else:
                words = make_array(signature.args[0])(context, builder, arguments[0]).data
            return _group_at(context, builder, kind, words, 0)[0]

        return kind(types.intp if address else types.Array(types.int64, 1, "C")), build

    opened: Callable[[Any], Any] = open_table
    return opened


def _group_at(context: Any, builder: Any, kind: Any, words: Any, at: int) -> tuple[Any, int]:
    """A group of numba type ``kind`` from the words at index ``at``, and the index after it."""
    items = []
    for item in kind.types:
        if isinstance(item, types.BaseTuple):
            group, at = _group_at(context, builder, item, words, at)
            items.append(group)
        else:
            row = [builder.load(cgutils.gep_inbounds(builder, words, at + i)) for i in range(1 + item.ndim)]
            at += len(row)
            items.append(_array_at(context, builder, item, row[0], row[1:]))
    return context.make_tuple(builder, kind, items), at


def _array_at(context: Any, builder: Any, kind: Any, address: Any, shape: list[Any]) -> Any:
    """A contiguous array of numba type ``kind`` over the memory at ``address``."""
    item = ir.Constant(ir.IntType(64), as_dtype(kind.dtype).itemsize)
    strides = [item]
    for size in reversed(shape[1:]):
        strides.insert(0, builder.mul(strides[0], size))
    array = make_array(kind)(context, builder)
    data = builder.inttoptr(address, array.data.type)
    populate_array(array, data=data, shape=shape, strides=strides, itemsize=item, meminfo=None)
    return array._getvalue()
