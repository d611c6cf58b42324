"""Growth of perturbations in time, whatever the step: the stiffness that a displacement meets at a rate."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, pi
from typing import Any

import numpy as np
from ngsolve import BilinearForm, Grad, GridFunction, InnerProduct, Integrate, Parameter, dx, sqrt
from numpy.typing import NDArray

from ngswell.errors import NgswellError, place
from ngswell.models.term import Kind
from ngswell.problem.forms import form
from ngswell.problem.problem import Problem
from ngswell.solve.direct import CondensedSolver, LinearSolver

SOLVES = 24
"""Krylov vectors in which a negative stiffness has to show."""

SETTLED = 0.5
"""A Ritz value counts as negative when what it may be off by is below this share of it."""

NEARBY = 1.2
"""Ratio of rates within which inverse iteration is trusted to find the fastest."""

UNDRAINED = 1e6
"""Perturbations that grow faster than this [1/s] do so without any flow: only inertia, which is not modelled, holds them."""


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
        return f"perturbations grow {grows}, most near {place(self.where)} mm, in wrinkles of about {self.wavelength:.2g} mm"


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
        whole = problem.reaches_inside
        self._system = form(problem, problem.terms, self._shift, condense=not whole)
        self._contents = form(problem, [term for term in problem.terms if term.kind is Kind.RATE])
        self._solver = LinearSolver(problem.free) if whole else CondensedSolver(self._system, problem.free)
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
        scale = self.problem.sizes
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
        moves = np.linalg.norm(problem.vertex_values(values, "u"), axis=0)
        vertex = int(np.argmax(moves))
        values /= moves[vertex]
        v, weight = field.components[0], problem.kinematics.weight
        size, slope = (Integrate(InnerProduct(f, f) * weight, mesh, order=2 * problem.model.order) for f in (v, Grad(v)))
        return Instability(rate, tuple(mesh.vertices[vertex].point), 2 * pi * sqrt(2 * size / slope), field)
