"""Exact solves on overlapping patches of degrees of freedom, as a smoother."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from ngsolve import BaseMatrix
from numpy.typing import NDArray

ABSENT = -1
"""Position of an entry that the matrix does not hold."""

AT_ONCE = 128
"""Patches that are looked up or inverted at once; bounds the memory that takes."""


class Patches:
    """x = Σ W R'ᵀ A_p⁻¹ R' r over patches p: the solves do not wait for each other, so they cost less than a product with A.

    W is one over the root of the number of patches that a degree of freedom is in. The inverses of the submatrices A_p are
    dense and kept in single precision, as a preconditioner may be; where an entry of A_p is found in A is looked up once.
    """

    def __init__(self, dofs: Sequence[Sequence[int]], matrix: BaseMatrix) -> None:
        _, columns, starts = (np.asarray(part) for part in matrix.CSR())
        by_length: dict[int, list[Sequence[int]]] = {}
        for patch in dofs:
            by_length.setdefault(len(patch), []).append(patch)
        self._groups = [np.array(group) for group in by_length.values()]
        self._all = np.concatenate([group.ravel() for group in self._groups])
        self._size = starts.size - 1
        self._weights = 1 / np.sqrt(np.maximum(np.bincount(self._all, minlength=self._size), 1))
        self._positions = [_positions(group, columns, starts.astype(np.intp)) for group in self._groups]
        self._inverses: list[NDArray] = [np.empty(at.shape, np.float32) for at in self._positions]

    def prepare(self, matrix: BaseMatrix) -> bool:
        """Invert the submatrices of `matrix`; False where one is singular."""
        values = np.asarray(matrix.CSR()[0])
        for positions, inverses in zip(self._positions, self._inverses, strict=True):
            for first in range(0, len(positions), AT_ONCE):
                part = positions[first : first + AT_ONCE]
                blocks = values[part]
                blocks[part == ABSENT] = 0.0
                try:
                    inverses[first : first + AT_ONCE] = np.linalg.inv(blocks)
                except np.linalg.LinAlgError:
                    return False
        return True

    def __call__(self, right: NDArray) -> NDArray:
        """The sum of the patches' corrections for a residual."""
        scale = float(np.abs(right).max()) or 1.0  # of single precision's range
        scaled = (right / scale).astype(np.float32)
        found = [
            np.matmul(inverses, scaled[group][:, :, None]).ravel()
            for group, inverses in zip(self._groups, self._inverses, strict=True)
        ]
        return scale * self._weights * np.bincount(self._all, np.concatenate(found), minlength=self._size)


def _positions(group: NDArray, columns: NDArray, starts: NDArray) -> NDArray:
    """Where the entries of submatrices are among those of the matrix, whose columns ascend in each row: by bisection."""
    found = np.empty((*group.shape, group.shape[1]), np.int32 if columns.size < 2**31 else np.int64)
    for first in range(0, len(group), AT_ONCE):
        part = group[first : first + AT_ONCE]
        wanted = part[:, None, :]
        low = np.repeat(starts[part][:, :, None], part.shape[1], axis=2)
        high = np.repeat(starts[part + 1][:, :, None], part.shape[1], axis=2) - 1
        while (low < high).any():
            middle = (low + high) // 2
            beyond = columns[middle] < wanted
            low = np.where(beyond, np.minimum(middle + 1, high), low)
            high = np.where(beyond, high, middle)
        found[first : first + AT_ONCE] = np.where(columns[low] == wanted, low, ABSENT)
    return found
