"""How many threads a run takes."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext

from ngsolve import TaskManager, ngsglobals

from ngswell.problem.problem import Problem

THREADS_FROM = 20_000
"""Unknowns from which a run takes several threads.

Those of NGSolve wait for work without sleeping. With two on two cores, 20 000 unknowns take a fifth less time where nothing
else runs and a third more where the cores are busy; on busy cores 5000 take three times as long as with one, 1000 six times.
Within `with ngsolve.TaskManager():` a run of any size takes several.
"""


def threads_for(problem: Problem) -> AbstractContextManager[object]:
    """NGSolve's threads, all that NGS_NUM_THREADS allows, for a problem of THREADS_FROM unknowns or more."""
    return TaskManager() if problem.space.ndof >= THREADS_FROM else nullcontext()


def threads_said(problem: Problem) -> str:
    """The same in words."""
    return f"{ngsglobals.numthreads}" if problem.space.ndof >= THREADS_FROM else f"1 (more from {THREADS_FROM} unknowns on)"
