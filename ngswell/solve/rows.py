"""A matrix whose shares lie on several ranks, its rows divided among them: what distributed solvers are given."""

from __future__ import annotations

import numpy as np
from ngsolve import BaseMatrix, BitArray
from numpy.typing import NDArray

from ngswell.solve.pattern import rows_and_columns
from ngswell.team import Team


class Rows:
    """The sum of all ranks' shares on the free degrees of freedom, each row on one rank: the first that has some of it.

    Degrees of freedom are numbered anew, those of the first rank first. `dofs` has them in this order, and `own` is the
    part of this rank: compressed rows with `starts`, `columns` (new numbers) and, after `take`, the `values`.
    """

    def __init__(self, share: BaseMatrix, free: BitArray, team: Team) -> None:
        self._share, self._team = share, team
        rows, columns = rows_and_columns(share)
        mine = np.array(list(free), dtype=bool)
        entries = np.flatnonzero(mine[rows] & mine[columns])
        rows, columns = rows[entries], columns[entries]
        owner = np.full(share.height, team.size - 1)  # also of rows without entries, which make the matrix singular
        owner[rows] = team.rank
        team.least_values(owner)
        free_dofs = np.flatnonzero(mine)
        self.dofs = free_dofs[np.argsort(owner[free_dofs], kind="stable")]
        ends = np.cumsum(np.bincount(owner[free_dofs], minlength=team.size))
        self.own = slice(int(ends[team.rank - 1]) if team.rank else 0, int(ends[team.rank]))
        number = np.zeros(share.height, dtype=np.int64)
        number[self.dofs] = np.arange(self.dofs.size)
        order = np.argsort(owner[rows], kind="stable")
        self._entries = entries[order]
        self._to = np.bincount(owner[rows], minlength=team.size)
        self._from = np.array(team.each(self._to))[:, team.rank]
        numbers = number[rows[order]] * self.dofs.size + number[columns[order]]
        found, self._places = np.unique(team.handed_over(numbers, self._to, self._from), return_inverse=True)
        counts = np.bincount(found // self.dofs.size - self.own.start, minlength=self.own.stop - self.own.start)
        self.starts = np.concatenate([[0], np.cumsum(counts)])
        self.columns = found % self.dofs.size
        self.values: NDArray = np.zeros(found.size)

    def take(self) -> bool:
        """The values that the matrix has now; False if one of them is not finite on some rank."""
        share = np.asarray(self._share.CSR()[0])
        if self._team.any(not np.isfinite(share.sum())):
            return False
        received = self._team.handed_over(share[self._entries], self._to, self._from)
        self.values = np.bincount(self._places, received, self.values.size)
        return True

    def largest(self, values: NDArray) -> NDArray:
        """Of each own row the largest size among `values` of its entries; 0 where it has none."""
        found, filled = np.zeros(self.starts.size - 1), np.flatnonzero(np.diff(self.starts))
        if filled.size:
            found[filled] = np.maximum.reduceat(np.abs(values), self.starts[filled])
        return found
