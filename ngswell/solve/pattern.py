"""Where the entries of a matrix are."""

from __future__ import annotations

import numpy as np
from ngsolve import BaseMatrix
from numpy.typing import NDArray


def rows_and_columns(matrix: BaseMatrix) -> tuple[NDArray, NDArray]:
    """Row and column of each entry, row by row; columns ascend."""
    columns, starts = (np.asarray(part) for part in matrix.CSR()[1:])
    return np.repeat(np.arange(matrix.height, dtype=np.int32), np.diff(starts).astype(np.intp)), columns
