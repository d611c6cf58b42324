"""Growth of perturbations from step to step, by the linearised one-step map."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from ngsolve import GridFunction
from numpy.typing import NDArray

from ngswell import checks
from ngswell.calls import in_turn
from ngswell.errors import NgswellError
from ngswell.problem.problem import Problem
from ngswell.setup.setup import Setup
from ngswell.setup.snapshot import Snapshot
from ngswell.solve.choice import solver_over
from ngswell.solve.factorisation import Factorisation
from ngswell.solve.newton import DampedNewton

SUBSPACE = 40
"""Largest Krylov space [vectors]."""

KEPT = 10
"""Ritz vectors that a restart keeps."""


@dataclass(frozen=True)
class Growth:
    """Leading eigenvalues of the one-step map: what one step multiplies a small perturbation by in the long run.

    `factor` is the dominant one: a float where it is real, negative if the perturbation alternates from step to step; else
    the complex one of its pair with positive imaginary part, |factor| the growth and 2π/arg the period in steps.
    `eigenvalues` are those found to the tolerance, largest modulus first (`factor` at least). `mode` lies on the problem's
    space, `mode.components[0]` is its displacement; its largest coefficient, in units of the unknown's natural size, is 1.
    Of a complex pair it is the real part.
    """

    factor: float | complex
    eigenvalues: NDArray
    mode: GridFunction


@in_turn
def growth_factor(
    setup: Setup, dt: float, state: Snapshot | None = None, tolerance: float = 1e-6, most_steps: int = 1000
) -> Growth:
    """Amplification of a small perturbation by one step of size `dt` [s] from `state` (the scene's initial state).

    With r(x_new; x_old) the discrete system and prescribed boundary values that depend on x_old where a treatment lags,
    the map is δx_new = −(∂r/∂x_new)⁻¹ (∂r/∂x_old) δx_old. The step from `state` is solved first, so that the state need not
    be at rest; then the factor says how two neighbouring solutions part in this step. The first matrix is NGSolve's
    linearisation at the end of the step; the second acts through central differences of the residual. Arnoldi's method
    finds the leading eigenvalues, to `tolerance` of their modulus, within `most_steps` applications of the map.

    Raises InputError for what cannot be meant, and NgswellError when the step or the iteration does not succeed.
    """
    dt = checks.positive("dt", dt, "s")
    problem = Problem(setup)
    problem.initialise()
    if state is not None:
        problem.check("state", state)
        problem.restore(state)
    scale = problem.sizes
    step = _linearised_step(problem, problem.time, dt, scale)
    values, vector = leading_eigenvalues(lambda v: step(v * scale) / scale, scale.size, tolerance, most_steps)
    mode = GridFunction(problem.space)
    real = vector.real * scale
    mode.vec.FV().NumPy()[:] = real / np.abs(real / scale).max()
    first = complex(values[0])
    return Growth(complex(first.real, abs(first.imag)) if first.imag else first.real, values, mode)


def _linearised_step(problem: Problem, time: float, dt: float, scale: NDArray) -> Callable[[NDArray], NDArray]:
    """δx_old → δx_new about the step of size `dt` from the problem's fields at `time`; `scale` is the size of unknowns."""
    residual, change = problem.fields.vec.CreateVector(), problem.fields.vec.CreateVector()
    old = problem.vector.copy()
    solver = solver_over(problem, None)
    problem.begin_step(time + dt, dt)
    failure = DampedNewton().solve(problem, Factorisation(solver)).failure
    if failure is not None:
        raise NgswellError(f"growth_factor: the step of {dt:g} s from t = {time:g} s does not succeed: {failure.text}")
    new = problem.vector.copy()
    if not solver.prepare(problem.linearise(), problem.ties):
        raise NgswellError(f"growth_factor: the linearised step of {dt:g} s from t = {time:g} s is singular")

    def perturbed(direction: NDArray) -> tuple[NDArray, NDArray]:
        problem.vector[:] = old + direction
        problem.begin_step(time + dt, dt, guess=new)
        problem.vector[:] -= problem.gap()
        problem.residual(residual)
        return residual.FV().NumPy().copy(), problem.vector.copy()

    def step(direction: NDArray) -> NDArray:
        size = 1e-5 / np.abs(direction / scale).max()
        plus, prescribed_plus = perturbed(size * direction)
        minus, prescribed_minus = perturbed(-size * direction)
        residual.FV().NumPy()[:] = (plus - minus) / (2 * size)
        if not solver.solve(residual, change):
            raise NgswellError("growth_factor: the linearised step is not finite")
        return (prescribed_plus - prescribed_minus) / (2 * size) - change.FV().NumPy()

    return step


def leading_eigenvalues(
    apply: Callable[[NDArray], NDArray], size: int, tolerance: float = 1e-6, most_steps: int = 1000
) -> tuple[NDArray, NDArray]:
    """Eigenvalues of largest modulus of a real linear map on vectors of `size`, and the eigenvector of the first.

    Arnoldi's method with reorthogonalisation. A full space is restarted from its leading Ritz vectors: with A V = V H + v bᵀ
    and an invariant subspace W of H, A (V W) = (V W) (Wᵀ H W) + v (Wᵀ b)ᵀ again. An eigenvalue counts as found when
    its residual |b · y| is below `tolerance` of its modulus. Raises NgswellError after `most_steps` applications without
    the first.
    """
    width = min(SUBSPACE, size)
    V, H = np.zeros((width + 1, size)), np.zeros((width + 1, width))
    start = apply(np.random.default_rng(0).standard_normal(size))  # in the range of the map
    if not np.linalg.norm(start) > 0:
        raise NgswellError("the linearised step forgets every perturbation at once")
    V[0], used, filled = start / np.linalg.norm(start), 0, 0
    while True:
        for j in range(filled, width):
            image = apply(V[j])
            used += 1
            length = np.linalg.norm(image)
            for _ in range(2):
                along = V[: j + 1] @ image
                H[: j + 1, j] += along
                image -= along @ V[: j + 1]
            H[j + 1, j] = np.linalg.norm(image)
            exhausted = H[j + 1, j] <= 1e-13 * max(length, np.abs(H).max())  # an invariant space: its eigenvalues are exact
            if not exhausted:
                V[j + 1] = image / H[j + 1, j]
            if exhausted or j + 1 == width or j % 5 == 4:
                values, vectors, found = _ritz(H[: j + 1, : j + 1], H[j + 1, : j + 1], tolerance)
                if exhausted or found[0]:
                    count = max(1, int(np.argmin([*found, False])))
                    return values[:count], vectors[:, 0] @ V[: j + 1]
        if used >= most_steps:
            raise NgswellError(
                f"no dominant mode after {used} applications of the linearised step; the last estimate is "
                f"{values[0]:.4g}, the next {values[1]:.4g}. Allow more (most_steps) or less accuracy (tolerance)."
            )
        W = _real_basis(vectors[:, :KEPT])
        filled = W.shape[1]
        kept = W.T @ H[:width, :width] @ W, H[width, :width] @ W
        V[:filled], V[filled] = W.T @ V[:width], V[width]
        H[:] = 0.0
        H[:filled, :filled], H[filled, :filled] = kept


def _ritz(H: NDArray, coupling: NDArray, tolerance: float) -> tuple[NDArray, NDArray, NDArray]:
    """Eigenvalues of H, largest modulus first, their vectors (columns), and which of them the coupling leaves settled."""
    values, vectors = np.linalg.eig(H)
    order = np.argsort(-np.abs(values), kind="stable")
    values, vectors = values[order], vectors[:, order]
    return values, vectors, np.abs(coupling @ vectors) <= tolerance * np.abs(values)


def _real_basis(vectors: NDArray) -> NDArray:
    """Orthonormal basis of the real and imaginary parts of the columns."""
    left, sizes, _ = np.linalg.svd(np.hstack([vectors.real, vectors.imag]), full_matrices=False)
    return left[:, sizes > 1e-10 * sizes[0]]
