"""What each rank of the study `scaling` runs: mpirun -n RANKS python -m studies.choices.scaling_worker SOLVER CELLS OUT.

SOLVER is "gathered", "mumps" or "two_level". The first rank writes what all took to OUT.json and the fields to OUT.npy.
"""

from __future__ import annotations

import json
import pickle
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from ngswell import PETScSolver
from ngswell.problem.problem import Problem
from ngswell.solve.direct import CondensedSolver, LinearSolver
from ngswell.solve.factorisation import Factorisation
from ngswell.solve.newton import DampedNewton
from ngswell.solve.two_level import TwoLevelSolver
from ngswell.team import Team, everyone
from studies.choices.growth import STEP, body, memory, swell
from studies.scenes import INITIAL

CALLS = ("Allreduce", "Alltoallv", "Allgatherv", "Gatherv", "Bcast", "allgather", "gather", "bcast")
"""What ranks say to each other with."""


def gathered(problem: Problem) -> LinearSolver:
    """The direct solver of one rank, on the first."""
    if problem.condensed is None:
        return LinearSolver(problem.free, team=problem.team)
    return CondensedSolver(problem.condensed, problem.free, team=problem.team)


SOLVERS: dict[str, Callable[[Problem], LinearSolver]] = {
    "gathered": gathered,
    "mumps": PETScSolver(),
    "two_level": TwoLevelSolver,
}


class Spoken:
    """What this rank has said through MPI: calls, bytes handed over, CPU seconds in them with those of waiting."""

    def __init__(self, team: Team) -> None:
        self.calls, self.bytes, self.seconds = 0, 0, 0.0
        if not team.alone:
            team._comm = self._listened(team._comm)

    def _listened(self, comm: Any) -> Any:
        def listening(name: str) -> Callable[..., Any]:
            def method(mine: Any, *values: Any) -> Any:
                start = process_time()
                found = getattr(super(kind, mine), name)(*values)
                self.seconds += process_time() - start
                self.calls += 1
                self.bytes += size_of(values[:2])
                return found

            return method

        # petsc4py takes classes of this module only.
        kind = type("Listened", (type(comm),), {"__module__": "mpi4py.MPI", **{name: listening(name) for name in CALLS}})
        return kind(comm)


def size_of(values: Any) -> int:
    """Bytes of the first array among them, or of them as a message."""
    for value in values:
        array = value[0] if isinstance(value, tuple) and value else value
        if isinstance(array, np.ndarray):
            return array.nbytes
    return len(pickle.dumps(values))


def measure(name: str, cells: int) -> tuple[dict[str, Any], np.ndarray]:
    """A first step, in which matrices are analysed, and a second, which is counted; fields in units of their size."""
    team = everyone()
    spoken = Spoken(team)
    problem = replace(body(3, cells), ranks=True).problem
    krylov: list[int] = []
    with threadpool_limits(1, user_api="blas"):
        swell(problem)
        solver = SOLVERS[name](problem)
        invert = solver.invert

        def counted(right: Any, solution: Any) -> bool:
            done = invert(right, solution)
            if isinstance(solver, TwoLevelSolver):
                krylov.append(solver.iterations)
            return done

        solver.invert = counted  # type: ignore[method-assign]
        factorisation, newton, iterations = Factorisation(solver), DampedNewton(), 0
        for step in (1, 2):
            before = process_time(), spoken.calls, spoken.bytes, spoken.seconds
            krylov.clear()
            problem.begin_step(INITIAL + step * STEP, STEP)
            outcome = newton.solve(problem, factorisation)
            if outcome.failure is not None:
                raise RuntimeError(f"{name} on {cells}^3 cells: {outcome.failure.text}")
            iterations = outcome.iterations
    taken = {
        "seconds": process_time() - before[0],
        "calls": spoken.calls - before[1],
        "bytes": spoken.bytes - before[2],
        "waiting": spoken.seconds - before[3],
        "peak": memory("VmHWM"),
    }
    ranks = team.each(taken)
    told = {
        "ranks": team.size,
        "unknowns": problem.space.ndof,
        "newton": iterations,
        "krylov": sum(krylov),
        "solves": max(len(krylov), 1),
        **{key: [one[key] for one in ranks] for key in taken},
    }
    return told, problem.vector / problem.sizes


if __name__ == "__main__":
    solver_name, cell_count, out = sys.argv[1:]
    numbers, fields = measure(solver_name, int(cell_count))
    if everyone().rank == 0:
        np.save(out + ".npy", fields)
        Path(out + ".json").write_text(json.dumps(numbers), encoding="utf-8")
