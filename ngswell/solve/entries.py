"""Where the entries of submatrices are found in a matrix, which several ranks may have shares of."""

from __future__ import annotations

import numpy as np
from ngsolve import BaseMatrix
from numpy.typing import NDArray

from ngswell.team import Team

ABSENT = -1
"""Position of an entry that the matrix does not hold."""

AT_ONCE = 128
"""Submatrices that are looked up at once; bounds the memory that takes."""


class Entries:
    """The entries of a matrix between `unknowns`, for matrices of one pattern whose columns ascend in each row.

    Of several ranks each has a share of the matrix and unknowns of its own. What shares of others add to an entry between
    these is handed over, and the sums stand behind the entries of its own share.
    """

    def __init__(self, matrix: BaseMatrix, unknowns: NDArray, team: Team) -> None:
        _, columns, starts = (np.asarray(part) for part in matrix.CSR())
        self._team, self._patterns = team, [(columns, starts.astype(np.intp))]
        if not team.alone:
            self._hand_over(unknowns)

    def _hand_over(self, unknowns: NDArray) -> None:
        """Find which entries of this rank's share others need, and which of theirs are for this one."""
        ((columns, starts),) = self._patterns
        size, lengths = starts.size - 1, np.diff(starts)
        numbers = np.repeat(np.arange(size, dtype=np.int64) * size, lengths) + columns
        sent, needed = [], np.zeros(size, dtype=bool)
        for rank, theirs in enumerate(self._team.each(unknowns.astype(np.int32))):
            needed[:] = False
            needed[theirs] = rank != self._team.rank
            inside = np.flatnonzero(np.repeat(needed, lengths)) if (needed & (lengths > 0)).any() else np.empty(0, int)
            sent.append(inside[needed[columns[inside]]])
        self._to = np.array([part.size for part in sent])
        self._of = np.array(self._team.each(self._to))[:, self._team.rank]
        self._sent = np.concatenate(sent)
        found, self._places = np.unique(self._team.handed_over(numbers[self._sent], self._to, self._of), return_inverse=True)
        at = np.minimum(np.searchsorted(numbers, found), numbers.size - 1)
        self._mine = np.flatnonzero(numbers[at] == found)
        self._at = at[self._mine]
        self._patterns.append((found % size, np.searchsorted(found, np.arange(size + 1) * size)))

    def values(self, matrix: BaseMatrix) -> NDArray:
        """The entries of `matrix`, and what they are where others add to them."""
        own = np.asarray(matrix.CSR()[0])
        if self._team.alone:
            return own
        received = self._team.handed_over(own[self._sent], self._to, self._of)
        sums = np.bincount(self._places, received, self._patterns[1][0].size).astype(float)  # integers of nothing received
        sums[self._mine] += own[self._at]
        return np.concatenate([own, sums])

    def of_submatrices(self, group: NDArray) -> NDArray:
        """Where among `values` the entries between the unknowns in each row of `group` are; ABSENT where they are none."""
        total, start = sum(columns.size for columns, _ in self._patterns), 0
        found = np.full((*group.shape, group.shape[1]), ABSENT, np.int32 if total < 2**31 else np.int64)
        for columns, starts in self._patterns:
            for first in range(0, len(group) if columns.size else 0, AT_ONCE):
                positions = _positions(group[first : first + AT_ONCE], columns, starts)
                there = found[first : first + AT_ONCE]
                there[positions != ABSENT] = positions[positions != ABSENT] + start
            start += columns.size
        return found


def _positions(group: NDArray, columns: NDArray, starts: NDArray) -> NDArray:
    """Where entries are in one pattern, by bisection."""
    wanted = group[:, None, :]
    low = np.repeat(starts[group][:, :, None], group.shape[1], axis=2)
    high = np.repeat(starts[group + 1][:, :, None], group.shape[1], axis=2) - 1
    filled = low <= high  # a share has empty rows
    while (low < high).any():
        middle = (low + high) // 2
        beyond = columns[middle] < wanted
        low = np.where(beyond, np.minimum(middle + 1, high), low)
        high = np.where(beyond, high, middle)
    return np.where(filled & (columns[np.minimum(low, columns.size - 1)] == wanted), low, ABSENT)
