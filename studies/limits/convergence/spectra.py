"""A gel held sideways: eigenvalues of the momentum's tangent without flow, growth rates with it, and closed forms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from ngsolve import BilinearForm, Grad, InnerProduct, dx, x, y
from numpy.typing import NDArray

from ngswell import TABLE_2, Bath, Penalty, PlaneStrain, Roller, Scene, rectangle
from ngswell.closed_forms.homogeneous import homogeneous_equilibrium
from ngswell.physics import donnan
from ngswell.problem.problem import Problem
from studies.limits.convergence.variants import as_variant

CELL = 0.05  # mm, as in the free-swelling scene
STRETCHES = (1.25, 1.5, 1.75, 2.0, 2.25, 2.5, 2.75, 3.0, 3.25, 3.5, 3.75)
BATHS = (0.5, 0.3, 0.2, 0.15, 0.12, 0.1)  # mol/l
SOFTENED = ("present", "smooth")
"""The variants whose eigenvalues are compared: the other two share their momentum balance with one of them."""


def held_sideways(name: str, cells: int, bath: float, held: bool = False) -> Scene:
    """cells² quadrilaterals between frictionless walls, a bath on top; `held`: the surface cannot move."""
    supports = [Roller("left|right", "x"), Roller("bottom", "y")] + [Roller("top", "xy")] * held
    size = cells * CELL
    scene = Scene(
        mesh=rectangle(size, size, cells, cells),
        kinematics=PlaneStrain(),
        material=TABLE_2,
        supports=supports,
        baths=[Bath("top", c=bath, treatment=Penalty(40.0))],
    )
    return as_variant(scene, name)


def swell(problem: Problem, J: float, bath: float) -> NDArray:
    """F = diag(1, J), free of stress on top, ions in equilibrium with the bath; at rest if J is that of the bath."""
    m = TABLE_2
    volumetric = m.lam * (1 - m.nS0) ** 2 * (J / (1 - m.nS0) - J / (J - m.nS0))
    cfc = (1 - m.nS0) * m.cfc0 / (J - m.nS0)
    problem.initialise()
    problem.fields.components[0].Set((0 * x, (J - 1) * y))
    for name, value in (
        ("p", (m.mu * (J * J - 1) + volumetric) / J),
        ("c", donnan.cations(bath, cfc)),
        ("cfc", cfc),
    ):
        problem.vector[problem.ranges[name]] = value
    return problem.vector.copy()


def dense(matrix: Any) -> NDArray:
    """A sparse matrix of NGSolve as a full one."""
    rows, columns, values = matrix.COO()
    full = np.zeros((matrix.height, matrix.width))
    full[np.array(rows), np.array(columns)] = np.array(values)
    return full


@dataclass(frozen=True)
class Spectrum:
    """Eigenvalues, ascending, in units of µ |Grad v|², and the first mode (all coefficients of u)."""

    values: NDArray
    mode: NDArray


def undrained(problem: Problem) -> Spectrum:
    """The momentum's tangent at frozen p, c, cfc on displacements with ∫ δJ q = 0 for every discrete q."""
    space = problem.space.components[0]
    trial, test = space.TnT()
    size = dense(BilinearForm(TABLE_2.mu * InnerProduct(Grad(trial), Grad(test)) * dx).Assemble().mat)
    tangent = dense(problem.linearise())
    u = np.flatnonzero(list(problem.free))
    u = u[u < problem.ranges["u"].stop]
    _, sizes, directions = np.linalg.svd(tangent[u, problem.ranges["p"]].T)
    kernel = directions[(sizes > 1e-12 * sizes[0]).sum() :].T
    scale = np.linalg.inv(np.linalg.cholesky(kernel.T @ size[np.ix_(u, u)] @ kernel))
    values, modes = np.linalg.eigh(scale @ kernel.T @ tangent[np.ix_(u, u)] @ kernel @ scale.T)
    mode = np.zeros(space.ndof)
    mode[u] = kernel @ scale.T @ modes[:, 0]
    return Spectrum(values, mode)


def growth_rates(problem: Problem) -> NDArray:
    """Rates s [1/s] of perturbations exp(s t) of the present state: s M v = −A v, in descending order of their real part.

    A is the tangent without, M that of the contents alone: zero but for the rows of p and c, so −1/s are the eigenvalues of
    those rows of M A⁻¹. Backward Euler multiplies a perturbation by 1/(1 − s Δt) a step.
    """
    problem.dt.Set(1e30)
    stationary = dense(problem.linearise())
    problem.dt.Set(1.0)
    contents = dense(problem.linearise()) - stationary
    free = np.flatnonzero(list(problem.free))
    rows = np.r_[problem.ranges["p"], problem.ranges["c"]]
    units = (free[:, None] == rows).astype(float)
    response = np.linalg.solve(stationary[np.ix_(free, free)], units)
    rates = -1 / np.linalg.eigvals(contents[np.ix_(rows, free)] @ response)
    return rates[np.argsort(-rates.real)]


