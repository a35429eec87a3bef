"""Type names for numpy arrays; a field of these types states its shape, unit and frame."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]  # float64
IntArray = NDArray[np.int64]  # int64
BoolArray = NDArray[np.bool_]  # bool
ByteArray = NDArray[np.uint8]  # uint8
SignedByteArray = NDArray[np.int8]  # int8
KeyArray = NDArray[np.uint64]  # uint64: keys of draws
AnyArray = NDArray[Any]  # any type
Table = NDArray[np.void]  # rows are records of named fields


def record_type(fields: list[tuple[Any, ...]]) -> np.dtype[np.void]:
    """Return the type of records with these fields, which are attributes with and without the compiler."""
    return np.dtype((np.record, np.dtype(fields, align=True)))


def writeable(array: AnyArray) -> AnyArray:
    """Return the array, or a copy of a read-only one from the wire.

    A kernel would be compiled once more for read-only arrays.
    """
    return array if array.flags.writeable else array.copy()
