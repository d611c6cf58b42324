"""Growth of perturbations from step to step, predicted from the linearised one-step map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ngswell.errors import InputError, NgswellError
from ngswell.scene import Scene
from ngswell.solvers import LinearSolver


@dataclass(frozen=True)
class Growth:
    """Dominant eigenvalue of the one-step map and its mode (all coefficients, in the order of the space)."""

    factor: float
    mode: NDArray


def growth_factor(scene: Scene, dt: float, tolerance: float = 1e-6, most_iterations: int = 500) -> Growth:
    """Amplification of a small perturbation by one step of size `dt` [s] about the scene's initial equilibrium.

    With r(x_new; x_old) the discrete system and prescribed boundary values that depend on x_old where a treatment lags,
    the map is δx_new = −(∂r/∂x_new)⁻¹ (∂r/∂x_old) δx_old. The first matrix is NGSolve's linearisation; the second acts
    through central differences of the residual. Power iteration finds the dominant eigenvalue, which for a lagged
    boundary is real. Raises InputError if the initial state is not an equilibrium and NgswellError when
    the iteration does not settle.
    """
    if not dt > 0:
        raise InputError(f"dt has to be positive, got {dt!r} s")
    problem = scene.problem
    problem.initialise()
    rest = problem.vector.copy()
    time = scene.start + dt
    residual, change = problem.fields.vec.CreateVector(), problem.fields.vec.CreateVector()
    scale = np.concatenate([np.full(r.stop - r.start, problem.references[n]) for n, r in problem.ranges.items()])

    problem.begin_step(time, dt)
    solver = LinearSolver(problem.free)
    problem.residual(residual)
    if not solver.factorise(problem.linearise()) or not solver.solve(residual, change):
        raise NgswellError("the linearised step is singular")
    moved = np.abs(change.FV().NumPy() / scale).max()
    if moved > 1e-6:
        raise InputError(f"the scene's initial state is no equilibrium: one step moves it by {moved:.1e} of its size")

    def perturbed(direction: NDArray) -> tuple[NDArray, NDArray]:
        problem.vector[:] = rest + direction
        problem.begin_step(time, dt, guess=rest)
        problem.residual(residual)
        return residual.FV().NumPy().copy(), problem.vector - rest

    def step(direction: NDArray) -> NDArray:
        size = 1e-5 / np.abs(direction / scale).max()
        plus, boundary_plus = perturbed(size * direction)
        minus, boundary_minus = perturbed(-size * direction)
        residual.FV().NumPy()[:] = (plus - minus) / (2 * size)
        solver.solve(residual, change)
        return (boundary_plus - boundary_minus) / (2 * size) - change.FV().NumPy()

    mode = np.random.default_rng(0).standard_normal(rest.size) * scale
    for _ in range(most_iterations):
        mode /= np.linalg.norm(mode / scale)
        image = step(mode)
        factor = float((mode / scale) @ (image / scale))
        if np.linalg.norm((image - factor * mode) / scale) <= tolerance * abs(factor):
            problem.vector[:] = rest
            return Growth(factor, mode)
        mode = image
    raise NgswellError(f"no dominant real mode after {most_iterations} iterations; last estimate {factor:.3g}")
