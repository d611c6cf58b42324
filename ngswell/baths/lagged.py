"""Prescribed values with the charge of the last step: the scheme that oscillates, and the remedies for it that Ehlers and
Acartürk list, p. 546.

A rule turns the charges of the last step at the vertices of the mesh into charges at the vertices of a bath's boundary; the
bath prescribes p_D and c_D with these. Between vertices the sampled charge is linear, whatever the order of the fields.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import ClassVar, NamedTuple, Protocol, runtime_checkable

import numpy as np
from ngsolve import CoefficientFunction, GridFunction
from numpy.typing import NDArray

from ngswell import checks
from ngswell.baths.boundary import BathBoundary
from ngswell.baths.treatment import Charge, Prescribed, PrescribedBoundary
from ngswell.errors import InputError
from ngswell.models.model import Model


class Slopes(NamedTuple):
    """How the prescribed values follow the charge, at the vertices of a bath's boundary."""

    p: NDArray  # dp_D/dcfc [N/mm² per mol/l]
    c: NDArray  # dc_D/dcfc [-]


@runtime_checkable
class SamplingRule(Protocol):
    """Where `Lagged(rule)` takes the charge from."""

    def sample(self, charges: NDArray, boundary: BathBoundary, slopes: Slopes) -> NDArray:
        """Charges at the bath's vertices [mol/l] from those at all vertices of the mesh."""
        ...


@dataclass(frozen=True)
class InnerLayer:
    """The charge of the inner layer of cells: at a vertex of the boundary, the mean over those vertices of the cells
    touching it that lie at no bath. In one dimension that is the neighbour.

    The paper's second remedy, its reference [1]. The sample is taken one cell away, so p_D and c_D carry an error of first
    order in the cell size wherever the charge varies across the boundary.
    """

    def __str__(self) -> str:
        return "from the inner layer of cells"

    def sample(self, charges: NDArray, boundary: BathBoundary, slopes: Slopes) -> NDArray:
        return np.array([charges[inner].mean() for inner in boundary.inner])


@dataclass(frozen=True)
class Averaged:
    """The mean of the charge at the vertex and at its neighbours along the bath's boundary: the paper's third remedy.

    In one dimension the vertex itself. The reach is one cell, so that it shrinks with the mesh. Of a saw-tooth, +1, −1, +1,
    the mean over three leaves −1/3.
    """

    def __str__(self) -> str:
        return "averaged over neighbours on the boundary"

    def sample(self, charges: NDArray, boundary: BathBoundary, slopes: Slopes) -> NDArray:
        on_boundary = charges[boundary.vertices]
        return np.array([on_boundary[neighbours].mean() for neighbours in boundary.neighbours])


@dataclass(frozen=True)
class LeastSquares:
    """A polynomial along the boundary of a bath, fitted to the charge by weighted least squares: the paper's first remedy.

    After Snijders et al., as the paper reports it: the error of p and c at the boundary is minimised, weighted with factors.
    Over the polynomials q of `degree` in the reference coordinates,

        Σ_i A_i { w_p [p_D(q_i) − p_D(cfc_i)]² + w_c [c_D(q_i) − c_D(cfc_i)]² } → min,

    A_i being the vertices' areas and `weights` = (w_p, w_c) [mm⁴/N², l²/mol²]. The differences are linearised about cfc_i,
    which leaves linear least squares with the weights A_i [w_p (dp_D/dcfc)² + w_c (dc_D/dcfc)²]: both errors are of one
    function, so the factors only shift weight between vertices of different charge or bath. One polynomial for each `Bath`,
    round its corners too; sides with a `Bath` each are fitted apart.

    The default `degree` 0 is the one that leaves no mode along the boundary to grow: the degree 1 already reproduces the
    tilt, the mode of a strip one cell wide. It is also the crudest: a charge that varies along the bath needs a higher
    degree, at the price of the modes that this degree carries.
    """

    degree: int = 0
    weights: tuple[float, float] = (1.0, 1.0)

    def __post_init__(self) -> None:
        checks.set_fields(self, degree=checks.integer("LeastSquares: degree", self.degree, 0, 6))
        weights = checks.vector("LeastSquares: weights", self.weights, 1e12, "mm⁴/N² or l²/mol²")
        if len(weights) != 2:
            raise InputError(f"LeastSquares: weights {weights!r} have to be two numbers, (for p, for c)")
        if min(weights) < 0 or not any(weights):
            raise InputError(f"LeastSquares: weights {weights!r} have to be finite, not negative, and not both 0")
        checks.set_fields(self, weights=weights)

    def __str__(self) -> str:
        return f"by a polynomial of degree {self.degree} along the bath (least squares)"

    def sample(self, charges: NDArray, boundary: BathBoundary, slopes: Slopes) -> NDArray:
        for_p, for_c = self.weights
        weights = boundary.areas * (for_p * slopes.p**2 + for_c * slopes.c**2)
        if not weights.any():  # without charge p_D has no slope
            weights = boundary.areas
        roots = np.sqrt(weights)
        shapes = _monomials(boundary.places, self.degree)
        # The fitted values are unique, the coefficients are not: on a straight side the coordinates depend on each other.
        fit = np.linalg.lstsq(roots[:, None] * shapes, roots * charges[boundary.vertices], rcond=1e-10)[0]
        return shapes @ fit


def _monomials(places: NDArray, degree: int) -> NDArray:
    """All products of up to `degree` coordinates, one column each; coordinates shifted and scaled to ±1."""
    middle = (places.max(axis=0) + places.min(axis=0)) / 2
    local = (places - middle) / (float(np.ptp(places, axis=0).max()) / 2 or 1.0)
    factors: Iterable[tuple[int, ...]] = (
        chosen for d in range(degree + 1) for chosen in combinations_with_replacement(range(places.shape[1]), d)
    )
    return np.column_stack([np.prod(local[:, list(chosen)], axis=1) for chosen in factors])


@dataclass(frozen=True)
class Lagged(Prescribed):
    """Prescribed values with the charge of the last accepted step: the scheme that oscillates (Fig. 8, upper).

    Without a `rule` the charge at the boundary itself; else sampled: `Lagged(InnerLayer())`, `Lagged(Averaged())`,
    `Lagged(LeastSquares())` are the remedies that the paper lists. `growth_factor` says whether a scene
    is stable with them.
    """

    rule: SamplingRule | None = None

    charge_of: ClassVar[Charge] = Charge.LAST_STEP

    def __post_init__(self) -> None:
        if self.rule is not None and not checks.is_a(self.rule, SamplingRule):
            raise InputError(
                f"Lagged: rule {checks.short(self.rule)} is none of InnerLayer(), Averaged(), LeastSquares(...)"
            )

    def __str__(self) -> str:
        return "prescribed with the charge of the last step" + (f", {self.rule}" if self.rule is not None else "")

    def suits(self, model: Model) -> bool:
        return model.charge_field is not None

    def values(self, on: PrescribedBoundary) -> dict[str, CoefficientFunction]:
        charge, boundary = on.charge, on.boundary
        if self.rule is None or charge is None:
            return on.equilibrium(charge)
        wanted = on.equilibrium(charge)
        slopes = Slopes(*(boundary.values(wanted[name].Diff(charge)) for name in ("p", "c")))
        sampled = GridFunction(charge.space)  # its first coefficients are the values at the vertices
        at_vertices = charge.vec.FV().NumPy()[: boundary.mesh.nv]
        sampled.vec.FV().NumPy()[boundary.vertices] = self.rule.sample(at_vertices, boundary, slopes)
        return on.equilibrium(sampled)
