"""Arrays of lanes, (rows, fields) of W doubles each, and their type in compiled code."""

from typing import Any

import numpy as np
from numba.core import types
from numba.extending import models, register_model, typeof_impl
from numba.np.numpy_support import from_dtype

_ALIGNMENT = 64


def dtype(width: int) -> np.dtype:
    """Return the dtype of arrays whose items are `width` doubles, one per robot."""
    return np.dtype([('lane', np.float64, (width,))], align=True)


class LaneArray(np.ndarray):
    """An array of `dtype(width)`; array['lane'] is its floats.

    Its type in compiled code is `LaneArrayType`. Its items and slices are plain numpy arrays.
    """

    def __getitem__(self, key: Any) -> Any:
        """Return an item or slice as a plain numpy array has it."""
        return self.view(np.ndarray)[key]


class LaneArrayType(types.Array):
    """The numba type of a `LaneArray`, with the width in its name.

    In the names of compiled functions, numba writes an array of records with a number for the
    record that depends on the order in which a process created its types. Functions for two widths
    that two processes write to the cache could then have the same name, and a third process could
    call the wrong one.
    """

    def __init__(self, record: types.Record) -> None:
        (_, field), = record.fields.items()
        self.width: int = field.type.shape[0]
        super().__init__(record, 2, 'C', name=f'LaneArray({self.width})')

    @property
    def mangling_args(self) -> tuple[str, tuple[object, ...]]:
        """Return the name as that of a type without parameters."""
        return self.name, ()


register_model(LaneArrayType)(models.ArrayModel)


@typeof_impl.register(LaneArray)
def _typeof_lane_array(array: LaneArray, context: Any) -> LaneArrayType | None:
    whole = array.ndim == 2 and array.flags.c_contiguous and array.dtype.names == ('lane',)
    return LaneArrayType(from_dtype(array.dtype)) if whole else None


def zeros(shape: tuple[int, int], width: int) -> LaneArray:
    """Return an array of zeros of `dtype(width)`, aligned to 64 bytes."""
    n_bytes = shape[0] * shape[1] * width * 8
    buffer = np.zeros(n_bytes + _ALIGNMENT, dtype=np.uint8)
    start = -buffer.ctypes.data % _ALIGNMENT
    return buffer[start : start + n_bytes].view(dtype(width)).reshape(shape).view(LaneArray)
