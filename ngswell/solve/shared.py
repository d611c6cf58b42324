"""Unknowns that several ranks have, and sums of vectors that are as sparse as the ranks' parts of the body."""

from __future__ import annotations

import numpy as np
from ngsolve import BaseMatrix
from numpy.typing import NDArray

from ngswell.team import Team


class Shared:
    """Which unknowns a rank has: those of the rows of its share of a matrix, and `more`.

    Vectors are as long as all unknowns. Sums over ranks are exchanged between those that have an unknown: their size is
    that of the surfaces between ranks.
    """

    def __init__(self, matrix: BaseMatrix, more: NDArray, team: Team) -> None:
        self._team = team
        self.own: slice | NDArray = slice(None)
        """The unknowns that count as this rank's, each on one."""
        self.count = matrix.height
        """How many these are."""
        self.exchanged = 0
        """Values that are sent to others in a sum."""
        if team.alone:
            return
        rows = np.flatnonzero(np.diff(np.asarray(matrix.CSR()[2]).astype(np.intp))).astype(np.int32)
        first = np.full(matrix.height, team.size)
        for rank, theirs in reversed(list(enumerate(team.each(rows)))):
            first[theirs] = rank
        self.own = np.flatnonzero(first == team.rank)
        mine = np.union1d(rows, more.astype(np.int32))
        self._in_common = [np.intersect1d(mine, theirs, assume_unique=True) for theirs in team.each(mine)]
        self._in_common[team.rank] = mine[:0]
        self._all = np.concatenate(self._in_common)
        self._several = np.unique(self._all)
        self._others = self._several[first[self._several] != team.rank]
        self._sizes = np.array([part.size for part in self._in_common])
        self.count, self.exchanged = self.own.size, self._all.size

    def sum(self, values: NDArray) -> None:
        """Values become their sums over ranks where this one has the unknown, in place: the same to the bit on each."""
        if self._team.alone:
            return
        received = self._team.handed_over(values[self._all], self._sizes, self._sizes)
        parts = np.split(received, np.cumsum(self._sizes)[:-1])
        mine = values[self._several]
        values[self._several] = 0.0
        for rank, (at, theirs) in enumerate(zip(self._in_common, parts, strict=True)):
            if rank == self._team.rank:
                values[self._several] += mine
            else:
                values[at] += theirs

    def spread(self, values: NDArray) -> None:
        """Values become those of the rank that they are of, where this one has the unknown, in place."""
        if not self._team.alone:
            values[self._others] = 0.0
            self.sum(values)
