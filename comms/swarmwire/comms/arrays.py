"""Type names for the arrays that cross the contract; shapes, units and frames stand with each field."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]  # float64
IntArray = NDArray[np.int64]  # int64
BoolArray = NDArray[np.bool_]  # bool
ByteArray = NDArray[np.uint8]  # uint8
KeyArray = NDArray[np.uint64]  # uint64: keys of draws
AnyArray = NDArray[Any]  # of any type
