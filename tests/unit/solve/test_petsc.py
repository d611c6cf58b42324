"""PETSc's solvers on one rank: right, told where matrices are singular, options that are not used refused by name."""

import sys
from itertools import count

import numpy as np
import pytest
from ngsolve import BitArray
from ngsolve.la import SparseMatrixd

from ngswell import Adaptive, Fixed, InputError, PETScSolver, StepError, TwoLevelSolver
from ngswell.solve import petsc_factors
from ngswell.solve.direct import LinearSolver
from ngswell.solve.petsc_factors import PETScFactors
from ngswell.solve.rows import Rows
from ngswell.team import ALONE
from tests.ranks.scenes import cube
from tests.scenes import FALLING, quarter

GMRES = {"ksp_type": "gmres", "pc_type": "ilu", "ksp_rtol": 1e-10}
HAS_PETSC = petsc_factors.why_not() is None
with_petsc = pytest.mark.skipif(not HAS_PETSC, reason="petsc4py is not installed")
SIZE, NUMBERS = 40, count()


def system(seed=1):
    """A sparse matrix with entries of very different sizes, what is free of it, and the same dense."""
    random = np.random.default_rng(seed)
    dense = random.standard_normal((SIZE, SIZE)) * (random.random((SIZE, SIZE)) < 0.2) + 5 * np.eye(SIZE)
    dense[:20] *= 1e6
    rows, columns = np.nonzero(dense)
    matrix = SparseMatrixd.CreateFromCOO(rows.tolist(), columns.tolist(), dense[rows, columns].tolist(), SIZE, SIZE)
    free = BitArray([dof not in (0, 7, 39) for dof in range(SIZE)])
    return matrix, free, dense


def factors(options, matrix, free):
    fields = np.repeat(np.array([0, 1], dtype=np.uint8), 20)
    return PETScFactors(matrix, free, ALONE, options, np.where(fields, 1e-3, 2.0), fields, f"test{next(NUMBERS)}_")


def test_rows_of_one_rank_are_the_free_part():
    matrix, free, dense = system()
    rows = Rows(matrix, free, ALONE)
    assert rows.take()
    there = np.zeros((rows.dofs.size, rows.dofs.size))
    for row, (first, last) in enumerate(zip(rows.starts[:-1], rows.starts[1:], strict=True)):
        there[row, rows.columns[first:last]] = rows.values[first:last]
    np.testing.assert_array_equal(there, dense[np.ix_(rows.dofs, rows.dofs)])
    np.testing.assert_array_equal(rows.largest(rows.values), np.abs(there).max(axis=1))
    matrix.AsVector()[3] = np.nan
    assert not rows.take()


@with_petsc
@pytest.mark.parametrize("options", [dict(PETScSolver().options), GMRES], ids=["MUMPS", "GMRES"])
def test_solutions_are_those_of_the_free_part(options):
    matrix, free, dense = system()
    made, right = factors(options, matrix, free), matrix.CreateColVector()
    right.FV().NumPy()[:] = np.random.default_rng(3).standard_normal(SIZE)
    mine = np.array(list(free))
    for factor in (1.0, 2.0):  # with the analysis of the first
        matrix.AsVector().data = factor * matrix.AsVector()
        solution = right.CreateVector()
        solution[:] = 7.0
        assert made.update()
        assert made.solve(right, solution)
        expected = np.zeros(SIZE)
        expected[mine] = np.linalg.solve(factor * dense[np.ix_(mine, mine)], right.FV().NumPy()[mine])
        dense = factor * dense
        # Round-off of a matrix with a condition of some 1e2 (scaled), or the tolerance 1e-10 of the iteration with the same.
        np.testing.assert_allclose(solution.FV().NumPy(), expected, rtol=0, atol=1e-8 * np.abs(expected).max())
        assert made.anew == (factor == 1.0)


