"""Operations on tuples of lane arrays: load, store, compare and select one item of each."""

from typing import Any

from numba.extending import overload

from sim_node.numerics.dispatch import INLINED
from sim_node.numerics.lanes import load, select, store


def load_each(arrays: Any, i: Any, j: Any) -> Any:
    """Return the lanes of array[i, j] of each lane array of a tuple, as a tuple."""
    raise NotImplementedError('compiled code only')


@overload(load_each, jit_options=INLINED)
def _load_each(arrays, i, j):
    if len(arrays) == 0:
        return lambda arrays, i, j: ()
    return lambda arrays, i, j: (load(arrays[0], i, j), *load_each(arrays[1:], i, j))


def store_each(arrays: Any, i: Any, j: Any, values: Any) -> None:
    """Write each of a tuple of values (lanes or numbers) to array[i, j] of its lane array."""
    raise NotImplementedError('compiled code only')


@overload(store_each, jit_options=INLINED)
def _store_each(arrays, i, j, values):
    if len(arrays) == 0:
        return lambda arrays, i, j, values: None

    def write(arrays, i, j, values):
        store(arrays[0], i, j, values[0])
        store_each(arrays[1:], i, j, values[1:])

    return write


def all_equal(mask: Any, lanes: Any, values: Any) -> Any:
    """Return the mask of lanes where `mask` is true and all items of two tuples are equal."""
    raise NotImplementedError('compiled code only')


@overload(all_equal, jit_options=INLINED)
def _all_equal(mask, lanes, values):
    if len(lanes) == 0:
        return lambda mask, lanes, values: mask
    return lambda mask, lanes, values: all_equal(
        mask & (lanes[0] == values[0]), lanes[1:], values[1:]
    )


def select_each(mask: Any, values: Any, lanes: Any) -> Any:
    """Return, lane by lane, the items of tuple `values` where `mask` is true, else of `lanes`."""
    raise NotImplementedError('compiled code only')


@overload(select_each, jit_options=INLINED)
def _select_each(mask, values, lanes):
    if len(lanes) == 0:
        return lambda mask, values, lanes: ()
    return lambda mask, values, lanes: (
        select(mask, values[0], lanes[0]), *select_each(mask, values[1:], lanes[1:])
    )