# -- closed forms --------------------------------------------------------------------------------------------------------


def zero_crossing(J: Sequence[float], values: Sequence[float]) -> float:
    """The first J at which the values, falling, pass zero; the last J if none does."""
    for a, b, left, right in zip(J, J[1:], values, values[1:], strict=False):
        if left > 0 >= right:
            return a + (b - a) * left / (left - right)
    return J[-1]


def bulk_stiffness(J: float, bath: float | None) -> float:
    """g″ of the energy µ/2 |F|² + g(J) [N/mm²]: the solid's and, drained to a `bath` [mol/l], −dp_D/dJ of (38)."""
    m = TABLE_2
    solid = m.mu / J**2 + m.lam * (1 - m.nS0) ** 2 / (J - m.nS0) ** 2
    if bath is None:
        return solid
    cfc = (1 - m.nS0) * m.cfc0 / (J - m.nS0)
    return solid + m.RT * cfc**2 / (2 * (J - m.nS0) * float(np.sqrt(bath**2 + cfc**2 / 4)))


def wrinkling(J: float, stiffness: float) -> float:
    """Positive where the free surface of a half-space with F = diag(1, J) stays flat (plane strain), zero where it wrinkles.

    Displacements exp(ikX + ksY) of the half-space Y < 0 of energy µ/2 |F|² + g(J), free of stress at rest, have s = 1 and
    s² = (µ + g″J²)/(µ + g″); both parts of the traction vanish where 4 J² s = (1 + J²)². The length of the wrinkles is
    free. For g″ → ∞ this is Biot's surface, J = 3.383.
    """
    s = np.sqrt((TABLE_2.mu + stiffness * J**2) / (TABLE_2.mu + stiffness))
    return float(4 * J**2 * s - (1 + J**2) ** 2)


def closed_forms() -> dict[str, float]:
    """J at which surfaces wrinkle: incompressible; at rest with its bath, drained; with the solid's bulk stiffness alone."""
    J = np.linspace(1.05, 5, 4000).tolist()
    baths = np.geomspace(0.05, 1.0, 60)[::-1]
    rest = [homogeneous_equilibrium(TABLE_2, bath, "confined").J for bath in baths]
    drained = [wrinkling(a, bulk_stiffness(a, bath)) for a, bath in zip(rest, baths, strict=True)]
    return {
        "biot_critical_J": zero_crossing(J, [wrinkling(a, 1e9) for a in J]),
        "drained_critical_J": zero_crossing(rest, drained),
        "solid_critical_J": zero_crossing(J, [wrinkling(a, bulk_stiffness(a, None)) for a in J]),
    }


# -- over the stretch, and over the bath ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Softening:
    """A variant on cells² cells, without flow: over `STRETCHES` the smallest eigenvalue and how many are negative."""

    variant: str
    cells: int
    smallest: list[float]
    negative: list[int]


def softening(variant: str, cells: int) -> Softening:
    """The eigenvalues without flow over `STRETCHES`."""
    problem = held_sideways(variant, cells, 0.3).problem
    smallest, negative = [], []
    for J in STRETCHES:
        swell(problem, J, 0.3)
        found = undrained(problem).values
        smallest.append(float(found[0]))
        negative.append(int((found < 0).sum()))
    return Softening(variant, cells, smallest, negative)


def held_eigenvalue(variant: str, cells: int) -> float:
    """The smallest at J = 3 with the surface held."""
    control = held_sideways(variant, cells, 0.3, held=True).problem
    swell(control, 3.0, 0.3)
    return float(undrained(control).values[0])


@dataclass(frozen=True)
class Growth:
    """A variant on cells² cells at rest in `BATHS`: J, the fastest growth [1/s] and how many perturbations grow."""

    variant: str
    cells: int
    J: list[float]
    fastest: list[float]
    growing: list[int]


def growth(variant: str, cells: int) -> Growth:
    """The growth rates with flow at rest in `BATHS`."""
    at_rest = [homogeneous_equilibrium(TABLE_2, bath, "confined").J for bath in BATHS]
    fastest, growing = [], []
    for bath, J in zip(BATHS, at_rest, strict=True):
        problem = held_sideways(variant, cells, bath).problem
        swell(problem, J, bath)
        rates = growth_rates(problem).real
        fastest.append(float(rates[0]))
        growing.append(int((rates > 0).sum()))
    return Growth(variant, cells, at_rest, fastest, growing)
