"""Direct solvers without refinement: right where matrices are hard, told where they are singular, memory given back."""

import ctypes
import gc

import numpy as np
import pytest
from ngsolve import BitArray
from ngsolve.la import SparseMatrixd

from ngswell.solve import pardiso, umfpack
from ngswell.solve.direct import LinearSolver
from tests.scenes import block, deformed

with_mkl = pytest.mark.skipif(pardiso.library() is None, reason="MKL is not installed")
KINDS = [
    pytest.param(pardiso.Pardiso, id="Pardiso", marks=with_mkl),
    pytest.param(
        umfpack.Umfpack,
        id="UMFPACK",
        marks=pytest.mark.skipif(umfpack.library() is None, reason="not to be called from outside"),
    ),
]

PATTERN = 30


def sparse(dense, pattern=None):
    """A matrix with all entries of a pattern, zeros too."""
    rows, columns = np.nonzero(np.ones_like(dense) if pattern is None else pattern)
    return SparseMatrixd.CreateFromCOO(rows.tolist(), columns.tolist(), dense[rows, columns].tolist(), *dense.shape)


def every(size):
    free = BitArray(size)
    free.Set()
    return free


def put(matrix, dense):
    """Other values in the same matrix."""
    rows, columns, _ = (np.asarray(part) for part in matrix.COO())
    matrix.AsVector().FV().NumPy()[:] = dense[rows, columns]


def solved(factors, matrix, right):
    """Whether there is a solution, and which."""
    b, x = matrix.CreateColVector(), matrix.CreateColVector()
    b.FV().NumPy()[:] = right
    x[:] = 7.0
    return factors.solve(b, x), x.FV().NumPy().copy()


@pytest.mark.parametrize("kind", KINDS)
def test_solutions_are_those_of_the_free_part(kind):
    random = np.random.default_rng(2)
    dense = random.standard_normal((PATTERN, PATTERN))
    free = every(PATTERN)
    for dof in (0, 11, 29):
        free.Clear(dof)
    mine, right, matrix = np.array(list(free)), random.standard_normal(PATTERN), sparse(dense)
    factors = kind(matrix, free)
    assert factors.update()
    found, x = solved(factors, matrix, right)
    assert found
    # Round-off times the condition of a random matrix of 27 rows, some hundred.
    assert x[mine] == pytest.approx(np.linalg.solve(dense[np.ix_(mine, mine)], right[mine]), rel=1e-10)
    assert x[~mine].tolist() == [0.0, 0.0, 0.0]


def chain(stiffness, scale, zero=0.0):
    """A chain of 200 springs with every tenth node held by a multiplier, whose own block is `zero`, in units of `scale`."""
    held, size = np.arange(0, 200, 10), 220
    dense = np.zeros((size, size))
    dense[range(200), range(200)] = 2 * stiffness
    dense[range(199), range(1, 200)] = dense[range(1, 200), range(199)] = -0.9 * stiffness
    dense[held, range(200, size)] = dense[range(200, size), held] = scale
    dense[range(200, size), range(200, size)] = zero
    return dense


BOUND = chain(1.0, 1.0, 1.0) != 0


@pytest.mark.parametrize("kind", KINDS)
def test_zeros_on_the_diagonal_and_values_that_change_by_orders(kind):
    matrix, right = sparse(chain(1.0, 1.0), BOUND), np.random.default_rng(5).standard_normal(220)
    factors = kind(matrix, every(220))
    for stiffness in (1.0, 1e-9, 1e9):
        for scale in (1.0, 1e-7, 1e5):
            dense = chain(stiffness, scale)
            put(matrix, dense)
            assert factors.update()
            found, x = solved(factors, matrix, right)
            assert found
            # Backward error: a small multiple of round-off, row by row.
            sizes = np.abs(dense) @ np.abs(x) + np.abs(right)
            assert (np.abs(dense @ x - right) <= 1e-13 * sizes).all()


@pytest.mark.parametrize("kind", KINDS)
def test_a_singular_matrix_is_told(kind):
    dense = np.random.default_rng(6).standard_normal((PATTERN, PATTERN))
    dense[:, 3] = dense[3, :] = 0.0
    matrix, right = sparse(dense), np.ones(PATTERN)
    factors = kind(matrix, every(PATTERN))
    assert not (factors.update() and solved(factors, matrix, right)[0])
    dense[3, 3] = 1e-3  # negative control
    put(matrix, dense)
    assert factors.update()
    assert solved(factors, matrix, right)[0]
    put(matrix, np.outer(np.arange(1.0, 31.0), np.ones(PATTERN)))
    assert not (factors.update() and solved(factors, matrix, right)[0])
    put(matrix, np.full_like(dense, np.nan))
    assert not factors.update()


@with_mkl
def test_what_is_shared_is_that_of_the_last_analysis_alone():
    # What makes runs that go on from a checkpoint equal to the bit.
    right = np.random.default_rng(7).standard_normal(220)
    first, hard, last = chain(1.0, 1.0, -1.0), chain(1.0, 1e-3), chain(3.0, 1e-3)

    def history(*values):
        matrix = sparse(values[0], BOUND)
        factors, anew = pardiso.Pardiso(matrix, every(220)), []
        for dense in values:
            put(matrix, dense)
            assert factors.update()
            anew.append(factors.anew)
        return anew, solved(factors, matrix, right)[1].tolist()

    long, short = history(first, first, hard, last), history(hard, last)
    assert long[0] == [True, False, True, False]
    assert short[0] == [True, False]
    assert long[1] == short[1]


@with_mkl
def test_memory_is_given_back():
    problem = block().problem
    deformed(problem)
    matrix, mkl = problem.linearise(), pardiso.library()
    mkl.MKL_Mem_Stat.restype = ctypes.c_longlong
    buffers = ctypes.c_int()

    def taken():
        gc.collect()
        return mkl.MKL_Mem_Stat(ctypes.byref(buffers))

    kept = LinearSolver(problem.free, "pardiso")
    assert kept.factorise(matrix)
    before = taken()
    solver = LinearSolver(problem.free, "pardiso")
    assert solver.factorise(matrix)
    assert taken() > before + 8 * problem.space.ndof  # negative control
    del solver
    assert taken() == before
