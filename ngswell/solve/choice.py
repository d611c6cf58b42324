"""Which linear solver a problem has that is given none."""

from __future__ import annotations

from ngswell.problem.forms import Form
from ngswell.problem.problem import Problem
from ngswell.solve.direct import CondensedSolver, LinearSolver
from ngswell.solve.factors import best_solver
from ngswell.solve.petsc import PETScSolver
from ngswell.solve.petsc_factors import why_not, why_not_for


def solver_of(problem: Problem) -> LinearSolver:
    """The solver for the steps of a problem: direct, by all ranks together where they have PETSc, else by the first."""
    return solver_over(problem, problem.condensed)


def solver_over(problem: Problem, condensed: Form | None) -> LinearSolver:
    """The same for matrices of `problem`, or of a form of it that is `condensed`."""
    if not problem.team.alone and why_not_for(problem.team) is None:
        return PETScSolver().over(problem, condensed)
    if condensed is None:
        return LinearSolver(problem.free, team=problem.team)
    return CondensedSolver(condensed, problem.free, team=problem.team)


def solver_said(problem: Problem) -> str:
    """The same in words, as far as this rank knows: one may ask alone."""
    if problem.team.alone:
        return best_solver()
    missing = why_not()
    return "MUMPS by PETSc, on all ranks" if missing is None else f"{best_solver()}, on the first rank alone ({missing})"
