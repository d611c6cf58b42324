"""A matrix whose shares lie on several ranks, factorised on the first."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from ngsolve import BaseMatrix, BaseVector, BitArray
from ngsolve.la import SparseMatrixd
from numpy.typing import NDArray

from ngswell.solve.factors import Factors
from ngswell.solve.pattern import rows_and_columns
from ngswell.team import Team


class Gathered:
    """Factors of the sum of all ranks' shares, on the first rank; the others wait for what it finds.

    Memory and time of the factorisation are those of one rank; residuals and matrices are still made by all. `needed` tells
    by row and column which entries the factors are made of, if not of those between free degrees of freedom.
    """

    def __init__(
        self,
        share: BaseMatrix,
        free: BitArray,
        team: Team,
        make: Callable[[BaseMatrix], Factors],
        needed: Callable[[NDArray, NDArray], NDArray] | None = None,
    ) -> None:
        self._share, self._team = share, team
        rows, columns = rows_and_columns(share)
        mine = np.array(list(free), dtype=bool)
        self._unknowns = np.flatnonzero(mine)
        self._entries = np.flatnonzero(mine[rows] & mine[columns] if needed is None else needed(rows, columns))
        numbers = rows[self._entries].astype(np.int64) * share.width + columns[self._entries]
        shares = team.comm.gather(numbers)
        self._sizes = team.each(self._entries.size)
        self._factors: Factors | None = None
        if team.rank == 0:
            found, self._places = np.unique(np.concatenate(shares), return_inverse=True)
            at, to = (found // share.width).astype(np.int32), (found % share.width).astype(np.int32)
            self._whole = SparseMatrixd.CreateFromCOO(at, to, np.zeros(found.size), share.height, share.width)
            self._factors = make(self._whole)

    @property
    def anew(self) -> bool:
        """See `Factors`."""
        return self._team.of_first(lambda: self._factors is not None and self._factors.anew)

    def update(self) -> bool:
        """See `Factors`."""
        values = np.asarray(self._share.CSR()[0])[self._entries]
        together = self._gathered(values)
        return self._team.of_first(lambda: self._updated(together))

    def _gathered(self, values: NDArray) -> NDArray | None:
        """The values of all ranks, on the first."""
        together = np.empty(sum(self._sizes)) if self._team.rank == 0 else None
        self._team.comm.Gatherv(values, (together, self._sizes) if self._team.rank == 0 else None)
        return together

    def _updated(self, together: NDArray | None) -> bool:
        assert self._factors is not None
        entries = self._whole.AsVector().FV().NumPy()
        entries[:] = np.bincount(self._places, together, entries.size)
        return self._factors.update()

    def solve(self, right: BaseVector, solution: BaseVector) -> bool:
        """See `Factors`."""
        solved = self._team.of_first(lambda: self._factors is not None and self._factors.solve(right, solution))
        found = solution.FV().NumPy()[self._unknowns]
        self._team.from_first(found)
        solution[:] = 0.0
        solution.FV().NumPy()[self._unknowns] = found
        return solved
