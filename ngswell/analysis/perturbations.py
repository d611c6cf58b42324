"""Growth of perturbations in time, whatever the step: the stiffness that a displacement meets at a rate."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, pi
from typing import Any

import numpy as np
from ngsolve import BilinearForm, Grad, GridFunction, InnerProduct, Integrate, dx, sqrt
from numpy.typing import NDArray

from ngswell.errors import NgswellError, place
from ngswell.models.term import Kind
from ngswell.problem.forms import Form
from ngswell.problem.problem import Problem
from ngswell.solve.choice import solver_over
from ngswell.solve.direct import LinearSolver

SOLVES = 24
"""Krylov vectors in which a negative stiffness has to show."""

GLANCE = 5
"""Krylov vectors of a first look. In the unstable runs of studies/hard_cases a negative stiffness shows in one to four."""

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

    Forms and matrices are its own, so that looking changes nothing, unless a `solver` of the problem is given.
    """

    def __init__(self, problem: Problem, solver: LinearSolver | None = None) -> None:
        self.problem = problem
        self._system: Form | None = None
        if solver is None:
            whole = problem.reaches_inside
            self._system = problem.form(problem.terms, 1 / problem.dt, condense=not whole)
            solver = solver_over(problem, None if whole else self._system)
        self._solver = solver
        trial, test = problem.space.TnT()
        product = InnerProduct(Grad(trial[0]), Grad(test[0])) * problem.kinematics.weight
        self._size = BilinearForm(product * dx).Assemble().mat
        u = problem.ranges["u"]
        self._moving = np.zeros(problem.vector.size)
        self._moving[u] = np.array(list(problem.free), dtype=float)[u]
        for tie in problem.ties:
            self._moving[tie.dofs] = 1.0
        self._vectors = [problem.fields.vec.CreateVector() for _ in range(2)]
        self._values = [vector.FV().NumPy() for vector in self._vectors]

    def _factorise(self, rate: float) -> None:
        """Prepare solves with A + σ M at the present state, σ = `rate`."""
        step = self.problem.dt.Get()
        self.problem.dt.Set(1 / rate)
        if self._system is None:
            ready = self._solver.renew(self.problem)
        else:
            ready = self._solver.prepare(self._system.linearise(), self.problem.ties)
        self.problem.dt.Set(step)
        if not ready:
            raise NgswellError(f"the linearised balances are singular or not finite for perturbations of rate {rate:g} 1/s")

    def _respond(self, force: NDArray) -> NDArray:
        """(A + σ M)⁻¹ force, all unknowns."""
        self._values[0][:] = force
        if not self._solver.solve(*self._vectors):
            raise NgswellError("the response to a perturbation is not finite")
        return self._values[1].copy()

    def _product(self, matrix: Any, vector: NDArray) -> NDArray:
        self._values[0][:] = vector
        self._vectors[1].data = matrix * self._vectors[0]
        return self._values[1].copy()

    def softest(self, rate: float) -> tuple[float, NDArray] | None:
        """Most negative eigenvalue κ found of K(σ) v = κ H v, σ = `rate`, and its v with all unknowns; None if none is.

        H is ∫|Grad v|², so that κ [N/mm²] is a stiffness. Arnoldi's method on K⁻¹H, whose eigenvalues 1/κ lie between 0 and
        those of the softest modes: negative ones stand apart, the more so the closer to the limit of stability. At rest K⁻¹H
        is symmetric and its Ritz values are bounds: one that is negative proves a negative eigenvalue.
        """
        self._factorise(rate)
        return self._negative(SOLVES, SETTLED)

    def doubtful(self, rate: float | None = None) -> bool:
        """Whether a first look at K(σ) shows a negative value, settled or not; `softest` tells whether it is one.

        σ = `rate`, or that of the matrix that the given solver has factorised.
        """
        if rate is not None:
            self._factorise(rate)
        return self._negative(GLANCE, inf) is not None

    def _negative(self, most: int, settled: float) -> tuple[float, NDArray] | None:
        """The first negative Ritz value that may be off by no more than the share `settled`, within `most` vectors."""
        V, images, responses = (np.empty((most + 1, self._moving.size)) for _ in range(3))
        H = np.zeros((most + 1, most))
        new = self._respond(np.random.default_rng(0).standard_normal(self._moving.size) * self._moving) * self._moving
        image = self._product(self._size, new) * self._moving
        length = sqrt(float(new @ image))
        for j in range(most):
            V[j], images[j] = new / length, image / length
            responses[j] = self._respond(images[j])
            new = responses[j] * self._moving
            for _ in range(2):
                along = images[: j + 1] @ new
                H[: j + 1, j] += along
                new -= along @ V[: j + 1]
            image = self._product(self._size, new) * self._moving
            H[j + 1, j] = length = sqrt(max(0.0, float(new @ image)))
            exhausted = length <= 1e-13 * np.abs(H).max()
            if settled == inf and not exhausted and j + 1 < most:
                continue  # the last values are the lowest
            values, vectors = np.linalg.eig(H[: j + 1, : j + 1])
            first = int(np.argmin(values.real))
            value, vector = values[first], vectors[:, first]
            left = length * abs(vector[-1]) / float(np.linalg.norm(vector))
            if value.real < 0 and (exhausted or left < -settled * value.real):
                return 1 / float(value.real), vector.real @ responses[: j + 1]
            if exhausted:
                return None
        return None

    def fastest(self, slowest: float, guess: float | None = None) -> Instability | None:
        """The fastest growing perturbation; None if none grows faster than `slowest` [1/s]. `guess` is a rate nearby."""
        low = slowest
        found = self.softest(low)
        if found is None:
            return None
        ratio = 10.0  # of the next two rates, squared each time
        if guess is not None and guess / NEARBY > low:
            near = self.softest(guess / NEARBY)
            if near is not None:
                low, found, ratio = guess / NEARBY, near, NEARBY**2
        high = low * ratio
        while (above := self.softest(high)) is not None:
            if high > UNDRAINED:
                return self._instability(inf, above[1])
            ratio = min(ratio**2, 10 * UNDRAINED / high)
            low, found, high = high, above, high * ratio
        while high > NEARBY**2 * low:
            middle = sqrt(low * high)
            within = self.softest(middle)
            if within is None:
                high = middle
            else:
                low, found = middle, within
        return self._settled(low, high, found[1])

    def _settled(self, low: float, high: float, mode: NDArray) -> Instability:
        """The rate s between `low` and `high`: (A + σ M)⁻¹ M v = v/(σ − s), by inverse iteration with shifts that follow.

        Where that runs into a slower mode, `mode` and the middle between the bounds.
        """
        scale = self.problem.sizes
        rates = self.problem.form([term for term in self.problem.terms if term.kind is Kind.RATE]).linearise()
        shift, first = low, mode
        for _ in range(5):
            self._factorise(shift)
            content = self._product(rates, mode)
            self.problem.team.sum_values(content)
            response = self._respond(content)
            scaled, old = response / scale, mode / scale
            inverse = float(scaled @ old / (old @ old))
            rate = shift - 1 / inverse
            mode = response / np.abs(scaled).max()
            if not low <= rate <= high:
                return self._instability(sqrt(low * high), first)
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
