"""Compiles equations of small matrices to straight code: no loops, numbers in registers, two sides at once.

A function under `unrolled` runs once, while a kernel that calls it compiles. It computes with NumPy arrays of `Number`,
each of which stands for a register, and what it does to them becomes the code: so loops are unrolled, products with
zeros and ones of a matrix disappear, and equations stay as they are written, A @ B.

A row is named by a whole number or by a pair of them. Of a pair, both rows go through the same instructions, side by
side in a register of two lanes. A sum with a product is rounded once, as `math.fma`, on every machine: the bits depend
neither on what LLVM would fuse nor on the width of a processor's registers.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.errors import TypingError
from numba.extending import intrinsic
from numba.np.arrayobj import make_array
from numpy.typing import NDArray

Matrix = NDArray[Any]
"""An array of `Number`, and of zeros and ones where the equations have them."""

_REAL, _BYTE = ir.DoubleType(), ir.IntType(8)


class Number:
    """A real number in a register, or one for each of two lanes; ``factors`` are those of a product."""

    def __init__(self, code: _Code, value: Any, factors: tuple[Any, Any] | None = None) -> None:
        self._code, self._value, self.factors = code, value, factors

    @property
    def value(self) -> Any:
        """The register; of a product, which may never be needed by itself, as soon as it is read."""
        if self._value is None:
            self._value = self._code.builder.fmul(*self.factors)
        return self._value

    def __add__(self, other: Number | float) -> Number:
        if isinstance(other, Number):
            return self._code.sum(self, other, 1.0)
        return self if other == 0 else self + self._code.constant(other)

    __radd__ = __add__

    def __sub__(self, other: Number | float) -> Number:
        if isinstance(other, Number):
            return self._code.sum(self, other, -1.0)
        return self if other == 0 else self - self._code.constant(other)

    def __rsub__(self, other: float) -> Number:
        return -self if other == 0 else self._code.constant(other) - self

    def __mul__(self, other: Number | float) -> Number | float:
        if isinstance(other, Number):
            return Number(self._code, None, (self.value, other.value))
        if other == 0:
            return 0.0
        return self if other == 1 else -self if other == -1 else self * self._code.constant(other)

    __rmul__ = __mul__

    def __rtruediv__(self, other: float) -> Number:
        return Number(self._code, self._code.builder.fdiv(self._code.constant(other).value, self.value))

    def __neg__(self) -> Number:
        if self.factors:
            return Number(self._code, None, (self._code.builder.fneg(self.factors[0]), self.factors[1]))
        return Number(self._code, self._code.builder.fneg(self.value))


class _Code:
    """The code of one call, as it is built, for ``lanes`` lanes."""

    def __init__(self, builder: Any, lanes: int) -> None:
        self.builder, self.lanes = builder, lanes
        self.kind = _REAL if lanes == 1 else ir.VectorType(_REAL, lanes)
        three = ir.FunctionType(self.kind, [self.kind] * 3)
        self._fma = builder.module.declare_intrinsic("llvm.fma.f64" if lanes == 1 else "llvm.fma.v2f64", (), three)

    def constant(self, number: float) -> Number:
        return Number(self, ir.Constant(self.kind, float(number) if self.lanes == 1 else [float(number)] * self.lanes))

    def sum(self, a: Number, b: Number, sign: float) -> Number:
        """The number a + sign b; a product among them, b where both are, is added without rounding it first."""
        if b.factors:
            p, q = b.factors
            return Number(self, self.builder.call(self._fma, [p if sign > 0 else self.builder.fneg(p), q, a.value]))
        if a.factors:
            return Number(self, self.builder.call(self._fma, [*a.factors, b.value if sign > 0 else (-b).value]))
        add = self.builder.fadd if sign > 0 else self.builder.fsub
        return Number(self, add(a.value, b.value))

    def load(self, addresses: list[Any]) -> Any:
        values = [self.builder.load(address) for address in addresses]
        return values[0] if self.lanes == 1 else self.join(values, self.kind)

    def join(self, values: list[Any], kind: Any) -> Any:
        out = ir.Constant(kind, ir.Undefined)
        for lane, value in enumerate(values):
            out = self.builder.insert_element(out, value, ir.Constant(ir.IntType(32), lane))
        return out

    def store(self, value: Any, addresses: list[Any]) -> None:
        for lane, address in enumerate(addresses):
            one = value if self.lanes == 1 else self.builder.extract_element(value, ir.Constant(ir.IntType(32), lane))
            self.builder.store(one, address)


class Rows:
    """An array in memory as rows of a given shape; ``rows[i]`` loads and stores those of the row or pair ``i``."""

    def __init__(self, code: _Code, data: Any, shape: tuple[int, ...]) -> None:
        self._code, self._data, self._shape = code, data, shape

    def _addresses(self, lanes: list[Any]) -> list[list[Any]]:
        """For each number of a row, its addresses in the lanes."""
        builder, size = self._code.builder, int(np.prod(self._shape, dtype=int))
        word = ir.IntType(64)
        starts = [builder.gep(self._data, [builder.mul(row, ir.Constant(word, size))]) for row in lanes]
        return [[builder.gep(start, [ir.Constant(word, k)]) for start in starts] for k in range(size)]

    def __getitem__(self, lanes: list[Any]) -> Matrix:
        numbers = [Number(self._code, self._code.load(at)) for at in self._addresses(lanes)]
        return np.array(numbers, dtype=object).reshape(self._shape)

    def __setitem__(self, lanes: list[Any], matrix: Matrix) -> None:
        for number, at in zip(matrix.flat, self._addresses(lanes), strict=True):
            if number is not None:
                self._code.store(self._number(number).value, at)

    def _number(self, number: Number | float) -> Number:
        return number if isinstance(number, Number) else self._code.constant(number)


class Flags(Rows):
    """An array of flags in memory."""

    def choose(self, lanes: list[Any], yes: Matrix, no: float) -> Matrix:
        """Where the flag of the row or pair ``lanes`` is not set, ``yes``, else ``no``."""
        code, builder = self._code, self._code.builder
        unset = ir.Constant(_BYTE, 0)
        bits = [builder.icmp_unsigned("==", builder.load(at), unset) for at in self._addresses(lanes)[0]]
        mask = bits[0] if code.lanes == 1 else code.join(bits, ir.VectorType(ir.IntType(1), code.lanes))
        other = code.constant(no).value
        chosen = [None if x is None else Number(code, builder.select(mask, x.value, other)) for x in yes.flat]
        return np.array(chosen, dtype=object).reshape(yes.shape)


def unrolled(**shapes: tuple[int, ...]) -> Callable[[Callable[..., None]], Any]:
    """Compile a function of rows and arrays, whose rows have these ``shapes``, into the kernels that call it.

    Its arguments without a shape are rows: whole numbers, or pairs of them, all alike. Arrays must be contiguous, their
    rows are counted in that order, whatever their leading axes.
    """

    def decorate(function: Callable[..., None]) -> Any:
        names = list(inspect.signature(function).parameters)

        def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            kinds = signature.args
            code = _Code(builder, 2 if any(isinstance(kind, types.BaseTuple) for kind in kinds) else 1)
            given: list[Any] = []
            for name, kind, value in zip(names, kinds, arguments, strict=True):
                if name not in shapes:
                    rows = types.UniTuple(types.int64, 2) if code.lanes == 2 else types.int64
                    value = context.cast(builder, value, kind, rows)
                    given.append(cgutils.unpack_tuple(builder, value) if code.lanes == 2 else [value])
                elif isinstance(kind, types.NoneType):
                    given.append(None)
                else:
                    group = Flags if kind.dtype == types.boolean else Rows
                    given.append(group(code, make_array(kind)(context, builder, value).data, shapes[name]))
            function(*given)
            return context.get_dummy_value()

        def typed(typing_context: Any, *kinds: Any) -> Any:
            for name, kind in zip(names, kinds, strict=True):
                array = isinstance(kind, types.NoneType) or (isinstance(kind, types.Array) and kind.layout == "C")
                if name in shapes and not array:
                    raise TypingError(f"'{name}' of {function.__name__} must be a contiguous array, not {kind}")
            return types.void(*kinds), build

        typed.__name__ = function.__name__
        parameters = ["typing_context", *names]
        typed.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
            [inspect.Parameter(name, inspect.Parameter.POSITIONAL_OR_KEYWORD) for name in parameters]
        )
        return intrinsic(typed)

    return decorate


# --- matrices of equations ------------------------------------------------------------------------


def symmetric(A: Matrix) -> Matrix:
    """The symmetric matrix that has the lower half of ``A``."""
    return np.where(np.tri(len(A), dtype=bool), A, A.T)


def lower(A: Matrix) -> Matrix:
    """The lower half of ``A``: None, which `Rows` do not store, in place of the rest."""
    half = A.copy()
    half[np.triu_indices(len(A), 1)] = None
    return half


def cross_matrix(r: Matrix) -> Matrix:
    """The matrix [r] of the product r ×."""
    x, y, z = r
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]], dtype=object)
