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
