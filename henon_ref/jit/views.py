"""Views of numbers in memory, for compiled code: pointers, and rows of one width, in place of numba's arrays.

An array comes with sizes and strides, and a call hands it on as seven to eleven words; an entry is looked up with care
for places below zero, a slice with care for places that are not there: thirty to fifty lines for LLVM, and two hundred.
Here a row is a pointer, and rows of one width are a pointer and that width. Whoever has a view knows how far it goes.
"""

from __future__ import annotations

import operator
from typing import Any

from llvmlite import ir
from numba import float64, int64, types
from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_model


class Rows(types.Type):
    """Type of rows of one width: ``rows[i, j]`` is a number, ``rows[i]`` a pointer to a row."""

    def __init__(self, dtype: types.Type) -> None:
        self.dtype = dtype
        super().__init__(name=f"Rows({dtype})")


DOUBLES, INTEGERS = types.CPointer(float64), types.CPointer(int64)
"""Types of a row of numbers."""
GRID, TABLE = Rows(float64), Rows(int64)


@register_model(Rows)
class _RowsModel(models.StructModel):
    def __init__(self, manager: Any, kind: Rows) -> None:
        super().__init__(manager, kind, [("data", types.CPointer(kind.dtype)), ("width", int64)])


@infer_global(operator.getitem)
class _Entry(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        rows, place = args
        if isinstance(rows, Rows) and isinstance(place, types.Integer):
            return signature(types.CPointer(rows.dtype), rows, int64)
        if isinstance(rows, Rows) and isinstance(place, types.BaseTuple):
            return signature(rows.dtype, rows, types.UniTuple(int64, 2))
        return None


@infer_global(operator.setitem)
class _SetEntry(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        rows, place, _ = args
        if isinstance(rows, Rows) and isinstance(place, types.BaseTuple):
            return signature(types.none, rows, types.UniTuple(int64, 2), rows.dtype)
        return None


@lower_builtin(operator.getitem, Rows, types.Integer)
def _row(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return begin_of_row(builder, *args)


@lower_builtin(operator.getitem, Rows, types.UniTuple)
def _number(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    row, place = cgutils.unpack_tuple(builder, args[1])
    return builder.load(builder.gep(begin_of_row(builder, args[0], row), [place]))


@lower_builtin(operator.setitem, Rows, types.UniTuple, types.Any)
def _set_number(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    row, place = cgutils.unpack_tuple(builder, args[1])
    builder.store(args[2], builder.gep(begin_of_row(builder, args[0], row), [place]))
    return context.get_dummy_value()


def begin_of_row(builder: Any, rows: Any, row: Any) -> Any:
    """Where a row begins."""
    data, width = builder.extract_value(rows, 0), builder.extract_value(rows, 1)
    return builder.gep(data, [builder.mul(row, width)])


def begin_of(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """Where the numbers of a view, or of an array that is C-contiguous, begin."""
    if isinstance(kind, Rows):
        return builder.extract_value(value, 0)
    return value if isinstance(kind, types.CPointer) else context.make_array(kind)(context, builder, value=value).data


@intrinsic
def row_of(typing, array):  # type: ignore[no-untyped-def]
    """The numbers of an array, one after the other."""

    def codegen(context, builder, sig, args):  # type: ignore[no-untyped-def]
        return begin_of(context, builder, array, args[0])

    return types.CPointer(array.dtype)(array), codegen


@intrinsic
def integers_in(typing, row):  # type: ignore[no-untyped-def]
    """A row of doubles as the integers that it holds."""

    def codegen(context, builder, sig, args):  # type: ignore[no-untyped-def]
        return builder.bitcast(args[0], ir.IntType(64).as_pointer())

    return INTEGERS(DOUBLES), codegen


@intrinsic
def row_at(typing, address):  # type: ignore[no-untyped-def]
    """The doubles at an address."""

    def codegen(context, builder, sig, args):  # type: ignore[no-untyped-def]
        return builder.inttoptr(args[0], ir.DoubleType().as_pointer())

    return DOUBLES(int64), codegen


@intrinsic
def rows_of(typing, row, width):  # type: ignore[no-untyped-def]
    """A row cut into rows of a width."""
    kind = Rows(row.dtype)

    def codegen(context, builder, sig, args):  # type: ignore[no-untyped-def]
        return _made(context, builder, kind, *args)

    return kind(row, int64), codegen


@intrinsic
def rest_of(typing, view, first):  # type: ignore[no-untyped-def]
    """A row from a place on, or rows from one of them on (of an array of one dimension: a row)."""
    kind = view if isinstance(view, Rows) else types.CPointer(view.dtype)

    def codegen(context, builder, sig, args):  # type: ignore[no-untyped-def]
        if isinstance(kind, Rows):
            return _made(context, builder, kind, begin_of_row(builder, *args), builder.extract_value(args[0], 1))
        return builder.gep(begin_of(context, builder, view, args[0]), [args[1]])

    return kind(view, int64), codegen


@intrinsic
def rows_in(typing, arrays, place):  # type: ignore[no-untyped-def]
    """One of several arrays of rows: of an array of three dimensions."""
    kind = Rows(arrays.dtype)

    def codegen(context, builder, sig, args):  # type: ignore[no-untyped-def]
        array = context.make_array(arrays)(context, builder, value=args[0])
        _, count, width = cgutils.unpack_tuple(builder, array.shape)
        first = builder.mul(args[1], builder.mul(count, width))
        return _made(context, builder, kind, builder.gep(array.data, [first]), width)

    return kind(arrays, int64), codegen


def _made(context: Any, builder: Any, kind: Rows, data: Any, width: Any) -> Any:
    rows = cgutils.create_struct_proxy(kind)(context, builder)
    rows.data, rows.width = data, width
    return rows._getvalue()