@with_petsc
def test_a_singular_matrix_is_told():
    matrix, free, dense = system()
    rows, columns, _ = (np.asarray(part) for part in matrix.COO())
    matrix.AsVector().FV().NumPy()[:] = np.where((rows == 5) | (columns == 5), 0.0, dense[rows, columns])
    assert not factors(PETScSolver().options, matrix, free).update()


@with_petsc
def test_no_convergence_is_told():
    matrix, free, _ = system()
    made, right = factors({"ksp_type": "gmres", "pc_type": "none", "ksp_max_it": 2}, matrix, free), matrix.CreateColVector()
    right[:] = 1.0
    assert made.update()
    assert not made.solve(right, right.CreateVector())


@with_petsc
def test_a_run_is_that_of_the_direct_solver():
    here, there = (cube().run(20.0, Adaptive(1e-2), unstable="off", **given) for given in ({}, {"solver": PETScSolver()}))
    assert [step.iterations for step in here.steps] == [step.iterations for step in there.steps]
    np.testing.assert_allclose(there.end.values, here.end.values, rtol=0, atol=1e-10)  # round-off of other pivots


@with_petsc
def test_a_field_split_has_two_parts():
    options = {
        "ksp_type": "gmres",
        "pc_type": "fieldsplit",
        "pc_fieldsplit_type": "multiplicative",
        "fieldsplit_u_ksp_type": "preonly",
        "fieldsplit_u_pc_type": "lu",
        "fieldsplit_rest_ksp_type": "preonly",
        "fieldsplit_rest_pc_type": "lu",
    }
    here, there = (
        cube().run(10.0, Fixed(10.0), unstable="off", **given) for given in ({}, {"solver": PETScSolver(options)})
    )
    np.testing.assert_allclose(there.end.values, here.end.values, rtol=0, atol=1e-7)  # ten of Newton's tolerances


@with_petsc
@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"ksp_type": "gmrs"}, "Unable to find requested KSP type gmrs"),
        ({**GMRES, "pc_factor_levls": 1}, "not used 'pc_factor_levls'"),
        ({"pc_type": "lu", "pc_factor_mat_solver_type": "nothing"}, "Could not locate solver type nothing"),
    ],
    ids=["value", "name", "library"],
)
def test_options_that_petsc_does_not_take_are_refused(options, said):
    with pytest.raises(InputError, match=said):
        quarter(None, FALLING, 2).run(5.0, Fixed(5.0), solver=PETScSolver(options))


@pytest.mark.parametrize("options", [[], "pc_type", {1: "lu"}, {"-pc_type": "lu"}, {"": 1}, {"pc type": 1}, {"a": []}])
def test_what_is_no_option_is_refused(options):
    with pytest.raises(InputError, match="PETScSolver"):
        PETScSolver(options)


def test_the_class_alone_is_refused():
    with pytest.raises(InputError, match=r"solver=PETScSolver\(\)"):
        quarter(cells=1).run(5.0, solver=PETScSolver)


def test_without_petsc_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "petsc4py", None)
    petsc_factors.why_not.cache_clear()
    try:
        with pytest.raises(InputError, match=r"petsc4py does not load.*python3-petsc4py"):
            quarter(cells=1).run(5.0, solver=PETScSolver())
    finally:
        petsc_factors.why_not.cache_clear()


@with_petsc
def test_only_direct_factors_are_looked_at_for_stability():
    scene = quarter(cells=1)
    assert PETScSolver()(scene.problem).direct
    assert not PETScSolver(GMRES)(scene.problem).direct
    assert LinearSolver.direct
    assert not TwoLevelSolver.direct


@with_petsc
def test_a_step_that_no_iteration_solves_fails():
    weak = {"ksp_type": "gmres", "pc_type": "none", "ksp_max_it": 1}
    with pytest.raises(StepError, match="singular or not finite"):
        quarter(None, FALLING, 2).run(5.0, Fixed(5.0), solver=PETScSolver(weak))
