"""The two-level solver against the direct one, over cells, orders, models and steps."""

import numpy as np
import pytest
from ngsolve import CF, TaskManager, x, y, z
from threadpoolctl import threadpool_limits

from ngswell import (
    TABLE_2,
    Adaptive,
    Area,
    Bath,
    Concentration,
    DampedNewton,
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
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.errors import Reason
from ngswell.solve.choice import solver_of
from ngswell.solve.direct import LinearSolver
from ngswell.solve.factorisation import Factorisation
from ngswell.solve.two_level import TOLERANCE, TwoLevelSolver

DILUTION = Ramp((0, 4.1), (80, 2.7))


@pytest.fixture(autouse=True)
def _threads():
    with TaskManager(), threadpool_limits(1, user_api="blas"):
        yield


def eighth(n, cells="hexahedra", model=None, treatment=None):
    return Scene(
        mesh=box(1.1, 1.1, 0.5, n, n, n, cells=cells),
        kinematics=Spatial(),
        material=TABLE_2,
        model=model or Potential(),
        supports=[Symmetry("left"), Symmetry("front"), Symmetry("bottom")],
        baths=[Bath("right|back|top", c=DILUTION, treatment=treatment)],
    )


def quarter(n):
    return Scene(
        mesh=rectangle(1.1, 0.5, 2 * n, n),
        kinematics=PlaneStrain(),
        material=TABLE_2,
        supports=[Symmetry("left"), Symmetry("bottom")],
        baths=[Bath("right|top", c=DILUTION)],
    )


def swollen(scene):
    """The problem at rest in 4.1 mol/l: its state."""
    return scene.equilibrate(0.0).values


def system(problem, state, dt):
    """Matrix and right-hand side of the first iteration of a step."""
    problem.vector[:] = state
    problem.begin_step(dt, dt)
    matrix = problem.linearise()
    right, gap = problem.fields.vec.CreateVector(), problem.fields.vec.CreateVector()
    problem.residual(right)
    gap.FV().NumPy()[:] = problem.gap()
    right.data -= matrix * gap
    return matrix, right


def solved(solver, matrix, right):
    solution = right.CreateVector()
    assert solver.factorise(matrix)
    assert solver.solve(right, solution)
    return solution.FV().NumPy().copy()


@pytest.mark.parametrize(
    "scene",
    [
        eighth(4),
        eighth(3, cells="tetrahedra"),
        eighth(3, cells="prisms"),
        eighth(2, model=Potential(order=3)),
        eighth(3, model=Concentration(), treatment=Penalty(40.0)),
        quarter(6),
    ],
    ids=["hexahedra", "tetrahedra", "prisms", "order 3", "concentration", "plane"],
)
def test_the_direct_solution(scene):
    problem = scene.problem
    state = swollen(scene)
    for dt in (10.0, 0.1):
        matrix, right = system(problem, state, dt)
        exact = solved(LinearSolver(problem.free), matrix, right)
        size = np.abs(exact / problem.sizes).max()
        for tolerance, most in ((TOLERANCE, 20), (1e-8, 40)):
            solver = TwoLevelSolver(problem)
            solver.tolerance = tolerance
            found = solved(solver, matrix, right)
            # The preconditioned residual falls by the tolerance; it differs from the error by how good the preconditioner
            # is, here by up to 120 (order 3 on 2³ cells, with and without the coarse level's term). Below 1e-6 it is what
            # single precision leaves of the patches' solves.
            assert np.abs((found - exact) / problem.sizes).max() < 200 * max(tolerance, 1e-6) * size
            assert 1 < solver.iterations < most
            # Residuals on constrained degrees of freedom are reactions; nothing of them enters the solution.
            assert not found[~np.array(list(problem.free), bool)].any()


def test_later_solves_begin_from_what_earlier_ones_found():
    problem = eighth(4).problem
    problem.initialise()
    state = problem.initial
    matrix, right = system(problem, state, 10.0)
    solver = TwoLevelSolver(problem)
    first = solved(solver, matrix, right)
    begun = solver.iterations
    again, solution = right.CreateVector(), right.CreateVector()
    again.data = 2 * right
    assert solver.solve(again, solution)
    assert solver.iterations == 0  # the space holds its solution
    np.testing.assert_allclose(solution.FV().NumPy(), 2 * first, rtol=1e-9, atol=1e-12)  # round-off
    solved(solver, matrix, right)  # another factorisation begins anew
    assert solver.iterations == begun > 3
    assert (solver.factorisations, solver.solves) == (2, 3)


def test_iterations_hardly_depend_on_sizes_of_cells_and_steps(monkeypatch):
    counts = {}
    for n in (3, 6):
        problem = eighth(n).problem
        problem.initialise()
        strain = homogeneous_equilibrium(TABLE_2, 4.1, "3-d").J ** (1 / 3) - 1
        problem.fields.components[0].Set(strain * CF((x, y, z)))  # swollen and at rest
        state = problem.vector.copy()
        for dt in (100.0, 0.01, 1e-6):
            solver = TwoLevelSolver(problem)
            solved(solver, *system(problem, state, dt))
            counts[n, dt] = solver.iterations
    assert counts[6, 100.0] < counts[3, 100.0] + 5
    # Steps of a ten thousandth, and less, of h²/[(2µ + λ) K] = 120 s: volume is all but preserved.
    for dt in (0.01, 1e-6):
        assert counts[6, dt] < counts[6, 100.0] + 6
        assert counts[6, dt] < counts[3, dt] + 3
    # Without what stands for the finer displacements they double.
    monkeypatch.setattr("ngswell.solve.coarse.softness", lambda stiffness: 0 * stiffness)
    solver = TwoLevelSolver(problem)
    solved(solver, *system(problem, state, 0.01))
    assert solver.iterations > 1.6 * counts[6, 0.01]


def test_newtons_method_takes_it():
    ends, counts = [], []
    for make in (lambda problem: LinearSolver(problem.free), TwoLevelSolver):
        scene = eighth(3)
        problem = scene.problem
        problem.vector[:] = swollen(scene)
        problem.begin_step(10.0, 10.0)
        outcome = DampedNewton().solve(problem, Factorisation(make(problem)))
        assert outcome.failure is None
        counts.append(outcome.iterations)
        ends.append(problem.vector / problem.sizes)
    assert counts[0] <= counts[1] <= counts[0] + 1  # a solve leaves 1e-3 of a correction
    np.testing.assert_allclose(ends[1], ends[0], atol=1e-8)  # Newton's tolerance


class Tiring(LinearSolver):
    """Gives no solution after so many with a matrix."""

    most = 2

    def factorise(self, matrix):
        self.given = 0
        return super().factorise(matrix)

    def invert(self, right, solution):
        self.given += 1
        return super().invert(right, solution) and self.given <= self.most


@pytest.mark.parametrize(("most", "reason"), [(2, None), (0, Reason.SINGULAR)])
def test_newtons_method_renews_a_kept_matrix_that_gives_no_solution(most, reason):
    scene = eighth(2)
    problem = scene.problem
    problem.vector[:] = swollen(scene)
    problem.begin_step(10.0, 10.0)
    solver = Tiring(problem.free)
    solver.most = most
    factorisation = Factorisation(solver, slowest=0.9)
    outcome = DampedNewton(slowest=0.9).solve(problem, factorisation)
    assert (outcome.failure and outcome.failure.reason) == reason
    assert solver.factorisations > 1 or reason
    if reason:
        assert not factorisation.usable  # the next solve begins with a matrix of its own


def test_failures_are_told():
    scene = eighth(2)
    problem, state = scene.problem, swollen(scene)
    matrix, right = system(problem, state, 10.0)
    solver = TwoLevelSolver(problem)
    with pytest.raises(RuntimeError, match="factorise"):
        solver.solve(right, right.CreateVector())
    matrix.AsVector().FV().NumPy()[0] = np.nan
    assert not solver.factorise(matrix)


def test_a_singular_matrix_is_told():
    scene = eighth(2)
    problem, state = scene.problem, swollen(scene)
    matrix, _ = system(problem, state, 10.0)
    matrix.AsVector().FV().NumPy()[:] = 0.0
    solver = TwoLevelSolver(problem)
    assert not (solver.factorise(matrix) and solver.solve(*(problem.fields.vec.CreateVector() for _ in range(2))))


def test_runs_take_the_two_level_solver():
    # The whole way, from rest through a dilution with old matrices kept: the direct solver's volumes.
    volumes = []
    for solver in (solver_of, TwoLevelSolver):
        scene, volume = eighth(3), Area()
        rest = scene.equilibrate(0.0, solver=solver)
        scene.run(80.0, Adaptive(1e-2), [volume], resume=rest, solver=solver)
        volumes.append(volume.values)
    assert len(volumes[0]) == len(volumes[1])  # the same steps
    # Nonlinear solves leave at most 5e-4 of the largest change, which is some 2 % of the volume.
    assert volumes[0] == pytest.approx(volumes[1], rel=2e-5)
    assert np.abs(volumes[0] / volumes[0][0] - 1).max() > 1e-3
