"""A SIMD vector type for compiled code: one number in each of W lanes.

`load(array, i, j)` returns the W numbers of an item as one value. Arithmetic, comparison and
`select` act lane by lane with IEEE rounding, so the result of a lane depends neither on its place
nor on the other lanes. A plain number stands for W equal ones. For equal or unordered values `min`
and `max` return the second one; numba's `min` and `max` of numbers return the first. LLVM splits a
value that is wider than the machine's registers into several registers.

Arrays are those of `lane_array`: (rows, fields) of W doubles each, with the lanes contiguous.
"""

import math
import operator
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic as _intrinsic
from numba.extending import lower_builtin, models, register_model

intrinsic: Any = _intrinsic  # Any: type checkers would see a signature other than that of the calls


class Lanes(types.Type):
    """The numba type of one value that holds W numbers, or W booleans (a mask)."""

    def __init__(self, width: int, element: str) -> None:
        self.width, self.element = width, element
        super().__init__(name=f'Lanes({width} x {element})')

    @property
    def mask(self) -> 'Lanes':
        """Return the type of a comparison's result."""
        return Lanes(self.width, 'bool')


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager, lanes: Lanes) -> None:
        super().__init__(manager, lanes, _vector(lanes))


def _vector(lanes: Lanes) -> ir.VectorType:
    element = ir.DoubleType() if lanes.element == 'float64' else ir.IntType(1)
    return ir.VectorType(element, lanes.width)


def _of_array(array: Any) -> Lanes:
    return Lanes(array.width, 'float64')


def _pointer(context, builder, array_type, array, i, j, lanes):
    """Return the address of item (i, j) of a C-contiguous (n, k) array as a pointer to a vector."""
    struct = context.make_array(array_type)(context, builder, array)
    fields = builder.extract_value(struct.shape, 1)
    item = builder.add(builder.mul(i, fields), j)
    start = builder.bitcast(struct.data, _vector(lanes).as_pointer())
    return builder.gep(start, [item])


@intrinsic
def load(typing, array, i, j):
    """Return the lanes of array[i, j]."""
    lanes = _of_array(array)

    def generate(context, builder, signature, args):
        array, i, j = args
        pointer = _pointer(context, builder, signature.args[0], array, i, j, lanes)
        return builder.load(pointer, align=8)

    return lanes(array, types.intp, types.intp), generate


@intrinsic
def store(typing, array, i, j, value):
    """Write lanes, or the same number in every lane, to array[i, j]."""
    lanes = _of_array(array)
    value = value if isinstance(value, Lanes) else types.float64

    def generate(context, builder, signature, args):
        array, i, j, value = args
        pointer = _pointer(context, builder, signature.args[0], array, i, j, lanes)
        value = _broadcast(builder, value, _vector(lanes))
        builder.store(value, pointer, align=8)
        return context.get_dummy_value()

    return types.void(array, types.intp, types.intp, value), generate


def _broadcast(builder, value, vector):
    if value.type == vector:
        return value
    first = builder.insert_element(ir.Constant(vector, ir.Undefined), value, ir.IntType(32)(0))
    indices = ir.Constant(ir.VectorType(ir.IntType(32), vector.count), [0] * vector.count)
    return builder.shuffle_vector(first, first, indices)


@intrinsic
def select(typing, mask, a, b):
    """Return, lane by lane, `a` where `mask` is true, else `b`; a number for a boolean `mask`."""
    if not isinstance(mask, Lanes):
        return types.float64(types.boolean, types.float64, types.float64), _select_number
    lanes = Lanes(mask.width, 'float64')
    kinds = [x if isinstance(x, Lanes) else types.float64 for x in (a, b)]

    def generate(context, builder, signature, args):
        a, b = (_broadcast(builder, x, _vector(lanes)) for x in args[1:])
        return builder.select(args[0], a, b)

    return lanes(mask, *kinds), generate


def _select_number(context, builder, signature, args):
    return builder.select(*args)


@intrinsic
def negation(typing, mask):
    """Return the negation of a mask, lane by lane, or of a boolean."""

    def generate(context, builder, signature, args):
        return builder.not_(args[0])

    return mask(mask), generate


@intrinsic
def any_lane(typing, mask):
    """Return whether `mask` is true in some lane, to skip work that no lane needs."""

    def generate(context, builder, signature, args):
        bits = builder.bitcast(args[0], ir.IntType(mask.width))
        return builder.icmp_unsigned('!=', bits, ir.Constant(bits.type, 0))

    return types.boolean(mask), generate


@intrinsic
def like(typing, lanes, value):
    """Return the number `value` in as many lanes as `lanes` has; itself if `lanes` is a number."""

    def generate(context, builder, signature, args):
        return _broadcast(builder, args[1], args[0].type)

    return lanes(lanes, types.float64), generate


