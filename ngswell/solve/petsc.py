"""The linear solver that PETSc provides, on one rank or several."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import count
from typing import Any

import numpy as np
from ngsolve import BaseMatrix, BitArray

from ngswell import checks
from ngswell.errors import InputError
from ngswell.problem.forms import Form
from ngswell.problem.per_unknown import of_coefficients
from ngswell.problem.problem import Problem
from ngswell.solve.direct import CondensedSolver, LinearSolver
from ngswell.solve.factors import Factors
from ngswell.solve.petsc_factors import PETScFactors, why_not_for
from ngswell.team import Team

MUMPS: dict[str, Any] = {
    "ksp_type": "preonly",
    "pc_type": "lu",
    "pc_factor_mat_solver_type": "mumps",
    "mat_mumps_icntl_14": 100,  # per cent of memory beyond what its analysis expects, which pivots may need
}
"""Direct factors, by all ranks together."""

_numbers = count()


@dataclass(frozen=True)
class PETScSolver:
    """Solves by PETSc: `scene.run(..., solver=PETScSolver())`, on the ranks of a scene or on one.

    `options` are PETSc's, without the leading dash: {"ksp_type": "gmres", "pc_type": "asm", ...}; direct factors by MUMPS
    where none are given. Unknowns inside cells are eliminated first where that gains something, what Newton's method solves
    is counted in units of its fields, and a field split has the parts "u" (displacements) and "rest".

    Raises InputError where petsc4py does not load or has another MPI, and for options that PETSc refuses or does not use.
    """

    options: Mapping[str, Any] | None = None

    def __post_init__(self) -> None:
        options = MUMPS if self.options is None else self.options
        meant = 'a dict such as {"ksp_type": "gmres"}, or left out: solver=PETScSolver()'
        checks.instance("PETScSolver: options", options, Mapping, meant)
        for name, value in options.items():
            if not checks.is_a(name, str) or not name.replace("_", "").isalnum():
                raise InputError(
                    f'PETScSolver: an option is a name such as "pc_type", without a dash, got {checks.short(name)}'
                )
            if not checks.is_a(value, str | int | float | None):
                raise InputError(
                    f"PETScSolver: option {name!r} has to be a text, a number or None, got {checks.short(value)}"
                )
        checks.set_fields(self, options=dict(options))

    @property
    def direct(self) -> bool:
        """Whether it factorises the matrix as a whole."""
        options = self.options or {}
        return options.get("ksp_type") == "preonly" and options.get("pc_type") in ("lu", "cholesky")

    def __call__(self, problem: Problem) -> LinearSolver:
        return self.over(problem, problem.condensed)

    def over(self, problem: Problem, condensed: Form | None) -> LinearSolver:
        """A solver for the matrices of `problem`, or of a form of it that is `condensed`."""
        refused = why_not_for(problem.team)
        if refused is not None:
            raise InputError(
                f"PETScSolver: {refused}; on Debian: apt-get install python3-petsc4py python3-mpi4py, and a virtual "
                "environment with --system-site-packages (docs/distributed.md), or run without solver="
            )
        options = self.options or {}
        units, prefix = problem.sizes, f"ngswell{next(_numbers)}_"
        fields = of_coefficients(problem.ranges, {name: at for at, name in enumerate(problem.names)}).astype(np.uint8)

        def make(matrix: BaseMatrix, free: BitArray, team: Team) -> Factors:
            return PETScFactors(matrix, free, team, options, units, fields, prefix)

        name = " ".join(["petsc", *(f"{key}={value}" for key, value in sorted(options.items()))])
        if condensed is None:
            solver = LinearSolver(problem.free, name, problem.team, make)
        else:
            solver = CondensedSolver(condensed, problem.free, name, problem.team, make)
        solver.direct = self.direct
        return solver
