"""Solves by PETSc: factors or a preconditioned Krylov method, as its options say, with rows divided among ranks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from ctypes import CDLL, byref, c_int
from functools import cache
from typing import Any

import numpy as np
from ngsolve import BaseMatrix, BaseVector, BitArray
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from ngswell.errors import InputError
from ngswell.solve.rows import Rows
from ngswell.team import Team

NUMERIC = (55, 71, 72, 76, 81, 91)
"""PETSc's numbers of errors that a matrix's values cause: memory, zero pivots, not finite, a library's, no convergence."""

ROUND_OFF = 1e-13
"""A Krylov method also stops below this residual, in units of the fields: at a state of rest that is round-off only."""


@cache
def why_not() -> str | None:
    """Why PETSc does not load here; None where it does."""
    try:
        import petsc4py

        petsc4py.init(["ngswell", "-no_signal_handler"])  # signals are the run's
        from petsc4py import PETSc  # noqa: F401
    except Exception as error:  # of numpy's two versions, too, which is none in particular
        return f"petsc4py does not load ({type(error).__name__}: {' '.join(str(error).split())[:200]})"
    return None


def why_not_for(team: Team) -> str | None:
    """The same for ranks: all must have it, of the MPI that they were started with. Called by all of them."""
    missing = next((why for why in team.each(why_not()) if why), None)
    if missing is not None or team.alone:
        return missing
    from petsc4py import PETSc

    sizes = team.each(PETSc.COMM_WORLD.size)
    if min(sizes) < team.size:
        return f"petsc4py sees {min(sizes)} of {team.size} ranks, as its MPI is another than mpi4py's"
    threadpool_limits(1, user_api="blas")  # those of run do not see a library that is loaded within it
    return None


class PETScFactors:
    """See `Factors`: of the matrix that shares add up to, by the solver that PETSc's `options` describe.

    Unknowns are counted in `units` of their fields, and the equations of each field (`fields`: its number, by coefficient)
    in units of their largest entry: residuals of all fields are comparable, and a symmetric part stays symmetric.
    A field split has the parts "u", displacements, and "rest".
    """

    def __init__(
        self,
        matrix: BaseMatrix,
        free: BitArray,
        team: Team,
        options: Mapping[str, Any],
        units: NDArray,
        fields: NDArray,
        prefix: str,
    ) -> None:
        from petsc4py import PETSc

        self._team, self._options, self._prefix, self._petsc = team, options, prefix, PETSc
        self._comm = PETSc.COMM_SELF if team.alone else team.comm
        PETSc.garbage_cleanup(self._comm)  # what earlier factors have left: of ranks only all together can free it
        self._rows = Rows(matrix, free, team)
        self._units, own = units[self._rows.dofs], self._rows.own
        self._fields = fields[self._rows.dofs[own]]
        self._entries_of_rows = np.diff(self._rows.starts)
        size = (own.stop - own.start, self._rows.dofs.size)
        integers = (self._rows.starts.astype(PETSc.IntType), self._rows.columns.astype(PETSc.IntType))
        self._pattern = integers
        self._matrix = PETSc.Mat().createAIJ((size, size), csr=(*integers, self._rows.values), comm=self._comm)
        self._solution, self._right = self._matrix.createVecs()
        self._scale = np.ones(size[0])
        self._ksp: Any = None
        self._unused = True  # options are to be looked at after a solve
        self.anew = False

    def update(self) -> bool:
        """See `Factors`. Raises InputError for options that PETSc refuses."""
        if not self._rows.take():
            return False
        values = self._rows.values * self._units[self._rows.columns]
        self._scale = self._of_equations(values)
        values /= np.repeat(self._scale, self._entries_of_rows)
        self._matrix.setValuesCSR(*self._pattern, values)
        self._matrix.assemble()
        self.anew = self._ksp is None
        return (not self.anew or self._tried(self._make)) and self._tried(self._prepare) and not self._broken()

    def _of_equations(self, values: NDArray) -> NDArray:
        """The largest entry in the equations of each own row's field, or 1 where there is none."""
        highest = np.zeros(256)
        np.maximum.at(highest, self._fields, self._rows.largest(values))
        self._team.most_values(highest)
        return np.where(highest > 0, highest, 1.0)[self._fields]

    def _make(self) -> None:
        options = self._petsc.Options(self._prefix)
        for name, value in self._options.items():
            options[name] = value
        self._ksp = self._petsc.KSP().create(comm=self._comm)
        self._ksp.setOptionsPrefix(self._prefix)
        self._ksp.setOperators(self._matrix)
        self._ksp.setTolerances(atol=ROUND_OFF)
        if self._options.get("pc_type") == "fieldsplit":
            first, parts = self._rows.own.start, self._ksp.getPC()
            parts.setType("fieldsplit")
            for name, mine in (("u", self._fields == 0), ("rest", self._fields != 0)):
                numbers = (first + np.flatnonzero(mine)).astype(self._petsc.IntType)
                parts.setFieldSplitIS((name, self._petsc.IS().createGeneral(numbers, comm=self._comm)))
        self._ksp.setFromOptions()

    def _prepare(self) -> None:
        self._ksp.setUp()
        self._ksp.setUpOnBlocks()

    def _broken(self) -> bool:
        failed = self._petsc.KSP.ConvergedReason.DIVERGED_PCSETUP_FAILED
        return self._team.any(self._ksp.getConvergedReason() == failed)

    def solve(self, right: BaseVector, solution: BaseVector) -> bool:
        """See `Factors`. Raises InputError for options that PETSc has not used."""
        rows = self._rows
        self._right.setArray(right.FV().NumPy()[rows.dofs[rows.own]] / self._scale)
        if not self._tried(lambda: self._ksp.solve(self._right, self._solution)):
            return False
        if self._unused:
            self._check_used()
        values = solution.FV().NumPy()
        values[:] = 0.0
        values[rows.dofs] = self._team.joined(self._solution.getArray()) * self._units
        return self._team.all(self._ksp.getConvergedReason() > 0)

    @property
    def iterations(self) -> int:
        """Of the last solve."""
        return self._ksp.getIterationNumber()

    def _tried(self, call: Callable[[], None]) -> bool:
        """Whether PETSc does it on all ranks. Raises InputError where it refuses for another reason than the values."""
        met = None
        try:
            call()
        except self._petsc.Error as error:
            met = error.ierr, str(error).strip().splitlines()[-1]
        first = next((one for one in self._team.each(met) if one is not None), None)
        if first is not None and first[0] not in NUMERIC:
            raise InputError(f"PETScSolver({dict(self._options)}): PETSc refuses this: {first[1]}")
        return first is None

    def _check_used(self) -> None:
        used = CDLL(self._petsc.__file__).PetscOptionsUsed
        unused = []
        for name in self._options:
            found = c_int(0)
            used(None, f"{self._prefix}{name}".encode(), byref(found))
            if not found.value:
                unused.append(name)
        everywhere = set.intersection(*(set(names) for names in self._team.each(unused)))
        if everywhere:
            raise InputError(
                f"PETScSolver: PETSc has not used {', '.join(map(repr, sorted(everywhere)))}; correct or leave out what it "
                f"does not know, or what belongs to another solver than {dict(self._options)} describes"
            )
        self._unused = False
