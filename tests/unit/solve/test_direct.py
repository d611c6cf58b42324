"""The direct solvers: refactorised, condensed, and given what has no solution."""

import contextlib

import numpy as np
import pytest

from ngswell import (
    TABLE_2,
    Bath,
    Concentration,
    Essential,
    Frozen,
    Nitsche,
    Penalty,
    PlaneStrain,
    Potential,
    Ramp,
    Scene,
    Spatial,
    Symmetry,
    box,
    rectangle,
)
from ngswell.errors import InputError
from ngswell.solve.choice import solver_of
from ngswell.solve.direct import CondensedSolver, LinearSolver
from ngswell.solve.factors import best_solver, why_not
from tests.scenes import block, confined_column, deformed


@pytest.mark.parametrize("name", sorted({"umfpack", best_solver()}))
def test_refactorisation_follows_the_matrix(name):
    problem = block().problem
    deformed(problem)
    solver = LinearSolver(problem.free, name)
    right, solution = problem.fields.vec.CreateVector(), problem.fields.vec.CreateVector()
    free = np.array(list(problem.free))
    right.FV().NumPy()[:] = np.random.default_rng(3).standard_normal(right.size) * free
    for dt in (1.0, 100.0):
        problem.dt.Set(dt)
        matrix = problem.linearise()
        assert solver.factorise(matrix)
        assert solver.solve(right, solution)
        back = (matrix * solution).Evaluate().FV().NumPy()
        assert back[free] == pytest.approx(right.FV().NumPy()[free], abs=1e-8)
    assert solver.factorisations == 2


@pytest.mark.parametrize(
    ("mesh", "motion", "model", "treatment"),
    [
        (rectangle(1.0, 1.0, 3, 3), PlaneStrain(), Potential(), Essential()),
        (rectangle(1.0, 1.0, 3, 3), PlaneStrain(), Potential(4), Essential()),
        (rectangle(1.0, 1.0, 3, 3), PlaneStrain(), Concentration(3), Penalty(relative=1e3)),
        (rectangle(1.0, 1.0, 3, 3, triangles=True), PlaneStrain(), Concentration(4), Frozen()),
        (box(1.0, 1.0, 1.0, 2, 2, 2), Spatial(), Potential(3), Essential()),
    ],
    ids=lambda value: str(value) if isinstance(value, (Concentration, Potential)) else None,
)
def test_condensed_corrections_are_those_of_the_whole_system(mesh, motion, model, treatment):
    sides = [name for name in dict.fromkeys(mesh.GetBoundaries()) if name != "top"]
    supports = [Symmetry(side) for side in sides if side in ("left", "front", "bottom")]
    bath = Bath("top", c=Ramp((0, 0.2), (1, 0.1)), treatment=treatment)
    scene = Scene(mesh=mesh, kinematics=motion, material=TABLE_2, model=model, supports=supports, baths=[bath])
    problem = scene.problem
    deformed(problem)
    problem.begin_step(1.0, 0.5)
    solvers = LinearSolver(problem.free), solver_of(problem)
    assert isinstance(solvers[1], CondensedSolver)
    right, gap, whole, condensed = (problem.fields.vec.CreateVector() for _ in range(4))
    problem.residual(right)
    gap.FV().NumPy()[:] = problem.gap()
    for solver, solution in zip(solvers, (whole, condensed), strict=True):
        assert solver.renew(problem)
        assert solver.solve(right, solution, gap if isinstance(treatment, (Essential, Frozen)) else None)
    free = np.array(list(problem.free))
    size = np.abs(whole.FV().NumPy()[free]).max()
    # Round-off times the condition of systems of up to some 400 unknowns in mixed units.
    assert condensed.FV().NumPy() == pytest.approx(whole.FV().NumPy(), abs=1e-9 * size)
    assert size > 1e-6


def test_side_integrals_with_normal_derivatives_are_not_condensed():
    # They reach the unknowns inside the cells, from outside the cell-wise elimination.
    scene = confined_column(Nitsche(), cells=3)
    assert type(solver_of(scene.problem)) is LinearSolver


def test_nan_in_the_matrix_is_noticed():
    problem = block().problem
    problem.initialise()
    matrix = problem.linearise()
    matrix.AsVector().FV().NumPy()[7] = np.nan
    assert not LinearSolver(problem.free).factorise(matrix)


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("sparsecholesky", "is for symmetric matrices"),
        ("pardisospd", "is for symmetric matrices"),
        ("nonsense", "is not to be had from this NGSolve"),
    ],
)
def test_a_solver_that_does_not_fit_is_refused_by_name(name, reason):
    with pytest.raises(InputError, match=f"linear solver '{name}' {reason}.*without a name it is '{best_solver()}'"):
        LinearSolver(block().problem.free, name)


def test_cudss_is_taken_by_name_or_refused():
    # Untested beyond its name: no machine of ours has a graphics card that NGSolve's cudss runs on.
    problem = block().problem
    refused = (
        contextlib.nullcontext() if why_not("cudss") is None else pytest.raises(InputError, match="linear solver 'cudss'")
    )
    with refused:
        assert LinearSolver(problem.free, "cudss").name == "cudss"
