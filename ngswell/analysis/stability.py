"""Growth of perturbations: from step to step, by the linearised one-step map; in time, whatever the step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, pi, sqrt
from typing import TYPE_CHECKING, Any

import numpy as np
from ngsolve import BilinearForm, Grad, GridFunction, InnerProduct, Integrate, Parameter, dx
from numpy.typing import NDArray

from ngswell import checks
from ngswell.errors import InputError, NgswellError
from ngswell.problem.problem import Problem, Snapshot
from ngswell.solve.direct import CondensedSolver, LinearSolver
from ngswell.solve.newton import Newton

if TYPE_CHECKING:
    from ngswell.scene import Scene

SUBSPACE = 40
"""Largest Krylov space [vectors]."""

KEPT = 10
"""Ritz vectors that a restart keeps."""

SOLVES = 24
"""Krylov vectors in which a negative stiffness has to show."""

SETTLED = 0.5
"""A Ritz value counts as negative when what it may be off by is below this share of it."""

NEARBY = 1.2
"""Ratio of rates within which inverse iteration is trusted to find the fastest."""

UNDRAINED = 1e6
"""Perturbations that grow faster than this [1/s] do so without any flow: only inertia, which is not modelled, holds them."""


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


def growth_factor(
    scene: Scene, dt: float, state: Snapshot | None = None, tolerance: float = 1e-6, most_steps: int = 1000
) -> Growth:
    """Amplification of a small perturbation by one step of size `dt` [s] from `state` (the scene's initial state).

    With r(x_new; x_old) the discrete system and prescribed boundary values that depend on x_old where a treatment lags,
    the map is δx_new = −(∂r/∂x_new)⁻¹ (∂r/∂x_old) δx_old. The step from `state` is solved first, so that the state need not
    be at rest; then the factor says how two neighbouring solutions part in this step. The first matrix is NGSolve's
    linearisation at the end of the step; the second acts through central differences of the residual. Arnoldi's method
    finds the leading eigenvalues, to `tolerance` of their modulus, within `most_steps` applications of the map.

    The problem's fields stay as they were. Raises InputError for what cannot be meant, and NgswellError when the step or
    the iteration does not succeed.
    """
    dt = checks.positive("dt", dt, "s")
    problem = scene.problem
    if state is not None and state.values.shape != problem.vector.shape:
        raise InputError(f"state: the snapshot has {state.values.size} unknowns, the scene {problem.vector.size}")
    fields, time = problem.vector.copy(), problem.time
    try:
        problem.initialise()
        if state is not None:
            problem.restore(state)
        scale = np.concatenate([np.full(r.stop - r.start, problem.references[n]) for n, r in problem.ranges.items()])
        step = _linearised_step(problem, scene.start if state is None else state.time, dt, scale)
        values, vector = leading_eigenvalues(lambda v: step(v * scale) / scale, scale.size, tolerance, most_steps)
    finally:
        problem.set_time(time)
        problem.vector[:] = fields
    mode = GridFunction(problem.space)
    real = vector.real * scale
    mode.vec.FV().NumPy()[:] = real / np.abs(real / scale).max()
    first = complex(values[0])
    return Growth(complex(first.real, abs(first.imag)) if first.imag else first.real, values, mode)


def _linearised_step(problem: Problem, time: float, dt: float, scale: NDArray) -> Callable[[NDArray], NDArray]:
    """δx_old → δx_new about the step of size `dt` from the problem's fields at `time`; `scale` is the size of unknowns."""
    residual, change = problem.fields.vec.CreateVector(), problem.fields.vec.CreateVector()
    old = problem.vector.copy()
    solver = LinearSolver(problem.free)
    problem.begin_step(time + dt, dt)
    outcome = Newton().solve(problem, solver)
    if outcome.reason is not None:
        raise NgswellError(f"growth_factor: the step of {dt:g} s from t = {time:g} s does not succeed: {outcome.reason}")
    new = problem.vector.copy()
    if not solver.factorise(problem.linearise()):
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


@dataclass(frozen=True)
class Instability:
    """A perturbation of a state that grows as exp(s t).

    `rate` is s [1/s], infinite if it needs no flow at all. `where` [mm] is the vertex that the mode moves most, `wavelength`
    [mm] what a wrinkle of a plane surface with this ∫|v|² and ∫|Grad v|² has, 2π (2 ∫|v|²/∫|Grad v|²)^½; both in the
    reference configuration. `mode` lies on the problem's space; its largest displacement at a vertex is 1 mm.
    """

    rate: float
    where: tuple[float, ...]
    wavelength: float
    mode: GridFunction

    def __str__(self) -> str:
        grows = f"by a factor e in {1 / self.rate:.3g} s" if self.rate < inf else "at once, without any flow"
        place = ", ".join(f"{x:.4g}" for x in self.where)
        return f"perturbations grow {grows}, most near ({place}) mm, in wrinkles of about {self.wavelength:.2g} mm"


class Perturbations:
    """Small perturbations v exp(s t) of the present state of `problem`, the state itself held: (A + s M) v = 0.

    A is the tangent without rates, M that of the contents. Without the unknowns of the flow, A + σ M is the stiffness

        K(σ) = A_uu − A_up (A_pp + σ M_pp)⁻¹ (A_pu + σ M_pu)

    that a displacement meets when it changes at the rate σ: the drained one at 0, growing with σ to the undrained one. A
    mode that grows at the rate s has K(s) v = 0, so K(σ) has one negative eigenvalue for each rate above σ, however large,
    and for each mode that grows without flow. A + σ M is the tangent of a step of backward Euler of 1/σ.

    That is exact at rest, where K is symmetric. Elsewhere it holds for rates above those at which the state itself changes.
    Growth in oscillations (complex s) is not looked for.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self._shift = Parameter(1.0)
        closed = any(term.normal_derivatives for term in problem.terms)
        self._system = BilinearForm(problem.space, condense=not closed)
        self._contents = BilinearForm(problem.space)
        for term in problem.terms:
            self._system += problem.integral(term, self._shift if term.kind == "rate" else None)
            if term.kind == "rate":
                self._contents += problem.integral(term)
        self._solver = LinearSolver(problem.free) if closed else CondensedSolver(self._system, problem.free)
        trial, test = problem.space.TnT()
        product = InnerProduct(Grad(trial[0]), Grad(test[0])) * problem.kinematics.weight
        self._size = BilinearForm(product * dx).Assemble().mat
        u = problem.ranges["u"]
        self._moving = np.zeros(problem.vector.size)
        self._moving[u] = np.array(list(problem.free), dtype=float)[u]
        self._vectors = [problem.fields.vec.CreateVector() for _ in range(2)]

    def _factorise(self, rate: float) -> None:
        """Prepare solves with A + σ M at the present state, σ = `rate`."""
        self._shift.Set(rate)
        self._system.AssembleLinearization(self.problem.fields.vec)
        if not self._solver.factorise(self._system.mat):
            raise NgswellError(f"the linearised balances are singular or not finite for perturbations of rate {rate:g} 1/s")

    def _respond(self, force: NDArray) -> NDArray:
        """(A + σ M)⁻¹ force, all unknowns."""
        right, response = self._vectors
        right.FV().NumPy()[:] = force
        if not self._solver.solve(right, response):
            raise NgswellError("the response to a perturbation is not finite")
        return response.FV().NumPy().copy()

    def _product(self, matrix: Any, vector: NDArray) -> NDArray:
        right, result = self._vectors
        right.FV().NumPy()[:] = vector
        result.data = matrix * right
        return result.FV().NumPy().copy()

    def softest(self, rate: float) -> tuple[float, NDArray] | None:
        """Most negative eigenvalue κ found of K(σ) v = κ H v, σ = `rate`, and its v with all unknowns; None if none is.

        H is ∫|Grad v|², so that κ [N/mm²] is a stiffness. Arnoldi's method on K⁻¹H, whose eigenvalues 1/κ lie between 0 and
        those of the softest modes: negative ones stand apart, the more so the closer to the limit of stability. At rest K⁻¹H
        is symmetric and its Ritz values are bounds: one that is negative proves a negative eigenvalue.
        """
        self._factorise(rate)
        V: list[NDArray] = []
        images: list[NDArray] = []
        responses: list[NDArray] = []
        H = np.zeros((SOLVES + 1, SOLVES))
        start = self._respond(np.random.default_rng(0).standard_normal(self._moving.size) * self._moving) * self._moving
        image = self._product(self._size, start) * self._moving
        length = sqrt(float(start @ image))
        V.append(start / length)
        images.append(image / length)
        for j in range(SOLVES):
            responses.append(self._respond(images[j]))
            new = responses[j] * self._moving
            for _ in range(2):
                along = np.array(images) @ new
                H[: j + 1, j] += along
                new -= along @ np.array(V)
            image = self._product(self._size, new) * self._moving
            H[j + 1, j] = sqrt(max(0.0, float(new @ image)))
            values, vectors = np.linalg.eig(H[: j + 1, : j + 1])
            first = int(np.argmin(values.real))
            value, vector = values[first], vectors[:, first]
            left = abs(H[j + 1, j] * vector[-1]) / float(np.linalg.norm(vector))
            exhausted = H[j + 1, j] <= 1e-13 * np.abs(H).max()
            if value.real < 0 and (exhausted or left < -SETTLED * value.real):
                return 1 / float(value.real), vector.real @ np.array(responses)
            if exhausted:
                return None
            V.append(new / H[j + 1, j])
            images.append(image / H[j + 1, j])
        return None

    def fastest(self, slowest: float, guess: float | None = None) -> Instability | None:
        """The fastest growing perturbation; None if none grows faster than `slowest` [1/s]. `guess` is a rate nearby."""
        low = slowest
        found = self.softest(low)
        if found is None:
            return None
        ratio = 10.0
        if guess is not None and guess / NEARBY > low:
            near = self.softest(guess / NEARBY)
            if near is not None:
                low, found, ratio = guess / NEARBY, near, NEARBY**2
        high = low * ratio
        while (above := self.softest(high)) is not None:
            low, found, high = high, above, high * ratio
            if low > UNDRAINED:
                return self._instability(inf, found[1])
        while high > NEARBY**2 * low:
            middle = sqrt(low * high)
            within = self.softest(middle)
            if within is None:
                high = middle
            else:
                low, found = middle, within
        return self._settled(low, high, found[1])

    def _settled(self, low: float, high: float, mode: NDArray) -> Instability:
        """The rate s between `low` and `high`: (A + σ M)⁻¹ M v = v/(σ − s), by inverse iteration with shifts that follow."""
        scale = np.concatenate(
            [np.full(r.stop - r.start, self.problem.references[n]) for n, r in self.problem.ranges.items()]
        )
        self._contents.AssembleLinearization(self.problem.fields.vec)
        shift = rate = low
        for _ in range(5):
            self._factorise(shift)
            response = self._respond(self._product(self._contents.mat, mode))
            scaled, old = response / scale, mode / scale
            inverse = float(scaled @ old / (old @ old))
            rate = shift - 1 / inverse
            mode = response / np.abs(scaled).max()
            if not low <= rate <= high:
                raise NgswellError(f"no growth rate was found between {low:g} and {high:g} 1/s")
            if np.linalg.norm(scaled - inverse * old) <= 1e-4 * np.linalg.norm(scaled):
                break
            shift = rate
        return self._instability(rate, mode)

    def _instability(self, rate: float, mode: NDArray) -> Instability:
        problem, mesh = self.problem, self.problem.mesh
        field = GridFunction(problem.space)
        values = field.vec.FV().NumPy()
        values[:] = mode
        moves = values[problem.ranges["u"]].reshape(problem.kinematics.dimension, -1)[:, : mesh.nv]
        moves = np.linalg.norm(moves, axis=0)
        vertex = int(np.argmax(moves))
        values /= moves[vertex]
        v, weight = field.components[0], problem.kinematics.weight
        size, slope = (Integrate(InnerProduct(f, f) * weight, mesh, order=2 * problem.model.order) for f in (v, Grad(v)))
        return Instability(rate, tuple(mesh.vertices[vertex].point), 2 * pi * sqrt(2 * size / slope), field)


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