@intrinsic
def bits_of(typing, mask):
    """Return a mask of up to 64 lanes as an integer; bit i is lane i."""

    def generate(context, builder, signature, args):
        bits = builder.bitcast(args[0], ir.IntType(mask.width))
        return builder.zext(bits, ir.IntType(64)) if mask.width < 64 else bits

    return types.int64(mask), generate


@intrinsic
def mask_like(typing, lanes, bits):
    """Return the mask of the integer `bits` from `bits_of`, with as many lanes as `lanes` has."""

    def generate(context, builder, signature, args):
        bits = builder.trunc(args[1], ir.IntType(lanes.width)) if lanes.width < 64 else args[1]
        return builder.bitcast(bits, _vector(lanes.mask))

    return lanes.mask(lanes, types.int64), generate


@intrinsic
def scale_of(typing, shifted):
    """Return 2^k, where k is the integer in the low bits of the significand of `shifted`.

    `shifted` is a number or lanes.
    """
    kind = shifted if isinstance(shifted, Lanes) else types.float64

    def generate(context, builder, signature, args):
        double = args[0].type
        integer = ir.IntType(64)
        if isinstance(double, ir.VectorType):
            integer = ir.VectorType(integer, double.count)
        shift, one = (_constant(integer, c) for c in (52, 0x3FF0000000000000))
        bits = builder.shl(builder.bitcast(args[0], integer), shift)
        return builder.bitcast(builder.add(bits, one), double)

    return kind(kind), generate


def _constant(kind, value):
    return ir.Constant(kind, [value] * kind.count if isinstance(kind, ir.VectorType) else value)


def _declare(function: Any, emit: Any, *, masks: bool = False, compares: bool = False) -> None:
    """Define `function` of one or two arguments on lanes by LLVM's instruction `emit`."""
    element = 'bool' if masks else 'float64'

    def is_lanes(x: Any) -> bool:
        return isinstance(x, Lanes) and x.element == element

    @infer_global(function)
    class Template(AbstractTemplate):
        def generic(self, args, kws):
            lanes: Any = next((x for x in args if is_lanes(x)), None)
            numbers = isinstance(lanes, Lanes) and all(
                x == lanes or (not masks and isinstance(x, types.Number)) for x in args
            )
            if kws or len(args) > 2 or not numbers:
                return None
            kinds = [x if x == lanes else types.float64 for x in args]
            return signature(lanes.mask if compares else lanes, *kinds)

    def generate(context, builder, sig, args):
        lanes = next(x for x in sig.args if is_lanes(x))
        return emit(builder, *(_broadcast(builder, x, _vector(lanes)) for x in args))

    lower_builtin(function, Lanes)(generate)
    for kinds in ((Lanes, Lanes), (Lanes, types.Float), (types.Float, Lanes)):
        lower_builtin(function, *kinds)(generate)


def _call(name: str) -> Any:
    def emit(builder, *args):
        vector = args[0].type
        of_type = ir.FunctionType(vector, [vector] * len(args))
        function = cgutils.get_or_insert_function(
            builder.module, of_type, f'{name}.v{vector.count}f64'
        )
        return builder.call(function, args)

    return emit


def _compare(symbol: str) -> Any:
    return lambda builder, a, b: builder.fcmp_ordered(symbol, a, b)


def _lesser(builder, a, b):
    return builder.select(builder.fcmp_ordered('<', a, b), a, b)


def _greater(builder, a, b):
    return builder.select(builder.fcmp_ordered('>', a, b), a, b)


for _function in (operator.add, operator.iadd):
    _declare(_function, lambda builder, a, b: builder.fadd(a, b))
for _function in (operator.sub, operator.isub):
    _declare(_function, lambda builder, a, b: builder.fsub(a, b))
_declare(operator.mul, lambda builder, a, b: builder.fmul(a, b))
_declare(operator.truediv, lambda builder, a, b: builder.fdiv(a, b))
_declare(operator.neg, lambda builder, a: builder.fneg(a))
_declare(abs, _call('llvm.fabs'))
_declare(math.sqrt, _call('llvm.sqrt'))
_declare(min, _lesser)
_declare(max, _greater)
for _function, _symbol in (
    (operator.lt, '<'), (operator.le, '<='), (operator.gt, '>'), (operator.ge, '>='),
    (operator.eq, '=='),
):
    _declare(_function, _compare(_symbol), compares=True)
_declare(operator.and_, lambda builder, a, b: builder.and_(a, b), masks=True)
_declare(operator.or_, lambda builder, a, b: builder.or_(a, b), masks=True)
_declare(operator.invert, lambda builder, a: builder.not_(a), masks=True)
