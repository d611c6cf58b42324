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
    """NGSolve's threads, all that NGS_NUM_THREADS allows, for a problem of THREADS_FROM unknowns or more on one rank.

    Several ranks take one thread each, as they are started on a core each.
    """
    return TaskManager() if _takes_several(problem) else nullcontext()


def threads_said(problem: Problem) -> str:
    """The same in words."""
    if _takes_several(problem):
        return f"{ngsglobals.numthreads}"
    return f"1 (more from {THREADS_FROM} unknowns on)" if problem.team.alone else "1 on each rank"


def _takes_several(problem: Problem) -> bool:
    return problem.team.alone and problem.space.ndof >= THREADS_FROM
