"""Exact solves on overlapping patches of degrees of freedom, as a smoother."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from ngsolve import BaseMatrix
from numpy.typing import NDArray

from ngswell.solve.entries import ABSENT, Entries
from ngswell.team import ALONE, Team

AT_ONCE = 128
"""Patches that are inverted at once; bounds the memory that takes."""


class Patches:
    """x = Σ W R'ᵀ A_p⁻¹ R' r over patches p: the solves do not wait for each other, so they cost less than a product with A.

    W is one over the root of the number of patches that a degree of freedom is in. The inverses of the submatrices A_p are
    dense and kept in single precision, as a preconditioner may be; where an entry of A_p is found in A is looked up once.

    Of several ranks each has some patches, with the degrees of freedom `dofs`, and the others' shares of their entries.
    """

    def __init__(self, dofs: Sequence[Sequence[int]], matrix: BaseMatrix, team: Team = ALONE) -> None:
        by_length: dict[int, list[Sequence[int]]] = {}
        for patch in dofs:
            by_length.setdefault(len(patch), []).append(patch)
        self._groups = [np.array(group) for group in by_length.values()]
        self._all = np.concatenate([np.empty(0, dtype=int), *(group.ravel() for group in self._groups)])
        self.unknowns = np.unique(self._all)
        """The degrees of freedom in a patch."""
        self._size, self._team = matrix.height, team
        counts = np.bincount(self._all, minlength=self._size)
        team.sum_values(counts)
        self._weights = 1 / np.sqrt(np.maximum(counts, 1))
        self._entries = Entries(matrix, self.unknowns, team)
        self._positions = [self._entries.of_submatrices(group) for group in self._groups]
        self._inverses: list[NDArray] = [np.empty(at.shape, np.float32) for at in self._positions]

    def prepare(self, matrix: BaseMatrix) -> bool:
        """Invert the submatrices of `matrix`; False where one is singular, on whichever rank."""
        return self._team.all(self._inverted(self._entries.values(matrix)))

    def _inverted(self, values: NDArray) -> bool:
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
        """The sum of the patches' corrections for a residual, of ranks the share of each."""
        largest = np.array([np.abs(right).max()])
        self._team.most_values(largest)  # else ranks would round to single precision in other places than one does
        scale = float(largest[0]) or 1.0  # of single precision's range
        scaled = (right / scale).astype(np.float32)
        found = [
            np.matmul(inverses, scaled[group][:, :, None]).ravel()
            for group, inverses in zip(self._groups, self._inverses, strict=True)
        ]
        return scale * self._weights * np.bincount(self._all, np.concatenate([np.empty(0), *found]), minlength=self._size)
