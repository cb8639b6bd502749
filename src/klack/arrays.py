"""Names of the arrays in signatures; their shapes stand where they are used."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["Complexes", "Cube", "Flags", "Floats", "Index", "Ints", "Matrix", "Vector"]

Floats = NDArray[np.float64]
Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Cube = NDArray[np.float64]
Ints = NDArray[np.int64]
Index = NDArray[np.int64]
Complexes = NDArray[np.complex128]
Flags = NDArray[np.bool_]
