"""What every rank does with the two-level solver; the first writes what came out.

mpirun -n 2 python -m tests.ranks.levels OUT
"""

from __future__ import annotations

import pickle
import sys
import warnings
from functools import partial
from typing import Any

import numpy as np

from ngswell import Adaptive, Bath, Fixed, InstabilityWarning, Potential, Scene, TwoLevelSolver, Vessel
from ngswell.problem.problem import Problem
from ngswell.team import everyone
from tests.ranks.scenes import cube, cylinder
from tests.scenes import FALLING, quarter, strip

RUNS: dict[str, tuple[partial[Scene], Any, float]] = {
    "cube": (partial(cube, 3), Adaptive(1e-2), 5.0),
    "number": (
        partial(quarter, cells=4, baths=[Bath("top|right", c=0.1, vessel=Vessel(2.0))], initial=(0.15, 0.0)),
        Fixed(5.0),
        5.0,
    ),
    "tie": (cylinder, Fixed(5.0), 5.0),
}
"""Whole runs: with an unknown that all cells have, and with unknowns of several ranks that are one number."""


def prepared(scene: Scene, dt: float) -> tuple[Problem, Any]:
    """A first step, and its matrix."""
    problem = scene.problem
    problem.initialise()
    problem.begin_step(dt, dt)
    return problem, problem.linearise()


def solved(scene: Scene, dt: float) -> dict[str, Any]:
    """The first correction of a step, and how the work is divided."""
    problem, matrix = prepared(scene, dt)
    solver = TwoLevelSolver(problem)
    right, solution, gap = (problem.fields.vec.CreateVector() for _ in range(3))
    problem.residual(right)
    gap.FV().NumPy()[:] = problem.gap()
    assert solver.factorise(matrix)
    assert solver.solve(right, solution, gap)
    parts = solver._parts
    return {
        "values": solution.FV().NumPy() / problem.sizes,
        "iterations": problem.team.each(solver.iterations),
        "own": problem.team.each(parts.shared.count),
        "entries": problem.team.each(matrix.nze),
        "inverses": problem.team.each(sum(one.size for one in parts.patches._inverses)),
        "exchanged": problem.team.each(parts.shared.exchanged),
        "received": problem.team.each(0 if problem.team.alone else int(parts.patches._entries._of.sum())),
    }


def broken(value: float) -> dict[str, Any]:
    """What ranks say of a matrix whose entries of one unknown, inside a cell of the last rank, are `value`."""
    problem, matrix = prepared(cube(4, ranks=True), 10.0)
    inside = problem.space.components[0].components[0]
    dof = inside.GetDofNrs(list(problem.mesh.Elements())[-1])[-1]
    columns, starts = (np.asarray(part) for part in matrix.CSR()[1:])
    rows = np.repeat(np.arange(matrix.height), np.diff(starts.astype(np.intp)))
    matrix.AsVector().FV().NumPy()[(rows == dof) | (columns == dof)] = value
    solver, right = TwoLevelSolver(problem), problem.fields.vec.CreateVector()
    right.FV().NumPy()[:] = 1.0
    done = solver.factorise(matrix)
    return {
        "has": problem.team.each(bool((rows == dof).any())),
        "factorised": problem.team.each(done),
        "solved": problem.team.each(done and solver.solve(right, right.CreateVector())),
    }


def ran(name: str) -> dict[str, Any]:
    """A whole run."""
    make, steps, until = RUNS[name]
    scene = make(ranks=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", InstabilityWarning)  # a body under dead loads may be unstable
        result = scene.run(until, steps, solver=TwoLevelSolver)
    return {
        "values": result.end.values / scene.problem.sizes,
        "times": np.array([step.time for step in result.steps]),
        "newton": sum(step.iterations for step in result.steps),
    }


def outcome() -> dict[Any, dict[str, Any]]:
    """All of these."""
    return {
        **{dt: solved(cube(4, ranks=True), dt) for dt in (10.0, 0.1)},
        "strip": solved(strip(None, FALLING, (1, 7), model=Potential(), ranks=True), 5.0),
        "singular": broken(0.0),
        "not finite": broken(float("nan")),
        **{name: ran(name) for name in RUNS},
    }


if __name__ == "__main__":
    found = outcome()
    if everyone().rank == 0:
        with open(sys.argv[1], "wb") as file:
            pickle.dump(found, file)
