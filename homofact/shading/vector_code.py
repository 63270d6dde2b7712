"""Vector operations that loops in numba cannot express: adjacent numbers are read, mixed and written as one vector.

A fetch needs the channels of four texels, which are adjacent in memory; a loop over pairs of directions would gather
each number separately. Directions are read and values are written as three numbers per pair, while everything else is
computed for many pairs at once; a compiler splits these accesses into single numbers. These functions use the vectors
of the compiler (LLVM), which map to the instructions of every processor. Only kernels of numba can call them.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

LANES = 16
_FLOAT, _PLACE, _LANE = ir.FloatType(), ir.IntType(64), ir.IntType(32)
_FAST = ("fast",)


@cache
def bilinear(channels: int) -> Any:
    """Return `bilinear(texels, at, right, above, u, v, out, place)`: the value between four texels, into out[place …].

    A texel is `channels` float32 side by side (1, 2 or 4); the first texel begins at the index `at`, and its right and
    upper neighbours are `right` and `above` floats further. u and v in [0, 1] are the weights of the right and the
    upper texels. There are no bounds checks.
    """

    @intrinsic
    def function(_, texels, at, right, above, u, v, out, place):
        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            source, target = (_pointer(context, builder, signature, given, k) for k in (0, 6))
            first, step, line, start = (_index(builder, given[k]) for k in (1, 2, 3, 7))
            over = builder.add(first, line)
            low, low_right, high, high_right = (
                _load(builder, source, place, channels)
                for place in (first, builder.add(first, step), over, builder.add(over, step))
            )
            across, up = (_repeated(builder, given[k], channels) for k in (4, 5))
            value = _mixed(
                builder, _mixed(builder, low, low_right, across), _mixed(builder, high, high_right, across), up
            )
            _store(builder, value, target, start)
            return context.get_dummy_value()

        return types.void(texels, at, right, above, u, v, out, place), generate

    return function


@cache
def apart(stride: int, kept: int) -> Any:
    """Return `apart(source, begin, out, place, step)`, which splits `LANES` groups of `stride` numbers into rows.

    The groups start at source[begin]. The first numbers of all groups are written to out[place …], the second numbers
    `step` entries further, and so on for `kept` numbers per group.
    """

    @intrinsic
    def function(_, source, begin, out, place, step):
        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            read, written = (_pointer(context, builder, signature, given, k) for k in (0, 2))
            whole = _load(builder, read, _index(builder, given[1]), LANES * stride)
            to, further = (_index(builder, given[k]) for k in (3, 4))
            for k in range(kept):
                _store(builder, _picked(builder, whole, [k + stride * lane for lane in range(LANES)]), written, to)
                to = builder.add(to, further)
            return context.get_dummy_value()

        return types.void(source, begin, out, place, step), generate

    return function


@cache
def together(stride: int) -> Any:
    """Return `together(source, place, step, out, begin)`, the inverse of `apart` for groups of `stride` numbers."""

    @intrinsic
    def function(_, source, place, step, out, begin):
        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            read, written = (_pointer(context, builder, signature, given, k) for k in (0, 3))
            of, further = (_index(builder, given[k]) for k in (1, 2))
            whole = _load(builder, read, of, LANES)
            for _ in range(stride - 1):
                of = builder.add(of, further)
                whole = _joined(builder, whole, _load(builder, read, of, LANES))
            order = [lane % stride * LANES + lane // stride for lane in range(LANES * stride)]
            _store(builder, _picked(builder, whole, order), written, _index(builder, given[4]))
            return context.get_dummy_value()

        return types.void(source, place, step, out, begin), generate

    return function


def _pointer(context: Any, builder: Any, signature: Any, given: Any, k: int) -> Any:
    """Where the numbers of the array that is argument number k begin."""
    return context.make_array(signature.args[k])(context, builder, given[k]).data


def _index(builder: Any, value: Any) -> Any:
    """An index of whatever width, never negative, as one of 64 bits."""
    return value if value.type.width == _PLACE.width else builder.zext(value, _PLACE)


def _vector(count: int) -> Any:
    return ir.VectorType(_FLOAT, count)


def _at(builder: Any, begin: Any, place: Any, kind: Any) -> Any:
    return builder.bitcast(builder.gep(begin, [place]), kind.as_pointer())


def _load(builder: Any, begin: Any, place: Any, count: int) -> Any:
    vector = builder.load(_at(builder, begin, place, _vector(count)))
    vector.align = 4  # of a float: arrays need not begin where a vector would
    return vector


def _store(builder: Any, value: Any, begin: Any, place: Any) -> None:
    builder.store(value, _at(builder, begin, place, value.type)).align = 4


def _picked(builder: Any, vector: Any, order: list[int], other: Any = None) -> Any:
    """The numbers of a vector, and of another of its size counted on behind them, in an order."""
    second = ir.Constant(vector.type, ir.Undefined) if other is None else other
    return builder.shuffle_vector(vector, second, ir.Constant(ir.VectorType(_LANE, len(order)), order))


def _joined(builder: Any, first: Any, second: Any) -> Any:
    """Two vectors, the second one no longer than the first, one behind the other."""
    size, more = first.type.count, second.type.count
    if more < size:
        second = _picked(builder, second, [*range(more), *([0] * (size - more))])
    return _picked(builder, first, [*range(size), *range(size, size + more)], second)


def _repeated(builder: Any, value: Any, count: int) -> Any:
    one = builder.insert_element(ir.Constant(_vector(count), ir.Undefined), value, _LANE(0))
    return _picked(builder, one, [0] * count)


def _mixed(builder: Any, low: Any, high: Any, share: Any) -> Any:
    """low + share (high − low)."""
    difference = builder.fsub(high, low, flags=_FAST)
    return builder.fadd(low, builder.fmul(share, difference, flags=_FAST), flags=_FAST)


VECTOR_CODE: dict[str, Callable[..., Any]] = {"bilinear": bilinear, "apart": apart, "together": together}
